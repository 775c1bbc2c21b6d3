"""Search for balls that penetrate a wall or escape from a room. Run: python -m tools.soak (make soak).

Balls are launched in random rooms, each again from where its last run ended, and every time step is checked. The report
has the number of escapes, the smallest clearance, the number of steps that lost time, and the distribution of sub-steps
per step. Each fault comes with the code that reproduces it. The program ends with an error if there was a fault.
"""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from typing import NamedTuple

import numba
import numpy as np
import tyro

from minigolf_env.physics import Shot, World
from tests.physics.scenes import FloatArray, box, free_starts, is_inside_room, mesh, random_room, random_surface

MIN_CLEARANCE = -1e-12
"""Guaranteed lower bound of the clearance, relative to the coordinate scale."""

START_SPEEDS = (0.0, 0.01, 0.3, 1.0, 10.0, 30.0)
"""Speeds at the start of runs, m/s: from zero to half a metre per step."""

BALLS_PER_ROOM = 8
"""Number of balls in each room."""

RUNS_PER_BALL = 6
"""Number of consecutive runs of each ball."""

MAX_STEPS_PER_RUN = 500
"""Maximum number of time steps of a run."""

ROOMS_PER_ROUND = 64
"""Number of rooms given to the processes before the steps are counted again."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    steps: int = 10**8
    """Minimum number of time steps."""
    seed: int = 0
    """RNG seed of the first room; the next rooms have the next seeds."""
    processes: int = os.cpu_count() or 1
    """Number of processes."""


class Room(NamedTuple):
    """A world, and the walls that a ball in it cannot cross."""

    world: World
    frame: FloatArray
    """Matrix (3, 3) that maps the unit cube around the z axis to the room."""
    wall: float | None
    """Coordinate, along the frame's first axis, of a wall that divides the room; None: no wall."""

    def sides(self, points: FloatArray) -> FloatArray:
        """Return the side of the wall on which points (N, 3) are: -1 or 1, and NaN outside the room."""
        unit = points @ np.linalg.inv(self.frame).T
        inside = (np.abs(unit[:, :2]) <= 0.5).all(axis=1) & (np.abs(unit[:, 2] - 0.5) <= 0.5)
        return np.where(inside, np.sign(unit[:, 0] - (-1.0 if self.wall is None else self.wall)), np.nan)


@dataclass
class Tally:
    """Counts over all steps of some rooms."""

    rooms: int = 0
    steps: int = 0
    bounces: int = 0
    escapes: int = 0
    exhausted: int = 0
    min_clearance: float = np.inf
    """Smallest clearance of a ball, relative to the coordinate scale."""
    num_substeps: Counter[int] = field(default_factory=Counter)
    """Number of steps by their number of sub-steps."""
    faults: list[str] = field(default_factory=list)
    """Descriptions of the faults, each with the code that reproduces it."""

    def add(self, other: Tally) -> None:
        """Add the counts of other rooms."""
        for name in ("rooms", "steps", "bounces", "escapes", "exhausted", "num_substeps", "faults"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.min_clearance = min(self.min_clearance, other.min_clearance)

    def __str__(self) -> str:
        """Return the report."""
        lines = [f"{self.steps:,} steps in {self.rooms:,} rooms, {self.bounces:,} bounces"]
        lines += [f"escapes {self.escapes}, exhausted {self.exhausted}, clearance >= {self.min_clearance:.2e} x scale"]
        total = sum(self.num_substeps.values())
        lines += [
            f"{n:3} sub-steps: {count:14,}  {count / total:.1e}" for n, count in sorted(self.num_substeps.items())
        ]
        return "\n".join([*lines, *self.faults])


def build_room(seed: int) -> Room:
    """Return the random room of an RNG seed; a wall of 1 cm divides half of the rooms."""
    rng = np.random.default_rng(seed)
    world, frame = random_room(rng)
    if rng.random() < 0.5:
        return Room(world, frame, None)
    size = float(np.linalg.norm(frame[:, 0]))
    wall = rng.uniform(-0.3, 0.3)
    slab = box([wall * size - 0.005, -size, -size], [wall * size + 0.005, size, 2 * size])
    meshes = [*world.meshes, mesh(slab, random_surface(rng), frame / size)]
    return Room(World(meshes, world.ball_radius, world.gravity, world.dt, world.impact), frame, wall)


def run_balls(room: Room, rng: np.random.Generator) -> Iterator[tuple[FloatArray, FloatArray, Shot]]:
    """Launch balls from free places, each again from where it ended; yield position, velocity and recorded shot."""
    for p in free_starts(rng, room.world, room.frame, 4 * BALLS_PER_ROOM)[:BALLS_PER_ROOM]:
        for _ in range(RUNS_PER_BALL):
            v = rng.normal(size=3)
            v *= rng.choice(START_SPEEDS) / np.linalg.norm(v)
            shot = room.world.simulate(p, v, max_time=MAX_STEPS_PER_RUN * room.world.dt, record=True)
            yield p, v, shot
            p = shot.position


def soak_room(seed: int) -> Tally:
    """Run balls in the room of an RNG seed and check every step; stop at the first fault."""
    numba.set_num_threads(1)
    room = build_room(seed)
    tally = Tally(rooms=1)
    for p, v, shot in run_balls(room, np.random.default_rng([seed, 1])):
        assert shot.path is not None and shot.num_substeps is not None
        # Check each position of the path.
        clearances = room.world.clearance(shot.path) / room.world.coordinate_scale
        sides = room.sides(shot.path)
        crossed = (sides != sides[0]) | ~np.isfinite(shot.velocity).all()
        # Inside a solid the clearance is positive again, so check the winding number at the end.
        escaped = bool(crossed.any()) or not is_inside_room(room.world, shot.position)
        # Count.
        tally.steps += len(shot.path) - 1
        tally.bounces += shot.bounces
        tally.escapes += escaped
        tally.exhausted += shot.exhausted
        tally.min_clearance = min(tally.min_clearance, float(clearances.min()))
        tally.num_substeps.update(shot.num_substeps.tolist())
        # Report a fault; the ball's position is then no valid start of the next run.
        if escaped or shot.exhausted or not clearances.min() >= MIN_CLEARANCE:
            first = int(np.argmax(crossed if crossed.any() else clearances < MIN_CLEARANCE))
            max_time = f"{MAX_STEPS_PER_RUN} * world.dt"
            tally.faults.append(
                f"room {seed}: {escaped=}, {shot.exhausted=}, clearance {clearances.min():.2e} x scale, step {first}:\n"
                f"    from tools.soak import build_room; world = build_room({seed}).world\n"
                f"    world.simulate({p.tolist()}, {v.tolist()}, max_time={max_time}, record=True)"
            )
            break
    return tally


def soak(args: Args, map_rooms: Callable[[Callable[[int], Tally], range], Iterator[Tally]]) -> Tally:
    """Check rooms until there are enough steps; ``map_rooms`` has the interface of the built-in map."""
    total = Tally()
    start = time.perf_counter()
    while total.steps < args.steps:
        first = args.seed + total.rooms
        for tally in map_rooms(soak_room, range(first, first + ROOMS_PER_ROUND)):
            total.add(tally)
        rate = total.steps / (time.perf_counter() - start)
        print(f"\r{total.steps:,} steps, {rate:,.0f} per second, {len(total.faults)} faults ", end="", file=sys.stderr)
    print(file=sys.stderr)
    return total


def main(args: Args) -> int:
    """Check rooms in several processes and print the report; return 1 if there was a fault."""
    soak_room(args.seed)  # Compile before the processes start.
    pool: Executor
    with ProcessPoolExecutor(args.processes, mp_context=get_context("spawn")) as pool:
        total = soak(args, pool.map)
    print(total)
    return 1 if total.faults else 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
