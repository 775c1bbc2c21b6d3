"""Does stable-baselines3's PPO with all its defaults improve on MiniGolf-v0? Run: python -m benchmarks.stock_ppo.

Trains ``PPO("MlpPolicy", "MiniGolf-v0").learn(100_000)`` with each reward, and scores it before and after.
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
    """The command line."""

    putts: int = 100_000
    episodes: int = 300
    rewards: tuple[str, ...] = ("shaped", "strokes")


def score(model: PPO, name: str, episodes: int) -> EvaluationResult:
    """Return how well the model plays now."""
    with tempfile.TemporaryDirectory() as folder:
        model.save(Path(folder) / "model.zip")
        return evaluate(ModelPolicy(Path(folder) / "model.zip"), name, episodes=episodes)


def main(args: Args) -> None:
    """Print a row before and a row after, for each reward."""
    scores = []
    for reward in args.rewards:
        model = PPO("MlpPolicy", gym.make("MiniGolf-v0", reward=reward), seed=0, device="cpu")
        scores.append(score(model, f"{reward}, untrained", args.episodes))
        began = time.monotonic()
        model.learn(args.putts)
        name = f"{reward}, {args.putts:,} putts, {time.monotonic() - began:.0f} s"
        scores.append(score(model, name, args.episodes))
    print_evaluations(scores)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
