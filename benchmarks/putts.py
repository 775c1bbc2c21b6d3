"""Do all putts end, on the course and out of its walls? Run: python -m benchmarks.putts.

Plays random putts from the tee of each bundled course (in the room: throws) and counts what must not happen; and from
some places where they end, whether any putt leads on from there.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import tyro

from benchmarks.watch import stuck
from minigolf_env.courses import list_courses, load_course
from minigolf_env.envs.config import build_task
from minigolf_env.physics import Status


@dataclass(frozen=True)
class Args:
    """The command line."""

    putts: int = 100_000
    seed: int = 0
    lies: int = 500
    """Resting places that are tried."""
    courses: tuple[str, ...] = (*list_courses(), "room")


def main(args: Args) -> None:
    """Print a row for each course."""
    for name in args.courses:
        course = load_course(name)
        world = course.world()
        rng = np.random.default_rng(args.seed)
        directions = rng.normal(size=(args.putts, 3))
        if course.cup is not None:
            directions[:, 2] = 0.0
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        velocities = directions * rng.uniform(0.0, course.top_speed, (args.putts, 1))
        lower, upper = np.array(course.tee.lower), np.array(course.tee.upper)
        level = np.full(args.putts, course.tee.height + course.ball_radius)
        positions = np.column_stack([lower + rng.random((args.putts, 2)) * (upper - lower), level])
        began = time.perf_counter()
        shots = world.simulate_batch(positions, velocities)
        seconds = time.perf_counter() - began
        holed = ""
        if course.cup is not None:
            task = build_task(course)
            in_cup = task.is_holed(shots.position, shots.velocity)
            lies = shots.position[~in_cup & (np.asarray(shots.status) == Status.REST)]
            lies = rng.permutation(lies)[: args.lies]
            holed = f", holed {in_cup.mean():.2%}, stuck {stuck(task, lies)} of {len(lies)} lies"
        ends = {status.name.lower(): int((np.asarray(shots.status) == status).sum()) for status in Status}
        clearance = world.clearance(shots.position).min() / world.coordinate_scale
        print(f"{name}: {args.putts:,} putts, {ends}, exhausted {np.sum(shots.exhausted)}{holed}", end=", ")
        print(f"clearance >= {clearance:.1e} x scale, {args.putts / seconds:,.0f} putts/s")


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
