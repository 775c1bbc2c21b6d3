"""Are the endless levels sound? Generates, plays and solves many of each difficulty.

``python -m benchmarks.levels --levels 1000 --log levels.jsonl``. Of each level it is counted how long it takes to
make; whether a putt of random play or of search ever exhausts a step's pieces, ends in a solid or not in time; whether
random play gets out under the border, or to where no putt moves the ball; and in how many strokes search holes out from
the middle of the tee. What the log already has is not done again.
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

from benchmarks.report import print_table
from benchmarks.watch import random_putts, stuck, watch
from minigolf_env.courses.procedural import DIFFICULTY_NAMES, GENERATOR_VERSION
from minigolf_env.courses.procedural.level import build_level
from minigolf_env.envs import MiniGolfEnv, Result, Task
from minigolf_env.envs.task import FloatArray
from minigolf_env.evaluation.rollout import search_strokes

WAVES = 4
"""Putts that each ball of random play makes, each from where the one before ended."""

COLUMNS = (
    "",
    "levels",
    "ms to make + compile",
    "solved",
    "strokes of search",
    "random putts",
    "out of bounds",
    "out under the border",
    "stuck",
    "putts, search's too",
    "late",
    "exhausted",
    "in a solid",
)


@dataclass(frozen=True)
class Args:
    """The command line."""

    levels: int = 1000
    """Of each difficulty."""
    first: int = 0
    """The first level."""
    balls: int = 25
    """Of random play on each level; each makes four putts."""
    difficulty: tuple[str, ...] = DIFFICULTY_NAMES
    strokes: int = 10
    """Within which search has to hole out."""
    log: Path | None = None
    """A file that gets a line of JSON for each level; a run that was cut off goes on from it."""


class Report(NamedTuple):
    """What was seen of one level."""

    build: float
    """CPU time to make the course, s."""
    world: float
    """CPU time to compile its world, s."""
    strokes: int
    """That search took; more than allowed: it did not hole out."""
    random: int
    """Putts of random play."""
    out: int
    """Of these, out of bounds."""
    low_out: int
    """Of these, without ever being as high as a border."""
    stuck: int
    """Resting places of random play that no putt leaves."""
    putts: int
    """Of random play and search together."""
    late: int
    """Of these, not at rest in time."""
    exhausted: int
    """Of these, ones that used up the pieces of a step."""
    inside: int
    """Of these, ones that ended in a solid."""


def examine(env: MiniGolfEnv, difficulty: str, level: int, args: Args) -> Report:
    """Return what is seen of one level."""
    begun = time.process_time()
    course = build_level(difficulty, level)
    built = time.process_time()
    course.world()
    compiled = time.process_time()
    env.reset(seed=0, options={"level": level})
    watched = watch(env)
    task, rng = env.task, np.random.default_rng(level)
    tee = np.append(task.course.tee.centre, task.course.ball_radius)
    balls, out, low_out = np.tile(tee, (args.balls, 1)), 0, 0
    for _ in range(WAVES):
        velocities, outcome = random_putts(task, balls, rng)
        gone = outcome.result == Result.OUT_OF_BOUNDS
        out += int(gone.sum())
        low_out += sum(_is_low(task, ball, velocity) for ball, velocity in zip(balls[gone], velocities[gone]))
        balls = np.where(outcome.holed[:, None], tee, outcome.position)
    return Report(
        build=built - begun,
        world=compiled - built,
        strokes=search_strokes(env),
        random=WAVES * args.balls,
        out=out,
        low_out=low_out,
        stuck=stuck(task, balls),
        putts=watched.putts,
        late=watched.late,
        exhausted=watched.exhausted,
        inside=watched.inside,
    )


def _is_low(task: Task, ball: FloatArray, velocity: FloatArray) -> bool:
    """Return whether a putt gets nowhere as high as the border's lowest top."""
    heights = next(part.mesh.vertices[:, 2] for part in task.course.parts if part.name == "border")
    path, _ = task.simulate_path(ball, velocity)
    return bool(path[:, 2].max() < heights[heights > heights.min()].min())  # All but the tops are at one level.


def examine_all(difficulty: str, args: Args) -> Iterator[Report]:
    """Yield what is seen of each level, from the log where it is there."""
    env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed", max_strokes=args.strokes + 1)
    known = dict(_read(args.log)) if args.log is not None and args.log.exists() else {}
    for level in tqdm(range(args.first, args.first + args.levels), difficulty, mininterval=10.0):
        key = f"v{GENERATOR_VERSION}-{difficulty}-{level}"
        if key not in known:
            known[key] = examine(env, difficulty, level, args)
            if args.log is not None:
                with args.log.open("a") as file:
                    file.write(json.dumps([key, known[key]._asdict()]) + "\n")
        yield known[key]


def _read(log: Path) -> Iterator[tuple[str, Report]]:
    for line in log.read_text().splitlines():
        key, report = json.loads(line)
        yield key, Report(**report)


def main(args: Args) -> None:
    """Examine the levels; print a row for each difficulty when it is done."""
    rows = []
    for difficulty in args.difficulty:
        reports = list(examine_all(difficulty, args))
        named = list(enumerate(reports, args.first))
        unsolved = [level for level, r in named if r.strokes > args.strokes]
        odd = [level for level, r in named if r.late or r.exhausted or r.low_out or r.inside or r.stuck]
        table = np.array(reports)
        total = dict(zip(Report._fields, table.sum(axis=0).tolist(), strict=True))
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
        print(difficulty, "not holed out:", unsolved, "odd:", odd)
        print_table(COLUMNS, rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
