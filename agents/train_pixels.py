"""Train PPO on pictures alone, with a small convolutional network: slow without a GPU, and far better than random.

``python -m agents.train_pixels``.
"""

from __future__ import annotations

from dataclasses import dataclass

import gymnasium as gym
import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecMonitor

from agents import train_ppo
from minigolf_env.evaluation.evaluate import EvaluationResult


@dataclass(frozen=True)
class Args(train_ppo.Args):
    """The command line."""

    observation: str = "pixels"
    putts: int = 60_000
    check_every: int = 10_000
    check_episodes: int = 100
    final_episodes: int = 200

    num_envs: int = 128
    n_steps: int = 4
    batch_size: int = 128
    n_epochs: int = 4
    learning_rate: float = 1e-3
    log_std: tuple[float, float] = (-1.5, -3.5)
    anneal: bool = True
    features: int = 64
    """Numbers that a picture becomes."""


class SmallCNN(BaseFeaturesExtractor):
    """Two convolutions and a layer: a fifth of the work of stable-baselines3's own."""

    def __init__(self, observation_space: gym.spaces.Box, features_dim: int) -> None:
        super().__init__(observation_space, features_dim)
        channels, height, width = observation_space.shape
        eyes = torch.nn.Sequential(
            torch.nn.Conv2d(channels, 16, 8, stride=4),
            torch.nn.ReLU(),
            torch.nn.Conv2d(16, 16, 4, stride=2),
            torch.nn.ReLU(),
            torch.nn.Flatten(),
        )
        seen = eyes(torch.zeros(1, channels, height, width)).shape[1]
        self.layers = torch.nn.Sequential(eyes, torch.nn.Linear(seen, features_dim), torch.nn.Tanh())

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the features (N, features_dim) of pictures (N, channels, height, width), 0 to 1."""
        features: torch.Tensor = self.layers(observations)
        return features


def build(args: Args, envs: VecMonitor) -> PPO:
    """Return a new learner."""
    eyes = {"features_extractor_class": SmallCNN, "features_extractor_kwargs": {"features_dim": args.features}}
    return train_ppo.build(args, envs, "CnnPolicy", **eyes)


def main(args: Args) -> list[EvaluationResult]:
    """Train, score, print the table."""
    return train_ppo.main(args, build)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
