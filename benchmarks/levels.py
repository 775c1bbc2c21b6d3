"""Check procedural levels: generate, play and solve many of each difficulty.

Run ``python -m benchmarks.levels --levels 1000 --log levels.jsonl``. For each level are measured:

- the time to generate it and to build its world,
- putts of random play and of search that have an exhausted step, end inside a solid, or reach the time limit,
- putts of random play that leave the course below the top of the border, and balls that no putt can move,
- the number of strokes in which search holes out from the centre of the tee.

Levels that the log already has are not repeated.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import tyro
from tqdm import tqdm

from benchmarks.failure_counts import count_failures, count_stuck, random_putts
from benchmarks.report import check_files, print_table
from minigolf_env.courses.procedural import DIFFICULTY_NAMES, GENERATOR_VERSION
from minigolf_env.courses.procedural.level import build_level
from minigolf_env.envs import MiniGolfEnv, Result, Task
from minigolf_env.envs.holes import FloatArray
from minigolf_env.evaluation.rollout import search_strokes

PUTTS_PER_BALL = 4
"""Number of consecutive putts of each ball of random play."""

TABLE_HEADER = (
    "",
    "levels",
    "ms to generate + build",
    "solved",
    "strokes of search",
    "random putts",
    "out of bounds",
    "out below the border's top",
    "stuck",
    "all putts",
    "time limit",
    "exhausted",
    "inside a solid",
)


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    levels: int = 1000
    """Number of levels of each difficulty."""
    first: int = 0
    """Index of the first level."""
    balls: int = 25
    """Number of balls of random play on each level; each makes PUTTS_PER_BALL putts."""
    difficulty: tuple[str, ...] = DIFFICULTY_NAMES
    """Names of the difficulties."""
    strokes: int = 10
    """Number of strokes within which search must hole out."""
    log: Path | None = None
    """File that gets a line of JSON for each level; an interrupted run resumes from it."""


class LevelReport(NamedTuple):
    """The measurements of one level."""

    build: float
    """CPU time to generate the course, s."""
    world: float
    """CPU time to build its world, s."""
    strokes: int
    """Number of strokes of search; more than the limit if it did not hole out."""
    random: int
    """Number of putts of random play."""
    out: int
    """Number of putts of random play that end out of bounds."""
    low_out: int
    """Number of putts that end out of bounds without reaching the top of the border."""
    stuck: int
    """Number of resting positions of random play that no putt leaves."""
    putts: int
    """Number of putts of random play and search together."""
    late: int
    """Number of putts that reach the time limit."""
    exhausted: int
    """Number of putts with an exhausted step: the ball needed more sub-steps than the limit."""
    inside: int
    """Number of putts that end inside a solid."""


def examine_level(env: MiniGolfEnv, difficulty: str, level: int, args: Args) -> LevelReport:
    """Return the measurements of one level."""
    start = time.process_time()
    course = build_level(difficulty, level)
    build_end = time.process_time()
    course.world()
    world_end = time.process_time()
    env.reset(seed=0, options={"level": level})
    counts = count_failures(env)
    task = env.task
    rng = np.random.default_rng(level)
    tee = np.append(task.course.tee.centre, task.course.ball_radius)
    balls = np.tile(tee, (args.balls, 1))
    out = 0
    low_out = 0
    for _ in range(PUTTS_PER_BALL):
        velocities, outcome = random_putts(task, balls, rng)
        is_out = outcome.result == Result.OUT_OF_BOUNDS
        out += int(is_out.sum())
        low_out += sum(
            _stays_below_border(task, ball, velocity) for ball, velocity in zip(balls[is_out], velocities[is_out])
        )
        balls = np.where(outcome.holed[:, None], tee, outcome.position)
    return LevelReport(
        build=build_end - start,
        world=world_end - build_end,
        strokes=search_strokes(env),
        random=PUTTS_PER_BALL * args.balls,
        out=out,
        low_out=low_out,
        stuck=count_stuck(task, balls),
        putts=counts.putts,
        late=counts.timed_out,
        exhausted=counts.exhausted,
        inside=counts.inside,
    )


def _stays_below_border(task: Task, ball: FloatArray, velocity: FloatArray) -> bool:
    """Return whether a putt stays below the lowest top of the border."""
    heights = next(part.mesh.vertices[:, 2] for part in task.course.parts if part.name == "border")
    path, _ = task.simulate_path(ball, velocity)
    lowest_top = heights[heights > heights.min()].min()  # All other vertices are at the border's base.
    return bool(path[:, 2].max() < lowest_top)


def examine_levels(difficulty: str, args: Args) -> Iterator[LevelReport]:
    """Yield the measurements of each level, from the log if it has them."""
    env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed", max_strokes=args.strokes + 1)
    logged = dict(_read_log(args.log)) if args.log is not None and args.log.exists() else {}
    for level in tqdm(range(args.first, args.first + args.levels), difficulty, mininterval=10.0):
        key = f"v{GENERATOR_VERSION}-{difficulty}-{level}"
        if key not in logged:
            logged[key] = examine_level(env, difficulty, level, args)
            if args.log is not None:
                with args.log.open("a") as file:
                    file.write(json.dumps([key, logged[key]._asdict()]) + "\n")
        yield logged[key]


def _read_log(log: Path) -> Iterator[tuple[str, LevelReport]]:
    for line in log.read_text().splitlines():
        key, report = json.loads(line)
        yield key, LevelReport(**report)


def main(args: Args) -> None:
    """Examine the levels; print the table after each difficulty."""
    check_files(args)
    rows = []
    for difficulty in args.difficulty:
        reports = list(examine_levels(difficulty, args))
        numbered = list(enumerate(reports, args.first))
        unsolved = [level for level, report in numbered if report.strokes > args.strokes]
        faulty = [
            level
            for level, report in numbered
            if report.late or report.exhausted or report.low_out or report.inside or report.stuck
        ]
        table = np.array(reports)
        total = dict(zip(LevelReport._fields, table.sum(axis=0).tolist(), strict=True))
        build, world = 1e3 * np.median(table[:, :2], axis=0)
        counts = [total[name] for name in ("low_out", "stuck", "putts", "late", "exhausted", "inside")]
        rows.append(
            [
                difficulty,
                f"{len(reports)}",
                f"{build:.1f} + {world:.1f}",
                f"{1.0 - len(unsolved) / len(reports):.2%}",
                f"{total['strokes'] / len(reports):.2f}",
                f"{total['random']:,.0f}",
                f"{total['out'] / total['random']:.2%}",
                *(f"{count:,.0f}" for count in counts),
            ]
        )
        print(difficulty, "not holed out:", unsolved, "faulty:", faulty)
        print_table(TABLE_HEADER, rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
