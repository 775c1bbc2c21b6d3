"""Train stable-baselines3's PPO on a hole, and end with a table: random, search, PPO.

With ``--resume runs/dogleg-1`` a run continues after an interruption, and ``tensorboard --logdir runs`` shows the
learning curves. The settings that matter are explained in docs/training.md.
"""

from __future__ import annotations

import contextlib
import functools
import time
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, ProgressBarCallback
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecMonitor

from agents.command_line import run_program
from agents.run_evaluation import EvalCheckpointCallback, check_sb3_model, finish_run, load_best
from agents.training_run import (
    RICH_CONSOLE,
    TrainConfig,
    initialize_model,
    make_sb3_envs,
    save_on_interrupt,
    start_run,
)
from minigolf_env.evaluation.evaluate import EvaluationResult

MAX_STROKES_ABOVE_SEARCH = 0.1
"""Largest difference of mean strokes between the agent and search with which a hole counts as learned."""

TORCH_ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}
"""Class of each activation function of ``PPOConfig``."""


@dataclass(frozen=True)
class PPOHyperparameters(TrainConfig):
    """Hyperparameters of PPO in stable-baselines3 and in RLlib; the defaults are the best ones found."""

    n_steps: int = 1
    """Number of putts in each environment between two updates."""
    batch_size: int = 256
    """Number of putts in a minibatch."""
    n_epochs: int = 6
    """Maximum number of passes over the putts of an update."""
    target_kl: float = 0.1
    """KL divergence beyond which an update ends early (in RLlib: target of the adaptive KL penalty)."""
    learning_rate: float = 2e-3
    """Initial learning rate; falls linearly to 0."""
    gamma: float = 0.5
    """Discount factor; small, as the immediate shaped reward approximates the action value."""
    gae_lambda: float = 0.5
    """Lambda of the generalized advantage estimate."""
    clip_range: float = 0.2
    """Largest change of a putt's probability ratio that the clipped objective rewards."""
    log_std_init: float = -1.9
    """Initial logarithm of the action noise's standard deviation, in units of the top speed."""
    log_std_final: float = -5.0
    """Final value of that logarithm, where the noise follows a schedule."""
    net_arch: tuple[int, ...] = (64, 64)
    """Sizes of the hidden layers."""

    def log_std_at(self, timesteps: int) -> float:
        """Return the logarithm of the noise's standard deviation after some time steps of the linear schedule."""
        progress = min(1.0, timesteps / self.total_timesteps)
        return self.log_std_init + progress * (self.log_std_final - self.log_std_init)


@dataclass(frozen=True)
class PPOConfig(PPOHyperparameters):
    """Command-line arguments of this program."""

    anneal_std: bool = False
    """Narrow the action noise by a linear schedule from log_std_init to log_std_final, instead of learning it."""
    ent_coef: float = 0.0
    """Weight of the entropy bonus; without effect on annealed noise."""
    activation_fn: Literal["tanh", "relu"] = "tanh"
    """Activation function of the hidden layers."""
    max_runs: int = 1
    """Maximum number of runs: while a run ends more than 0.1 strokes above search, start another with the next seed."""


class LogStdSchedule(BaseCallback):
    """Narrows the action noise by a linear schedule.

    With few updates PPO may shrink learned noise around the first putts that leave a tap-in, and never find the
    hole-in-one next to them. Wide noise smooths the expected return over actions; as it narrows, the mean follows the
    maximum to the hole-in-one.
    """

    def __init__(self, config: PPOHyperparameters) -> None:
        super().__init__()
        self.config = config

    @property
    def log_std(self) -> torch.Tensor:
        """Parameter (2,) of the policy."""
        return cast(torch.Tensor, self.model.policy.log_std)

    def _on_training_start(self) -> None:
        self.log_std.requires_grad_(False)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        self.log_std.data.fill_(self.config.log_std_at(self.num_timesteps))


def make_model(config: PPOConfig, envs: VecMonitor, policy: str = "MlpPolicy", **policy_kwargs: Any) -> PPO:
    """Return a new model; ``policy_kwargs`` are added to those of the configuration."""
    return PPO(
        policy,
        envs,
        learning_rate=LinearSchedule(config.learning_rate, 0.0, 1.0),
        n_steps=config.n_steps,
        batch_size=config.batch_size,
        n_epochs=config.n_epochs,
        target_kl=config.target_kl,
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        clip_range=config.clip_range,
        ent_coef=config.ent_coef,
        policy_kwargs={
            "net_arch": list(config.net_arch),
            "activation_fn": TORCH_ACTIVATIONS[config.activation_fn],
            "log_std_init": config.log_std_init,
            **policy_kwargs,
        },
        seed=config.seed,
        device="cpu",
    )


def main(config: PPOConfig) -> list[EvaluationResult]:
    """Train one model, evaluate its best checkpoint, and print a table of the results.

    Raises:
        SystemExit: an argument is invalid, or the run was interrupted; the message is one line.
    """
    started = time.monotonic()
    torch.set_num_threads(1)  # The networks are tiny: a second thread only waits for the first, at full load.

    # Create the run folder, or reopen the one to resume.
    config, folder = start_run(config, functools.partial(check_sb3_model, make_model))

    # Create environments, model and callbacks.
    envs = make_sb3_envs(config)
    model = make_model(config, envs)
    initialize_model(model, config, folder)
    checkpoints = EvalCheckpointCallback(config, folder, model)
    callbacks: list[BaseCallback] = [checkpoints, ProgressBarCallback()]
    if config.anneal_std:
        callbacks.insert(0, LogStdSchedule(config))

    # Learn; time steps and learning-rate schedule continue over resumed runs.
    with contextlib.closing(envs), save_on_interrupt(folder, checkpoints.save):
        remaining = max(0, config.total_timesteps - model.num_timesteps)
        model.learn(remaining, callback=callbacks, reset_num_timesteps=False, tb_log_name="log")
        checkpoints.save_and_evaluate()

    # Evaluate the best checkpoint.
    with save_on_interrupt(folder):
        return finish_run(config, "PPO", load_best(model, config, folder), folder / "best.zip", started)


def train_until_learned(config: PPOConfig) -> list[EvaluationResult]:
    """Call ``main`` with successive seeds until a run comes close to search, at most ``max_runs`` times.

    Raises:
        SystemExit: as for ``main``.
    """
    if config.max_runs < 1:
        raise SystemExit(f"max_runs: expected at least 1, received {config.max_runs}.")
    if config.max_runs > 1 and config.n_search_episodes == 0:
        raise SystemExit(
            f"max_runs: expected 1 without search to compare with, received {config.max_runs}; add --max-runs 1."
        )
    for run in range(config.max_runs):
        seed = config.seed + run
        out = config.out
        if run > 0 and out is not None:
            out = out.with_name(f"{out.name}-{run + 1}")
        scores = main(replace(config, seed=seed, out=out))
        if run + 1 == config.max_runs or config.resume is not None:
            break
        strokes = {score.policy: score.strokes for score in scores}
        excess = strokes["PPO"] - strokes["search"]
        if excess <= MAX_STROKES_ABOVE_SEARCH:
            break
        RICH_CONSOLE.print(
            f"Seed {seed} got stuck {excess:.2f} strokes above search: starting again with seed {seed + 1}."
        )
    return scores


if __name__ == "__main__":
    run_program(train_until_learned, PPOConfig, __doc__)
