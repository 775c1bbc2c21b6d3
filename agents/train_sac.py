"""Train another algorithm through the same adapter: stable-baselines3's SAC, which learns from all the putts it saw.

``python -m agents.train_sac``. It needs fewer putts than PPO for its first holes, and far more time for each:
train_ppo.py is what this package recommends.
"""

from __future__ import annotations

from dataclasses import dataclass

import tyro
from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import VecMonitor

from agents import runs
from minigolf_env.evaluation.evaluate import EvaluationResult


@dataclass(frozen=True)
class Args(runs.Run):
    """The command line."""

    putts: int = 60_000
    num_envs: int = 64
    check_every: int = 10_000

    learning_starts: int = 5_000
    """Random putts before the first update."""
    gradient_steps: int = 8
    """Updates after a putt in each environment."""
    batch_size: int = 512
    learning_rate: float = 1e-3
    gamma: float = 0.5
    hidden: tuple[int, ...] = (128, 128)


def build(args: Args, envs: VecMonitor) -> SAC:
    """Return a new learner."""
    return SAC(
        "MlpPolicy",
        envs,
        learning_rate=args.learning_rate,
        learning_starts=args.learning_starts,
        gradient_steps=args.gradient_steps,
        batch_size=args.batch_size,
        gamma=args.gamma,
        policy_kwargs={"net_arch": list(args.hidden)},
        seed=args.seed,
        device="cpu",
    )


def main(args: Args) -> list[EvaluationResult]:
    """Train, score, print the table."""
    return runs.run(args, build, lambda _: ())


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
