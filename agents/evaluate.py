"""How well does a player play? Strokes over fixed seeds, with confidence intervals.

``python -m agents.evaluate --policy search --episodes 50``, or ``--policy runs/dogleg-1/best.zip``.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
import tyro
from rich.console import Console
from rich.progress import track
from rich.table import Table

from minigolf_env.envs import in_turn
from minigolf_env.policies import Policy, load_policy
from minigolf_env.scoring import mean_interval, play_episode, share_with_interval, wilson, with_interval


@dataclass(frozen=True)
class Args:
    """The command line."""

    policy: str = "search"
    """random, search, or a model's .zip file."""
    course: str = "dogleg"
    """A hole, "procedural", or "round": its holes in turn."""
    episodes: int = 100
    first_seed: int = 1_000_000
    """Episode i is seeded first_seed + i: far from the seeds that training uses."""
    max_strokes: int = 10
    putt_noise: tuple[float, float] = (0.0, 0.0)
    """Standard deviations of direction (degrees) and speed (share of it)."""
    json: Path | None = None
    """Also write the score here."""


@dataclass(frozen=True)
class Score:
    """What a player reached; intervals are 95 % confidence intervals."""

    policy: str
    course: str
    first_seed: int
    episodes: int
    strokes: float
    """Mean strokes; an episode that is not holed counts max_strokes."""
    strokes_interval: tuple[float, float]
    holed: float
    """Share of episodes that ended in the cup."""
    holed_interval: tuple[float, float]
    hole_in_one: float
    hole_in_one_interval: tuple[float, float]


def evaluate(policy: Policy, name: str, args: Args, quiet: bool = False) -> Score:
    """Play the episodes of fixed seeds and return the score."""
    env = gym.make(
        "minigolf_env:MiniGolf-v0", course=args.course, max_strokes=args.max_strokes, putt_noise=args.putt_noise
    )
    seeds = range(args.first_seed, args.first_seed + args.episodes)
    played = [
        play_episode(env, policy, seed, in_turn(args.course, k))
        for k, seed in enumerate(track(seeds, f"{name} plays {args.episodes} episodes", disable=quiet, transient=True))
    ]
    env.close()
    strokes = np.array([s for s, _ in played], dtype=np.float64)
    holed = np.array([h for _, h in played])
    aces = holed & (strokes == 1)
    return Score(
        policy=name,
        course=args.course,
        first_seed=args.first_seed,
        episodes=args.episodes,
        strokes=float(strokes.mean()),
        strokes_interval=mean_interval(strokes),
        holed=float(holed.mean()),
        holed_interval=wilson(int(holed.sum()), len(holed)),
        hole_in_one=float(aces.mean()),
        hole_in_one_interval=wilson(int(aces.sum()), len(aces)),
    )


def print_scores(scores: list[Score]) -> None:
    """Print one table, a row for each player."""
    table = Table(title=f"{scores[0].course}: fixed seeds, [95 % confidence intervals]")
    for column in ("player", "episodes", "mean strokes", "holed out", "hole-in-one"):
        table.add_column(column, justify="left" if column == "player" else "right")
    for score in scores:
        table.add_row(
            score.policy,
            str(score.episodes),
            with_interval(score.strokes, score.strokes_interval),
            share_with_interval(score.holed, score.holed_interval),
            share_with_interval(score.hole_in_one, score.hole_in_one_interval),
        )
    Console().print(table)


def main(args: Args) -> Score:
    """Evaluate one player, print its row and write it where asked."""
    if args.episodes < 1:
        raise SystemExit(f"episodes: expected at least 1, received {args.episodes}.")
    try:
        policy = load_policy(args.policy)
        score = evaluate(policy, args.policy, args)
    except (ValueError, FileNotFoundError, ImportError) as error:
        raise SystemExit(str(error)) from error
    print_scores([score])
    if args.json is not None:
        args.json.write_text(json.dumps(asdict(score), indent=2) + "\n")
    return score


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
