"""Train one policy on many levels, by what a ball feels around it, and score it on levels it has never seen.

``python -m agents.train_generalist --difficulty medium``; it is train_ppo.py on other arguments. Then
``minigolf benchmark --policy runs/procedural-1/best.zip`` compares it with search on fixed sets. docs/training.md says
what it reaches: a baseline for research.
"""

from __future__ import annotations

from dataclasses import dataclass

import tyro

from agents import runs, train_ppo
from minigolf_env.evaluation import Score


@dataclass(frozen=True)
class Args(train_ppo.Args):
    """The command line."""

    course: str = "procedural"
    difficulty: str | None = "easy"
    num_levels: int | None = 500
    observation: str = "rays"
    facing: bool = True
    putts: int = 3_000_000
    check_every: int = 250_000
    check_episodes: int = 200
    check_seed: int = 500_000
    final_episodes: int = 200

    num_envs: int = 1024
    n_steps: int = 2
    batch_size: int = 1024
    n_epochs: int = 4
    learning_rate: float = 1e-3
    log_std: tuple[float, float] = (-1.5, -4.0)
    hidden: tuple[int, ...] = (128, 128)


def main(args: Args) -> list[Score]:
    """Train, score, print the table."""
    return runs.run(args, train_ppo.build, train_ppo.callbacks)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
