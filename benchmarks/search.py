"""Measure the strokes and the cost of search: ``python -m benchmarks.search``.

The first table is the default hole, with noise and without, compared with random putts and with parts of search left
out. The second is procedural levels. Times are CPU time of all threads, which other processes affect little.
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
from minigolf_env.evaluation import FIRST_EVALUATION_SEED
from minigolf_env.evaluation.report import format_with_interval
from minigolf_env.evaluation.statistics import mean_interval
from minigolf_env.players.policies import RandomPolicy
from minigolf_env.players.search import THOROUGH_SEARCH, Plan, search

Planner = Callable[[MiniGolfEnv], Plan]


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    episodes: int = 100
    """Number of episodes on the default hole."""
    levels: int = 60
    """Number of levels of each difficulty; 0 leaves out the second table."""
    noise: tuple[float, float] = (0.5, 0.015)
    """Standard deviations of the direction, degrees, and of the speed, as a fraction of it."""


def make_planner(**options: Any) -> Planner:
    """Return a search with some of its arguments fixed."""
    return lambda env: search(env, **options)


def random_plan(env: MiniGolfEnv, random: RandomPolicy = RandomPolicy()) -> Plan:  # noqa: B008 (one stream for all)
    """Return a random putt as a plan."""
    return Plan(random.act(np.empty(0), env), False, 0.0, 0.0, 0)


def play_episodes(env: MiniGolfEnv, planner: Planner, episodes: list[dict[str, Any]], name: str) -> list[str]:
    """Play an episode for each dictionary of arguments of reset; return a row of the table."""
    strokes = []
    plans = []
    cpu_time = 0.0
    for reset_arguments in tqdm(episodes, name, leave=False, mininterval=5.0):
        env.reset(**reset_arguments)
        over = False
        while not over:
            start = time.process_time()
            plans.append(planner(env))
            cpu_time += time.process_time() - start
            _, _, over, _, info = env.step(plans[-1].action)
        strokes.append(info["strokes"] if info["is_success"] else env.task.max_strokes)
    return [
        name,
        format_with_interval(float(np.mean(strokes)), mean_interval(strokes)),
        f"{np.mean(np.array(strokes) == 1):.0%}",
        f"{max(strokes)}",
        f"{np.mean([plan.num_simulated for plan in plans]):,.0f}",
        f"{1e3 * cpu_time / len(plans):,.0f}",
    ]


def main(args: Args) -> None:
    """Print a table of the default hole and a table of levels."""
    columns = ["", "strokes [95 %]", "holes-in-one", "most strokes", "putts simulated per plan", "CPU ms per plan"]
    seeds = [{"seed": FIRST_EVALUATION_SEED + i} for i in range(args.episodes)]
    plain = MiniGolfEnv()
    noisy = MiniGolfEnv(putt_noise=args.noise)
    plain.reset(seed=0)
    search(plain)  # Compiles the physics.
    print_table(
        columns,
        [
            play_episodes(plain, random_plan, seeds, "random"),
            play_episodes(
                plain,
                make_planner(budgets=[THOROUGH_SEARCH], look_ahead=False),
                seeds,
                "one-putt search, fine grid",
            ),
            play_episodes(plain, search, seeds, "search"),
            play_episodes(noisy, make_planner(noise=(0.0, 0.0)), seeds, "noise, search ignores it"),
            play_episodes(noisy, search, seeds, "noise, search"),
        ],
    )
    rows = []
    for difficulty in DIFFICULTY_NAMES if args.levels else ():
        env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed")
        levels = [{"options": {"level": level}} for level in range(args.levels)]
        rows.append(play_episodes(env, make_planner(look_ahead=False), levels, f"{difficulty}, one-putt search"))
        rows.append(play_episodes(env, search, levels, f"{difficulty}, search"))
    if rows:
        print_table(columns, rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
