"""What is par? Run: python -m benchmarks.par.

Search plays each hole from random tees, its putts disturbed by 1.5 degrees and 5 % of the speed, as those of players
are. Par is the mean of its strokes, rounded, and at least 2. What a course file holds is confirmed if it is par for
some mean within the 95 % interval. All the putts that search tries are watched for what must not happen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import tyro
from tqdm import tqdm

from benchmarks.report import print_table
from benchmarks.watch import watch
from minigolf_env.courses import list_courses, par_of
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.evaluation.report import format_with_interval
from minigolf_env.evaluation.rollout import search_strokes
from minigolf_env.evaluation.statistics import mean_interval

NOISE = (1.5, 0.05)
"""Standard deviations of direction (degrees) and speed (share of it)."""

LEAST = 2
"""No hole has a lower par: a hole in one shall be one under."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    rounds: int = 100
    """Of each hole."""
    seed: int = 0
    """Of the first; the next one's is one more."""
    courses: tuple[str, ...] = tuple(list_courses())
    max_strokes: int = 10


def main(args: Args) -> None:
    """Print a row for each hole, and the table when all are done."""
    columns = ["hole", "par", "confirmed", "strokes of search", "putts", "late", "exhausted", "in a solid"]
    rows = []
    for name in args.courses:
        env = MiniGolfEnv(name, max_strokes=args.max_strokes, putt_noise=NOISE)
        strokes, counts = [], np.zeros(4, np.int64)
        for seed in tqdm(range(args.seed, args.seed + args.rounds), name, leave=False):
            env.reset(seed=seed)
            watched = watch(env)
            strokes.append(search_strokes(env))
            counts += watched.putts, watched.late, watched.exhausted, watched.inside
        interval, par = mean_interval(strokes), par_of(name)
        low, high = (max(LEAST, round(mean)) for mean in interval)
        confirmed = "yes" if par is not None and low <= par <= high else f"no: {low}-{high}"
        score = format_with_interval(float(np.mean(strokes)), interval)
        rows.append([name, str(par), confirmed, score, *(f"{count:,}" for count in counts.tolist())])
        print("; ".join(f"{column} {cell}" for column, cell in zip(columns, rows[-1])), flush=True)
    print()
    print_table(columns, rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
