"""Check the par of each hole with search: ``python -m benchmarks.par``.

Search plays each hole from random tees with noise of 1.5 degrees and 5 % of the speed, like a human player. The par of
a course file is confirmed if some mean in the 95 % confidence interval of the strokes, rounded and at least 2, equals
it. All putts that search tries are checked: none should reach the time limit, have an exhausted step or end inside a
solid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import tyro
from tqdm import tqdm

from benchmarks.failure_counts import count_failures
from benchmarks.report import print_table
from minigolf_env.courses import list_courses, par_of
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.evaluation.report import format_with_interval
from minigolf_env.evaluation.rollout import search_strokes
from minigolf_env.evaluation.statistics import mean_interval

PUTT_NOISE = (1.5, 0.05)
"""Standard deviations of the direction, degrees, and of the speed, as a fraction of it."""

MIN_PAR = 2
"""Smallest par: a hole-in-one is at least one under par."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    rounds: int = 100
    """Number of rounds on each hole."""
    seed: int = 0
    """RNG seed of the first round; each round's seed is one larger."""
    courses: tuple[str, ...] = tuple(list_courses())
    """Names of the holes."""
    max_strokes: int = 10
    """Stroke limit."""


def main(args: Args) -> None:
    """Print a line for each hole, and the table at the end."""
    columns = [
        "hole",
        "par",
        "confirmed",
        "strokes of search",
        "putts",
        "time limit",
        "exhausted",
        "inside a solid",
    ]
    rows = []
    for name in args.courses:
        env = MiniGolfEnv(name, max_strokes=args.max_strokes, putt_noise=PUTT_NOISE)
        strokes = []
        counts = np.zeros(4, np.int64)
        for seed in tqdm(range(args.seed, args.seed + args.rounds), name, leave=False):
            env.reset(seed=seed)
            failures = count_failures(env)
            strokes.append(search_strokes(env))
            counts += failures.putts, failures.timed_out, failures.exhausted, failures.inside
        interval = mean_interval(strokes)
        par = par_of(name)
        low, high = (max(MIN_PAR, round(mean)) for mean in interval)
        confirmed = "yes" if par is not None and low <= par <= high else f"no: {low}-{high}"
        score = format_with_interval(float(np.mean(strokes)), interval)
        rows.append([name, str(par), confirmed, score, *(f"{count:,}" for count in counts.tolist())])
        print("; ".join(f"{column} {cell}" for column, cell in zip(columns, rows[-1])), flush=True)
    print()
    print_table(columns, rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
