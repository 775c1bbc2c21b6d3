"""Check that stable-baselines3's PPO with all its defaults improves on MiniGolf-v0: python -m benchmarks.stock_ppo.

Trains ``PPO("MlpPolicy", "MiniGolf-v0").learn(100_000)`` with each reward, and evaluates it before and after.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import gymnasium as gym
import tyro
from stable_baselines3 import PPO

from minigolf_env.evaluation.evaluate import EvaluationResult, evaluate
from minigolf_env.evaluation.report import print_evaluations
from minigolf_env.players.policies import ModelPolicy


@dataclass(frozen=True)
class Args:
    """Command-line arguments."""

    total_timesteps: int = 100_000
    """Number of putts to train on."""
    n_eval_episodes: int = 300
    """Number of episodes in each evaluation."""
    rewards: tuple[str, ...] = ("shaped", "strokes")
    """Rewards to train with, each a model of its own."""


def evaluate_model(model: PPO, name: str, n_eval_episodes: int) -> EvaluationResult:
    """Return the scores of a model with its current weights."""
    with tempfile.TemporaryDirectory() as folder:
        model.save(Path(folder) / "model.zip")
        return evaluate(ModelPolicy(Path(folder) / "model.zip"), name, episodes=n_eval_episodes)


def main(args: Args) -> None:
    """Print a row before and a row after training, for each reward."""
    results = []
    for reward in args.rewards:
        model = PPO("MlpPolicy", gym.make("MiniGolf-v0", reward=reward), seed=0, device="cpu")
        results.append(evaluate_model(model, f"{reward}, untrained", args.n_eval_episodes))
        started = time.monotonic()
        model.learn(args.total_timesteps)
        name = f"{reward}, {args.total_timesteps:,} putts, {time.monotonic() - started:.0f} s"
        results.append(evaluate_model(model, name, args.n_eval_episodes))
    print_evaluations(results)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
