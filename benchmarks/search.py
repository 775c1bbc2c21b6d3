"""What does search reach, and what does a plan cost? Run: python -m benchmarks.search.

The default hole, with noise and without, beside random putts and searches that leave a part out; then levels. Times are
CPU time of all threads, so that two runs side by side say the same.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import tyro
from tqdm import tqdm

from benchmarks.report import print_table
from minigolf_env.courses.procedural import DIFFICULTY_NAMES
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.evaluation.report import format_with_interval
from minigolf_env.evaluation.statistics import mean_interval
from minigolf_env.players.policies import RandomPolicy
from minigolf_env.players.search import THOROUGH_SEARCH, Plan, search

Planner = Callable[[MiniGolfEnv], Plan]


@dataclass(frozen=True)
class Args:
    """The command line."""

    episodes: int = 100
    """On the default hole."""
    levels: int = 60
    """Of each difficulty; 0 leaves them out."""
    noise: tuple[float, float] = (0.5, 0.015)
    """Standard deviations of direction (degrees) and speed (share of it)."""


def planner(**options: Any) -> Planner:
    """Return a search with options."""
    return lambda env: search(env, **options)


def guess(env: MiniGolfEnv, random: RandomPolicy = RandomPolicy()) -> Plan:  # noqa: B008 (one stream for all)
    """Return a random putt as a plan."""
    return Plan(random.act(np.empty(0), env), False, 0.0, 0.0, 0)


def play(env: MiniGolfEnv, planner: Planner, starts: list[dict[str, Any]], name: str) -> list[str]:
    """Play an episode from each start (arguments of reset); return a row of the table."""
    strokes, plans, cpu = [], [], 0.0
    for start in tqdm(starts, name, leave=False, mininterval=5.0):
        env.reset(**start)
        over = False
        while not over:
            began = time.process_time()
            plans.append(planner(env))
            cpu += time.process_time() - began
            _, _, over, _, info = env.step(plans[-1].action)
        strokes.append(info["strokes"] if info["is_success"] else env.task.max_strokes)
    return [
        name,
        format_with_interval(float(np.mean(strokes)), mean_interval(strokes)),
        f"{np.mean(np.array(strokes) == 1):.0%}",
        f"{max(strokes)}",
        f"{np.mean([plan.num_simulated for plan in plans]):,.0f}",
        f"{1e3 * cpu / len(plans):,.0f}",
    ]


def main(args: Args) -> None:
    """Print a table of the hole and one of levels."""
    columns = ["", "strokes [95 %]", "holes-in-one", "most", "putts tried a plan", "CPU ms a plan"]
    seeds = [{"seed": 1_000_000 + i} for i in range(args.episodes)]
    plain, noisy = MiniGolfEnv(), MiniGolfEnv(putt_noise=args.noise)
    plain.reset(seed=0)
    search(plain)  # Compiles.
    print_table(
        columns,
        [
            play(plain, guess, seeds, "random"),
            play(plain, planner(budgets=[THOROUGH_SEARCH], look_ahead=False), seeds, "thorough at once"),
            play(plain, search, seeds, "search"),
            play(noisy, planner(noise=(0.0, 0.0)), seeds, "noise, search blind to it"),
            play(noisy, search, seeds, "noise, search"),
        ],
    )
    rows = []
    for difficulty in DIFFICULTY_NAMES if args.levels else ():
        env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed")
        levels = [{"options": {"level": level}} for level in range(args.levels)]
        rows.append(play(env, planner(look_ahead=False), levels, f"{difficulty}, one putt ahead"))
        rows.append(play(env, search, levels, f"{difficulty}, search"))
    if rows:
        print_table(columns, rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
