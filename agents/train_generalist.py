"""Train a Q-function over putts on many generated levels, and evaluate it on held-out levels.

The network predicts from the features of a putt (minigolf_env/players/putt_features.py) the probability that it holes
out, and the strokes that remain if it does not. The policy plays the putt with the fewest expected strokes among
several hundred candidates.

Training is regression on single simulated putts (a contextual bandit). The targets are whether the putt holes out, and
an estimate of the strokes that remain otherwise: 1 + 0.3 for each metre along the course to the cup, as in the
potential of the shaped reward. From each ball position ``what_if`` simulates many candidates, namely the greedy one,
others close to it, and random ones; all of them go into the replay buffer, and one of them is played. There is no
policy gradient: action values are multimodal, and the best mode changes from level to level. A Q-function can represent
all modes, where the mean of a Gaussian policy averages them.

Afterwards ``minigolf benchmark --policy runs/procedural-1/best.npz`` compares the model with search on fixed sets of
levels. The results are in docs/training.md.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import MofNCompleteColumn, Progress
from stable_baselines3.common.logger import configure
from stable_baselines3.common.torch_layers import create_mlp
from torch.nn.functional import binary_cross_entropy_with_logits, mse_loss, softplus

from agents.command_line import run_program
from agents.config_check import check_weights
from agents.putt_collector import PuttCollector
from agents.run_evaluation import EVALUATION_METRICS, EvaluationHistory, check_history, finish_run
from agents.training_run import (
    NO_FOLDER,
    RICH_CONSOLE,
    TrainConfig,
    make_vector_env,
    save_on_interrupt,
    start_run,
)
from minigolf_env._atomic_io import atomic_write
from minigolf_env._validation import quote
from minigolf_env.courses.procedural import PROCEDURAL_COURSE
from minigolf_env.evaluation.evaluate import EvaluationResult
from minigolf_env.players.mlp import MLP, Layer
from minigolf_env.players.model_files import check_torch_file, load_model, save_model
from minigolf_env.players.policies import ModelPolicy
from minigolf_env.players.putt_features import NUM_FEATURES, REFLECTION_SIGNS
from minigolf_env.players.putt_value_model import PuttValueModel

Array = NDArray[np.float32]


@dataclass(frozen=True)
class GeneralistConfig(TrainConfig):
    """Command-line arguments of this program."""

    course: str = PROCEDURAL_COURSE
    difficulties: tuple[str, ...] = ("easy", "medium", "medium")
    """Difficulties of the levels; naming one twice doubles its number of training environments."""
    num_levels: int | None = 500_000
    observation: str = "bounce_rays"
    total_timesteps: int = 2_000_000
    """Number of candidate putts to simulate; a time step of this program is a candidate."""
    n_envs: int = 96
    """Number of environments for each entry of ``difficulties``."""
    num_candidates: int = 32
    """Number of putts simulated from each ball position; one of them is played."""
    greedy_prob: float = 0.6
    """Probability that the greedy candidate is the one played; otherwise it is a random one of the candidates."""

    buffer_size: int = 2_000_000
    """Capacity of the replay buffer, putts."""
    replay_ratio: float = 16.0
    """Average number of times that a putt is sampled from the replay buffer."""
    batch_size: int = 2048
    """Number of putts in a minibatch."""
    learning_rate: float = 2e-3
    """Initial learning rate; falls linearly to 0."""
    net_arch: tuple[int, ...] = (192, 192, 192)
    """Sizes of the hidden layers."""

    eval_freq: int = 500_000
    n_eval_episodes: int = 200
    eval_seed: int = 500_000
    n_test_episodes: int = 200

    @property
    def training_env_args(self) -> list[dict[str, Any]]:
        """Arguments of each vector environment for training: one for each entry of ``difficulties``."""
        if self.course != PROCEDURAL_COURSE:
            return [self.env_args]
        return [{**self.env_args, "difficulty": difficulty} for difficulty in self.difficulties]

    @property
    def eval_env_args(self) -> list[dict[str, Any]]:
        """Arguments of each environment of the evaluations: one for each different difficulty."""
        env_args = self.training_env_args
        return [args for k, args in enumerate(env_args) if args not in env_args[:k]]


class ReplayBuffer:
    """Features and outcomes of the latest putts.

    Args:
        capacity: number of putts kept.
        rng: random generator of ``sample``.
    """

    def __init__(self, capacity: int, rng: np.random.Generator) -> None:
        self._features = np.empty((capacity, NUM_FEATURES), np.float32)
        self._targets = np.empty((capacity, 2), np.float32)
        self._rng = rng
        self._num_added = 0

    def add(self, features: Array, targets: Array) -> None:
        """Add the features (N, NUM_FEATURES) and the targets (N, 2) of putts, in place of the oldest ones."""
        rows = (self._num_added + np.arange(len(features))) % len(self._features)
        self._features[rows] = features
        self._targets[rows] = targets
        self._num_added += len(features)

    def sample(self, batch_size: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Return features and targets of random putts; every second putt is mirrored left to right."""
        rows = self._rng.integers(min(self._num_added, len(self._features)), size=batch_size)
        features = self._features[rows]
        features[::2] *= REFLECTION_SIGNS
        return torch.from_numpy(features), torch.from_numpy(self._targets[rows])


class QLearner:
    """The Q-network with its optimizer, replay buffer and collector.

    Args:
        config: configuration of the run.
        folder: run folder; if it has a checkpoint, training resumes there, with an empty replay buffer.
    """

    def __init__(self, config: GeneralistConfig, folder: Path) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.folder = folder
        self.history = EvaluationHistory(config, folder)
        self.net = torch.nn.Sequential(*create_mlp(NUM_FEATURES, 2, list(config.net_arch)))
        self.optimizer = torch.optim.AdamW(self.net.parameters(), config.learning_rate, weight_decay=1e-3)
        self.num_timesteps = 0
        if self.checkpoint_path.exists():
            self.load_checkpoint()
        elif config.init_weights is not None:
            self.load_weights(config.init_weights)
        self.last_saved = self.num_timesteps

        # Collecting and learning run at the same time, each with a generator. A resumed run draws other levels.
        collector_rng, buffer_rng = np.random.default_rng((config.seed, self.num_timesteps)).spawn(2)
        self.buffer = ReplayBuffer(config.buffer_size, buffer_rng)
        self.collector = PuttCollector(
            [make_vector_env(config, env_args) for env_args in config.training_env_args],
            collector_rng,
            num_candidates=config.num_candidates,
            greedy_prob=config.greedy_prob,
            putt_noise=config.putt_noise,
        )

    def start(self) -> None:
        """Start the log in the run folder."""
        self.logger = configure(str(self.folder / "log"), ["tensorboard"])

    @property
    def checkpoint_path(self) -> Path:
        """File with weights, optimizer state and step count."""
        return self.folder / "checkpoint.pt"

    @property
    def q_function(self) -> PuttValueModel:
        """Copy of the Q-network as it is now, for numpy."""
        linear = [layer for layer in self.net if isinstance(layer, torch.nn.Linear)]
        arrays = ((layer.weight.detach().numpy().T, layer.bias.detach().numpy()) for layer in linear)
        layers = tuple(Layer(np.array(weights, order="C"), bias.copy()) for weights, bias in arrays)
        return PuttValueModel(MLP(layers, "relu"))

    def load_checkpoint(self) -> None:
        """Load weights, optimizer state and step count from the run folder."""
        check_torch_file(self.checkpoint_path.read_bytes())
        stored = torch.load(self.checkpoint_path, weights_only=True)
        self.net.load_state_dict(stored["net"])
        check_weights(self.net)
        self.optimizer.load_state_dict(stored["optimizer"])
        self.num_timesteps = stored["num_timesteps"]

    def load_weights(self, path: Path) -> None:
        """Copy the weights of a model file.

        Raises:
            SystemExit: the file holds another kind of model or has other layer sizes.
        """
        model = load_model(path)
        if not isinstance(model, PuttValueModel):
            raise SystemExit(f"init_weights: expected a putt value model, received a policy in {path}.")
        expected = [layer.weights.shape for layer in self.q_function.mlp.layers]
        received = [layer.weights.shape for layer in model.mlp.layers]
        if expected != received:
            raise SystemExit(
                f"init_weights: expected a model with layers {expected}, received {received}; set --net-arch."
            )
        arrays = [array for layer in model.mlp.layers for array in (layer.weights.T, layer.bias)]
        for parameter, array in zip(self.net.parameters(), arrays, strict=True):
            parameter.data = torch.tensor(array)

    def learn(self) -> None:
        """Collect putts and update the network until ``total_timesteps`` candidates have been simulated.

        A second thread collects the next putts while the network learns from the ones before.
        """
        config = self.config
        bar = Progress(*Progress.get_default_columns(), MofNCompleteColumn(), console=RICH_CONSOLE)
        with ThreadPoolExecutor(1) as executor, bar:
            bar_task = bar.add_task("time steps", total=config.total_timesteps, completed=self.num_timesteps)
            collected = executor.submit(self.collector.collect, self.q_function)
            while self.num_timesteps < config.total_timesteps:
                features, targets = collected.result()
                self.buffer.add(features, targets)
                collected = executor.submit(self.collector.collect, self.q_function)
                self.update(round(len(features) * config.replay_ratio / config.batch_size))
                self.num_timesteps += len(features)
                bar.update(bar_task, completed=self.num_timesteps)
                if self.num_timesteps - self.last_saved >= config.eval_freq:
                    self.save_and_evaluate()

    def update(self, num_updates: int) -> None:
        """Take gradient steps on batches from the replay buffer."""
        config = self.config
        for group in self.optimizer.param_groups:
            group["lr"] = config.learning_rate * max(0.0, 1.0 - self.num_timesteps / config.total_timesteps)
        for _ in range(num_updates):
            features, targets = self.buffer.sample(config.batch_size)
            holed_logit, remaining_raw = self.net(features).T
            holed, remaining = targets.T
            holed_loss = binary_cross_entropy_with_logits(holed_logit, holed)
            remaining_loss = mse_loss((1.0 - holed) * softplus(remaining_raw), (1.0 - holed) * remaining)
            self.optimizer.zero_grad()
            torch.autograd.backward(holed_loss + remaining_loss)
            self.optimizer.step()
            self.logger.record_mean("loss/holed", holed_loss.item())
            self.logger.record_mean("loss/remaining", remaining_loss.item())

    def save_checkpoint(self) -> None:
        """Write the checkpoint: the model for evaluation, and what training needs to resume."""
        state = {
            "net": self.net.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "num_timesteps": self.num_timesteps,
        }
        with atomic_write(self.checkpoint_path) as temporary_file:
            torch.save(state, temporary_file)
        self.save_model("checkpoint.npz")

    def save_model(self, name: str) -> None:
        """Write the model under a name in the run folder."""
        with atomic_write(self.folder / name) as temporary_file:
            save_model(self.q_function, temporary_file)

    def save_and_evaluate(self) -> None:
        """Write a checkpoint, evaluate it, and keep the model if it is the best so far."""
        self.last_saved = self.num_timesteps
        self.save_checkpoint()
        row = self.history.evaluate(ModelPolicy(self.folder / "checkpoint.npz"), self.num_timesteps)
        if row["strokes"] < self.history.best_strokes:
            self.save_model("best.npz")
        self.history.append(row)
        for name in EVALUATION_METRICS:
            self.logger.record(f"eval/{name}", row[name])
        self.logger.dump(self.num_timesteps)


def check_learner(config: GeneralistConfig, folder: Path | None) -> None:
    """Make a learner with the initial weights, or with the checkpoint of the run folder that is resumed.

    Raises:
        Exception: that cannot be done; libraries raise errors of many kinds.
    """
    QLearner(config, folder or NO_FOLDER)
    if folder is not None and check_history(config, folder, "checkpoint.pt").rows:
        ModelPolicy(folder / "best.npz")


def main(config: GeneralistConfig) -> list[EvaluationResult]:
    """Train one model, evaluate its best checkpoint, and print a table of the results for each difficulty.

    Raises:
        SystemExit: an argument is invalid, or the run was interrupted; the message is one line.
    """
    started = time.monotonic()
    for name, needed in (("observation", "bounce_rays"), ("reward", "shaped")):
        if getattr(config, name) != needed:
            raise SystemExit(f"{name}: expected {needed}, received {quote(getattr(config, name))}.")
    if config.difficulty is not None:
        raise SystemExit(
            f"difficulty: expected none, received {quote(config.difficulty)}; give --difficulties, one or more."
        )
    if not config.difficulties:
        raise SystemExit("difficulties: expected one or more of easy, medium and hard, received none.")
    config, folder = start_run(config, check_learner)
    torch.set_num_threads(1)  # The network is tiny, and the environments run in another thread.
    learner = QLearner(config, folder)
    learner.start()
    with save_on_interrupt(folder, learner.save_checkpoint):
        learner.learn()
        learner.save_and_evaluate()
    with save_on_interrupt(folder):
        best_model = folder / "best.npz"
        return finish_run(config, "generalist", ModelPolicy(best_model), best_model, started)


if __name__ == "__main__":
    run_program(main, GeneralistConfig, __doc__)
