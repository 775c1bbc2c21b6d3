"""Train stable-baselines3's SAC, an off-policy algorithm, through the same adapter as PPO.

The default settings need 3.22 strokes after 8 minutes, where PPO needs 1.00 after half a minute: agents/train_ppo.py is
the sample to start from.
"""

from __future__ import annotations

import contextlib
import functools
import time
from dataclasses import dataclass

import torch
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import ProgressBarCallback
from stable_baselines3.common.vec_env import VecMonitor

from agents.command_line import run_program
from agents.run_evaluation import EvalCheckpointCallback, check_sb3_model, finish_run, load_best
from agents.training_run import (
    TrainConfig,
    initialize_model,
    make_sb3_envs,
    save_on_interrupt,
    start_run,
)
from minigolf_env.evaluation.evaluate import EvaluationResult


@dataclass(frozen=True)
class SACConfig(TrainConfig):
    """Command-line arguments of this program."""

    total_timesteps: int = 60_000
    n_envs: int = 64
    eval_freq: int = 10_000

    learning_starts: int = 5_000
    """Number of random putts before the first update."""
    gradient_steps: int = 8
    """Number of updates after each step of the vector environment."""
    batch_size: int = 512
    """Number of putts in a minibatch."""
    learning_rate: float = 1e-3
    """Learning rate of policy, Q-functions and entropy coefficient."""
    gamma: float = 0.5
    """Discount factor."""
    net_arch: tuple[int, ...] = (128, 128)
    """Sizes of the hidden layers."""


def make_model(config: SACConfig, envs: VecMonitor) -> SAC:
    """Return a new model."""
    return SAC(
        "MlpPolicy",
        envs,
        learning_rate=config.learning_rate,
        learning_starts=config.learning_starts,
        gradient_steps=config.gradient_steps,
        batch_size=config.batch_size,
        gamma=config.gamma,
        policy_kwargs={"net_arch": list(config.net_arch)},
        seed=config.seed,
        device="cpu",
    )


def main(config: SACConfig) -> list[EvaluationResult]:
    """Train one model, evaluate its best checkpoint, and print a table of the results.

    Raises:
        SystemExit: an argument is invalid, or the run was interrupted; the message is one line.
    """
    started = time.monotonic()
    torch.set_num_threads(1)  # The networks are tiny: a second thread only waits for the first, at full load.
    config, folder = start_run(config, functools.partial(check_sb3_model, make_model))

    envs = make_sb3_envs(config)
    model = make_model(config, envs)
    initialize_model(model, config, folder)
    checkpoints = EvalCheckpointCallback(config, folder, model)

    with contextlib.closing(envs), save_on_interrupt(folder, checkpoints.save):
        remaining = max(0, config.total_timesteps - model.num_timesteps)
        callbacks = [checkpoints, ProgressBarCallback()]
        model.learn(remaining, callback=callbacks, reset_num_timesteps=False, tb_log_name="log")
        checkpoints.save_and_evaluate()

    with save_on_interrupt(folder):
        return finish_run(config, "SAC", load_best(model, config, folder), folder / "best.zip", started)


if __name__ == "__main__":
    run_program(main, SACConfig, __doc__)
