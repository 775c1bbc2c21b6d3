"""Count how random putts end on each bundled course: ``python -m benchmarks.putts``.

Random putts (in the room: throws) start at the tee. Counted are their statuses, putts with an exhausted step, the
smallest clearance, and stuck balls: resting positions that no putt leaves.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import tyro

from benchmarks.failure_counts import count_stuck
from minigolf_env.courses import list_courses, load_course
from minigolf_env.courses.library import ROOM_NAMES
from minigolf_env.envs.config import build_task
from minigolf_env.physics import Status


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    putts: int = 100_000
    """Number of putts on each course."""
    seed: int = 0
    """RNG seed of the putts."""
    positions: int = 500
    """Number of resting positions from which putts are tried."""
    courses: tuple[str, ...] = (*list_courses(), *ROOM_NAMES)
    """Names of the courses."""


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
        heights = np.full(args.putts, course.tee.height + course.ball_radius)
        positions = np.column_stack([lower + rng.random((args.putts, 2)) * (upper - lower), heights])
        start = time.perf_counter()
        shots = world.simulate_batch(positions, velocities)
        seconds = time.perf_counter() - start
        holed = ""
        if course.cup is not None:
            task = build_task(course)
            in_cup = task.is_holed(shots.position, shots.velocity)
            resting = shots.position[~in_cup & (np.asarray(shots.status) == Status.REST)]
            resting = rng.permutation(resting)[: args.positions]
            holed = (
                f", holed {in_cup.mean():.2%}, stuck {count_stuck(task, resting)} of {len(resting)} resting positions"
            )
        statuses = {status.name.lower(): int((np.asarray(shots.status) == status).sum()) for status in Status}
        clearance = world.clearance(shots.position).min() / world.coordinate_scale
        print(f"{name}: {args.putts:,} putts, {statuses}, exhausted {np.sum(shots.exhausted)}{holed}", end=", ")
        print(f"clearance >= {clearance:.1e} x scale, {args.putts / seconds:,.0f} putts/s")


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
