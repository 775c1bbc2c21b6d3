"""Are the endless levels sound? Generates, plays and solves many of each difficulty.

``python -m benchmarks.levels --levels 1000``. Of each level it is counted how long it takes to make; whether random
play ever exhausts a step's pieces, ends in a solid or where no putt moves the ball; and in how many strokes search
holes out from the middle of the tee.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import tyro
from tqdm import tqdm

from benchmarks.report import print_table
from minigolf_env.courses.procedural import DIFFICULTIES
from minigolf_env.courses.procedural.build import build_level
from minigolf_env.envs import MiniGolfEnv, Result, Task
from minigolf_env.envs.task import MAX_TIME, FloatArray
from minigolf_env.scoring import strokes_of_search

WAVES = 4
"""Putts that each ball of random play makes, each from where the one before ended."""

MOVED = 0.3
"""A ball that a putt moves by so much is not stuck, m."""

PROBES = 16
"""Putts that try to move a ball: full ones and gentle ones all around."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    levels: int = 1000
    """Of each difficulty."""
    first: int = 0
    """The first level."""
    balls: int = 25
    """Of random play on each level; each makes four putts."""
    difficulty: tuple[str, ...] = DIFFICULTIES
    strokes: int = 10
    """Within which search has to hole out."""


class Report(NamedTuple):
    """What was seen of one level."""

    build: float
    """CPU time to make the course, s."""
    world: float
    """CPU time to compile its world, s."""
    putts: int
    out: int
    """Putts out of bounds."""
    late: int
    """Putts that did not come to rest in time."""
    exhausted: int
    low_out: int
    """Balls that got out without ever being as high as a border."""
    inside: int
    """Resting places in a solid."""
    stuck: int
    """Resting places that no putt leaves."""
    strokes: int
    """That search took; more than allowed: it did not hole out."""


def examine(env: MiniGolfEnv, difficulty: str, level: int, args: Args) -> Report:
    """Return what is seen of one level."""
    begun = time.process_time()
    course = build_level(difficulty, level)
    built = time.process_time()
    course.world()
    compiled = time.process_time()
    env.reset(seed=0, options={"level": level})
    task, rng = env.task, np.random.default_rng(level)
    balls = np.tile(np.append(task.course.tee.centre, task.course.ball_radius), (args.balls, 1))
    seen = np.zeros(6, np.int64)
    for _ in range(WAVES):
        seen, balls = _wave(task, balls, rng, seen)
    stuck = int((~_moves(task, balls)).sum())
    return Report(
        built - begun, compiled - built, WAVES * args.balls, *seen[:5].tolist(), stuck, strokes_of_search(env)
    )


def _wave(task: Task, balls: FloatArray, rng: np.random.Generator, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Putt each ball anywhere; return what has been seen by now, and where they lie: on the tee again if holed."""
    turns, shares = rng.uniform(0.0, 2.0 * np.pi, len(balls)), rng.random(len(balls)) ** 0.5
    velocities = task.launch(np.stack([shares * np.cos(turns), shares * np.sin(turns)], axis=-1))
    shot = task.world.simulate_batch(balls, velocities, MAX_TIME)
    outcome = task.play(balls, velocities)
    out, late = outcome.result == Result.OUT_OF_BOUNDS, outcome.result == Result.TIME_LIMIT
    heights = next(part.mesh.vertices[:, 2] for part in task.course.parts if part.name == "border")
    lowest = heights[heights > heights.min()].min()  # Its lowest top: all but the tops are at one level.
    low = 0
    for i in np.flatnonzero(out):
        path, _ = task.trace(balls[i], velocities[i])
        low += bool(path[:, 2].max() < lowest)
    inside = 0
    for ball in outcome.position:
        try:
            task.world.require_free(ball)
        except ValueError:
            inside += 1
    tee = np.append(task.course.tee.centre, task.course.ball_radius)
    after = np.where(outcome.holed[:, None], tee, outcome.position)
    counts = [out.sum(), late.sum(), np.asarray(shot.exhausted).sum(), low, inside, 0]
    return seen + np.array(counts), after


def _moves(task: Task, balls: FloatArray) -> FloatArray:
    """Return for each ball (N,) whether some putt moves it on."""
    turns = 2.0 * np.pi * np.arange(PROBES) / PROBES
    putts = np.where(np.arange(PROBES)[:, None] % 2, 0.15, 1.0) * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    starts = np.repeat(balls, PROBES, axis=0)
    outcome = task.play(starts, task.launch(np.tile(putts, (len(balls), 1))))
    away = np.linalg.norm(outcome.position - starts, axis=1).reshape(-1, PROBES)
    return (away.max(axis=1) > MOVED) | outcome.holed.reshape(-1, PROBES).any(axis=1)


def main(args: Args) -> None:
    """Examine the levels and print a row for each difficulty."""
    rows = []
    for difficulty in args.difficulty:
        env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed", max_strokes=args.strokes + 1)
        levels = range(args.first, args.first + args.levels)
        reports = [examine(env, difficulty, level, args) for level in tqdm(levels, difficulty, mininterval=10.0)]
        unsolved = [level for level, report in zip(levels, reports, strict=True) if report.strokes > args.strokes]
        odd = [
            level
            for level, r in zip(levels, reports, strict=True)
            if r.late or r.exhausted or r.low_out or r.inside or r.stuck
        ]
        table = np.array(reports)
        total = dict(zip(Report._fields, table.sum(axis=0), strict=True))
        build, world = 1e3 * np.median(table[:, :2], axis=0)
        strokes = table[:, Report._fields.index("strokes")]
        rows.append(
            [
                difficulty,
                f"{args.levels}",
                f"{build:.1f} + {world:.1f}",
                f"{(strokes <= args.strokes).mean():.2%}",
                f"{strokes.mean():.2f}",
                f"{total['putts']:,.0f}",
                f"{total['out'] / total['putts']:.2%}",
                *(f"{total[name]:.0f}" for name in ("late", "exhausted", "low_out", "inside", "stuck")),
            ]
        )
        print(difficulty, "not holed out:", unsolved, "odd:", odd)
    columns = ["", "levels", "ms to make + compile", "solved", "strokes of search", "random putts", "out of bounds"]
    print_table([*columns, "late", "exhausted", "out under the border", "in a solid", "stuck"], rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
