"""Train PPO on images alone, with a small convolutional network, on the CPU.

The default settings need 2.13 strokes after 3 minutes; random play needs 9.4.
"""

from __future__ import annotations

import contextlib
import functools
import time
from dataclasses import dataclass

import gymnasium as gym
import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, ProgressBarCallback
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecMonitor

from agents.command_line import run_program
from agents.run_evaluation import EvalCheckpointCallback, check_sb3_model, finish_run, load_best
from agents.train_ppo import LogStdSchedule, PPOConfig, make_model
from agents.training_run import (
    initialize_model,
    make_sb3_envs,
    save_on_interrupt,
    start_run,
)
from minigolf_env._validation import quote
from minigolf_env.evaluation.evaluate import EvaluationResult


@dataclass(frozen=True)
class PixelsConfig(PPOConfig):
    """Command-line arguments of this program."""

    observation: str = "pixels"
    total_timesteps: int = 60_000
    eval_freq: int = 10_000
    n_eval_episodes: int = 100
    n_test_episodes: int = 200

    n_envs: int = 128
    n_steps: int = 4
    batch_size: int = 128
    n_epochs: int = 4
    learning_rate: float = 1e-3
    log_std_init: float = -1.5
    log_std_final: float = -3.5
    anneal_std: bool = True
    features_dim: int = 64
    """Number of features that the convolutional network computes from an image."""
    max_runs: tyro.conf.Suppress[int] = 1
    """Fixed at one run: this program does not come close to search."""


class SmallCNN(BaseFeaturesExtractor):
    """Two convolutions and a dense layer, a fifth of the work of stable-baselines3's NatureCNN."""

    def __init__(self, observation_space: gym.spaces.Box, features_dim: int) -> None:
        super().__init__(observation_space, features_dim)
        channels, height, width = observation_space.shape
        cnn = torch.nn.Sequential(
            torch.nn.Conv2d(channels, 16, 8, stride=4),
            torch.nn.ReLU(),
            torch.nn.Conv2d(16, 16, 4, stride=2),
            torch.nn.ReLU(),
            torch.nn.Flatten(),
        )
        flat_dim = cnn(torch.zeros(1, channels, height, width)).shape[1]
        self.layers = torch.nn.Sequential(cnn, torch.nn.Linear(flat_dim, features_dim), torch.nn.Tanh())

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the features (N, features_dim) of images (N, channels, height, width) with values from 0 to 1."""
        features: torch.Tensor = self.layers(observations)
        return features


def make_pixel_model(config: PixelsConfig, envs: VecMonitor) -> PPO:
    """Return a new model with a small convolutional network."""
    cnn = {"features_extractor_class": SmallCNN, "features_extractor_kwargs": {"features_dim": config.features_dim}}
    return make_model(config, envs, "CnnPolicy", **cnn)


def main(config: PixelsConfig) -> list[EvaluationResult]:
    """Train one model, evaluate its best checkpoint, and print a table of the results.

    Raises:
        SystemExit: an argument is invalid, or the run was interrupted; the message is one line.
    """
    started = time.monotonic()
    torch.set_num_threads(1)  # A second thread mostly waits for the first, at full load.
    if config.observation != "pixels":
        raise SystemExit(f'observation: expected "pixels", received {quote(config.observation)}; use agents.train_ppo.')
    config, folder = start_run(config, functools.partial(check_sb3_model, make_pixel_model))

    envs = make_sb3_envs(config)
    model = make_pixel_model(config, envs)
    initialize_model(model, config, folder)
    checkpoints = EvalCheckpointCallback(config, folder, model)
    callbacks: list[BaseCallback] = [checkpoints, ProgressBarCallback()]
    if config.anneal_std:
        callbacks.insert(0, LogStdSchedule(config))

    with contextlib.closing(envs), save_on_interrupt(folder, checkpoints.save):
        remaining = max(0, config.total_timesteps - model.num_timesteps)
        model.learn(remaining, callback=callbacks, reset_num_timesteps=False, tb_log_name="log")
        checkpoints.save_and_evaluate()

    with save_on_interrupt(folder):
        return finish_run(config, "PPO", load_best(model, config, folder), folder / "best.zip", started)


if __name__ == "__main__":
    run_program(main, PixelsConfig, __doc__)
