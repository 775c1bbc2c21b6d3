"""Train one policy on many levels, from what a ball feels around it, and score it on levels it has never seen.

A network learns to judge putts: from what a ball can foresee of a putt (minigolf_env/players/putt_features.py),
whether it holes out,
and how far it leaves to go if not. From each place many putts are tried, by ``what_if``: the one that it judges best,
others near it, and others anywhere. One of them is played. The policy plays what it judges best of some hundred.
That is regression, without a gradient of a policy: which of several ways to the cup is best may change from one level
to the next, and a judge of putts can say so where the one mean of a Gaussian ends between them.

``python -m agents.train_generalist``; then ``minigolf benchmark --policy runs/procedural-1/best.npz`` compares it with
search on fixed sets of levels. docs/training.md says what it reaches and what else was tried.
"""

from __future__ import annotations

import itertools
import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from rich.progress import MofNCompleteColumn, Progress
from stable_baselines3.common.logger import configure
from torch.nn.functional import binary_cross_entropy_with_logits, mse_loss, softplus

from agents import runs
from minigolf_env._atomic_io import atomic_write
from minigolf_env.courses.procedural import PROCEDURAL_COURSE
from minigolf_env.envs.rewards import shaping_potential
from minigolf_env.envs.task import TaskBatch
from minigolf_env.evaluation.evaluate import EvaluationResult
from minigolf_env.players.mlp import MLP, Layer
from minigolf_env.players.model_files import check_torch_file, load_model, save_model
from minigolf_env.players.policies import ModelPolicy
from minigolf_env.players.putt_features import MAX_ROLL, NUM_FEATURES, REFLECTION_SIGNS, putt_actions, putt_features
from minigolf_env.players.putt_optimizer import MIN_ROLL, TRAINING_PUTT_GRID, BestPutts, optimize_putt
from minigolf_env.players.putt_value_model import PuttValueModel

Array = NDArray[np.float32]

ANYWHERE = (0.4, MAX_ROLL)
"""Least and largest roll of putts tried anywhere, m."""

NEAR = ((0.003, 0.3), (0.01, 0.5))
"""Least and largest standard deviation, of direction (radians) and of the roll's logarithm, of putts near the best."""


@dataclass(frozen=True)
class Args(runs.Run):
    """The command line."""

    course: str = PROCEDURAL_COURSE
    difficulties: tuple[str, ...] = ("easy", "medium", "medium")
    """Of the levels, learned as often as they are named, and scored."""
    num_levels: int | None = 500_000
    observation: str = "bounce_rays"
    putts: int = 2_000_000
    """Putts to try."""
    num_envs: int = 96
    """Of each difficulty, as often as it is named."""
    tries: int = 32
    """Putts tried from each place; one of them is played."""
    greedy: float = 0.6
    """How often that is the one judged best."""

    memory: int = 2_000_000
    """Putts learned from: the last ones."""
    reuse: float = 16.0
    """How often a putt is learned from, on average."""
    batch_size: int = 2048
    learning_rate: float = 2e-3
    """At the start; falls linearly to 0."""
    hidden: tuple[int, ...] = (192, 192, 192)

    check_every: int = 500_000
    check_episodes: int = 200
    check_seed: int = 500_000
    final_episodes: int = 200

    @property
    def games(self) -> list[dict[str, Any]]:
        """One for each difficulty."""
        return [game for k, game in enumerate(self.learned) if game not in self.learned[:k]]

    @property
    def learned(self) -> list[dict[str, Any]]:
        """One for each time that a difficulty is named."""
        if self.course != PROCEDURAL_COURSE:
            return [self.game]
        return [{**self.game, "difficulty": difficulty} for difficulty in self.difficulties]


class Memory:
    """The last putts, and what became of them.

    Args:
        size: how many.
        rng: draws those to learn from.
    """

    def __init__(self, size: int, rng: np.random.Generator) -> None:
        self.sights, self.targets = np.empty((size, NUM_FEATURES), np.float32), np.empty((size, 2), np.float32)
        self.rng, self.added = rng, 0

    def add(self, sights: Array, targets: Array) -> None:
        """Take in putts (N, NUM_FEATURES) and what became of them (N, 2), in place of the oldest."""
        rows = (self.added + np.arange(len(sights))) % len(self.sights)
        self.sights[rows], self.targets[rows] = sights, targets
        self.added += len(sights)

    def draw(self, number: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Return some putts, every second one mirrored, and what became of them."""
        rows = self.rng.integers(min(self.added, len(self.sights)), size=number)
        sights = self.sights[rows]
        sights[::2] *= REFLECTION_SIGNS
        return torch.from_numpy(sights), torch.from_numpy(self.targets[rows])


class Training:
    """The learner: plays, learns, saves.

    Args:
        args: of the run.
        folder: of the run; if it has a checkpoint, training goes on from there, with a new memory.
    """

    def __init__(self, args: Args, folder: Path) -> None:
        torch.manual_seed(args.seed)
        self.args, self.folder, self.progress = args, folder, runs.Progress(args, folder)
        sizes = (NUM_FEATURES, *args.hidden, 2)
        parts = [(torch.nn.Linear(*pair), torch.nn.ReLU()) for pair in itertools.pairwise(sizes)]
        self.net = torch.nn.Sequential(*list(itertools.chain(*parts))[:-1])
        self.optimizer = torch.optim.AdamW(self.net.parameters(), args.learning_rate, weight_decay=1e-3)
        self.putts = 0
        if (folder / "checkpoint.pt").is_file():
            check_torch_file((folder / "checkpoint.pt").read_bytes())
            stored = torch.load(folder / "checkpoint.pt", weights_only=True)
            self.net.load_state_dict(stored["net"])
            self.optimizer.load_state_dict(stored["optimizer"])
            self.putts = stored["putts"]
        elif args.start is not None:
            model = load_model(args.start)
            if not isinstance(model, PuttValueModel):
                raise SystemExit(f"start: expected a value model of putts, received a policy in {args.start}.")
            self.begin_with(model)
        self.saved_at = self.putts
        # One to play by and one to learn by, which goes on at the same time. Resumed, not the same levels again.
        self.rng, learning = np.random.default_rng((args.seed, self.putts)).spawn(2)
        self.memory = Memory(args.memory, learning)
        self.batches = [runs.make_batch(args, game) for game in args.learned]
        self.seen = [batch.reset(seed=int(self.rng.integers(2**31)))[0] for batch in self.batches]
        self.logger = configure(str(folder / "log"), ["tensorboard"])

    @property
    def judge(self) -> PuttValueModel:
        """The network as it is now, for numpy."""
        linear = [layer for layer in self.net if isinstance(layer, torch.nn.Linear)]
        arrays = ((layer.weight.detach().numpy().T, layer.bias.detach().numpy()) for layer in linear)
        layers = tuple(Layer(np.array(weights, order="C"), bias.copy()) for weights, bias in arrays)
        return PuttValueModel(MLP(layers, "relu"))

    def begin_with(self, judge: PuttValueModel) -> None:
        """Take over the weights of a model."""
        sizes = [[layer.weights.shape for layer in model.mlp.layers] for model in (self.judge, judge)]
        if sizes[0] != sizes[1]:
            raise SystemExit(f"start: expected a model with layers {sizes[0]}, received {sizes[1]}; set --hidden.")
        arrays = [array for layer in judge.mlp.layers for array in (layer.weights.T, layer.bias)]
        for weights, array in zip(self.net.parameters(), arrays, strict=True):
            weights.data = torch.tensor(array)

    def run(self) -> None:
        """Play and learn until the putts are tried. What is learned from was played while the last was learned."""
        bar = Progress(*Progress.get_default_columns(), MofNCompleteColumn(), console=runs.CONSOLE)
        with ThreadPoolExecutor(1) as pool, bar:
            task = bar.add_task("putts", total=self.args.putts, completed=self.putts)
            played = pool.submit(self.play, self.judge)
            while self.putts < self.args.putts:
                sights, targets = played.result()
                self.memory.add(sights, targets)
                played = pool.submit(self.play, self.judge)
                self.learn(round(len(sights) * self.args.reuse / self.args.batch_size))
                self.putts += len(sights)
                bar.update(task, completed=self.putts)
                if self.putts - self.saved_at >= self.args.check_every:
                    self.check()

    def play(self, judge: PuttValueModel) -> tuple[Array, Array]:
        """Try putts from where the balls lie, and play one of each ball's; return sights, and what became of them.

        That is whether a putt holed out, and the strokes that it leaves if not, as shaping guesses them.
        """
        played = [self.play_batch(judge, k) for k in range(len(self.batches))]
        sights, targets = (np.concatenate(arrays) for arrays in zip(*played, strict=True))
        return sights, targets

    def play_batch(self, judge: PuttValueModel, k: int) -> tuple[Array, Array]:
        """Do so in one of the batches."""
        args, envs, rng, seen = self.args, self.batches[k].unwrapped, self.rng, self.seen[k]
        directions, rolls = self.around(optimize_putt(seen, judge.expected_strokes, TRAINING_PUTT_GRID, rng))
        outcome = envs.what_if(putt_actions(*self.disturb(directions, rolls)))  # type: ignore[attr-defined]
        tasks: TaskBatch = envs.task_batch  # type: ignore[attr-defined]
        left = -shaping_potential(tasks, outcome.position.swapaxes(0, 1)).T
        rows, tries = np.arange(len(seen)), rng.integers(args.tries, size=len(seen))
        played = rows, np.where(rng.random(len(seen)) < args.greedy, 0, tries)
        self.seen[k] = envs.step(putt_actions(directions[played], rolls[played]))[0]
        sights = putt_features(seen, directions, rolls[..., None])
        return sights.reshape(-1, NUM_FEATURES), np.stack([outcome.holed, left], -1, dtype=np.float32).reshape(-1, 2)

    def around(self, chosen: BestPutts) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return directions and rolls (N, tries) to try: the best putt's, then half near it, the rest anywhere."""
        shape, rng = (len(chosen.roll), self.args.tries), self.rng
        spread, push = (log_uniform(rng, between, shape) * rng.normal(size=shape) for between in NEAR)
        order = np.broadcast_to(np.arange(self.args.tries), shape)
        near = order <= self.args.tries // 2
        directions = chosen.direction[:, None] + spread * (order > 0)
        rolls = np.clip(chosen.roll[:, None] * np.exp(push * (order > 0)), MIN_ROLL, MAX_ROLL)
        anywhere = log_uniform(rng, ANYWHERE, shape)
        return np.where(near, directions, rng.uniform(0.0, 2.0 * np.pi, shape)), np.where(near, rolls, anywhere)

    def disturb(self, directions: NDArray[Any], rolls: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return putts as ``putt_noise`` disturbs them, which ``what_if`` does not."""
        degrees, share = self.args.putt_noise
        turn, push = self.rng.normal(size=(2, *rolls.shape))
        return directions + np.radians(degrees) * turn, rolls * np.square(np.maximum(0.0, 1.0 + share * push))

    def learn(self, updates: int) -> None:
        """Take some steps down the gradient."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.args.learning_rate * max(0.0, 1.0 - self.putts / self.args.putts)
        for _ in range(updates):
            sights, targets = self.memory.draw(self.args.batch_size)
            (logit, after), (holed, left) = self.net(sights).T, targets.T
            missed = binary_cross_entropy_with_logits(logit, holed)
            misjudged = mse_loss((1.0 - holed) * softplus(after), (1.0 - holed) * left)
            self.optimizer.zero_grad()
            torch.autograd.backward(missed + misjudged)
            self.optimizer.step()
            self.logger.record_mean("loss/holed", missed.item())
            self.logger.record_mean("loss/left", misjudged.item())

    def save(self) -> None:
        """Write the checkpoint: as a model that plays, and what else it takes to go on."""
        state = {"net": self.net.state_dict(), "optimizer": self.optimizer.state_dict(), "putts": self.putts}
        with atomic_write(self.folder / "checkpoint.pt") as part:
            torch.save(state, part)
        self.keep("checkpoint.npz")

    def keep(self, name: str) -> None:
        """Write the model that plays under a name."""
        with atomic_write(self.folder / name) as part:
            save_model(self.judge, part)

    def check(self) -> None:
        """Save, score, and keep the model if it is the best so far."""
        self.saved_at = self.putts
        self.save()
        policy = ModelPolicy(self.folder / "checkpoint.npz")
        for name, value in self.progress.score(policy, self.putts, lambda: self.keep("best.npz")).items():
            self.logger.record(f"eval/{name}", value)
        self.logger.dump(self.putts)


def log_uniform(rng: np.random.Generator, between: tuple[float, float], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return numbers whose logarithms are spread evenly."""
    return np.exp(rng.uniform(math.log(between[0]), math.log(between[1]), shape))


def main(args: Args) -> list[EvaluationResult]:
    """Train, score, print the tables."""
    began = time.monotonic()
    if args.observation != "bounce_rays" or args.reward != "shaped":
        raise SystemExit(
            f"expected observation bounce_rays and reward shaped, received {args.observation} and {args.reward}."
        )
    if args.difficulty is not None:
        raise SystemExit(f"difficulty: expected none, received {args.difficulty!r}; give --difficulties, one or more.")
    args, folder = runs.begin(args)
    torch.set_num_threads(1)  # The network is tiny, and another thread plays.
    training = Training(args, folder)
    with runs.stoppable(folder, training.save):
        training.run()
        training.check()
    with runs.stoppable(folder, lambda: None):
        return runs.end(args, "generalist", ModelPolicy(folder / "best.npz"), folder / "best.npz", began)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
