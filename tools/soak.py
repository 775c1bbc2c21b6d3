"""Does any ball get into a wall or out of a room? Run: python -m tools.soak (make soak).

Throws balls about in random rooms, every one again from where it ended, looks at every single step, and prints what was
found: escapes, the deepest clearance, steps that lost time, and how many pieces the steps had. Each fault comes with
the line that shows it again. Ends with an error if there was one.
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
from tests.physics.scenes import FloatArray, box, free_starts, mesh, random_room, random_surface, turns_right

GUARANTEE = -1e-12
"""What the clearance never falls below, as a share of the world's scale."""

SPEEDS = (0.0, 0.01, 0.3, 1.0, 10.0, 30.0)
"""Of throws, m/s: from put down to half a metre a step."""

BALLS, THROWS, STEPS = 8, 6, 500
"""In each room, of each ball, and at most after each throw."""

ROUND = 64
"""Rooms handed to the processes before the steps are counted again."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    steps: int = 10**8
    """Time steps to make, at least."""
    seed: int = 0
    """Number of the first room; one room's steps are the same whatever the others."""
    processes: int = os.cpu_count() or 1


class Room(NamedTuple):
    """A world with what a ball in it cannot cross."""

    world: World
    frame: FloatArray
    """(3, 3): the unit cube around the z axis that it turns and scales is the room."""
    wall: float | None
    """Where on the frame's first axis a wall parts the room; None without one."""

    def sides(self, points: FloatArray) -> FloatArray:
        """Return for points (N, 3) in which part of the room they are: -1 or 1, and nan outside of it."""
        unit = points @ np.linalg.inv(self.frame).T
        inside = (np.abs(unit[:, :2]) <= 0.5).all(axis=1) & (np.abs(unit[:, 2] - 0.5) <= 0.5)
        return np.where(inside, np.sign(unit[:, 0] - (-1.0 if self.wall is None else self.wall)), np.nan)


@dataclass
class Tally:
    """What was seen."""

    rooms: int = 0
    steps: int = 0
    bounces: int = 0
    escapes: int = 0
    exhausted: int = 0
    deepest: float = np.inf
    sub_steps: Counter[int] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Add what was seen elsewhere."""
        for name in ("rooms", "steps", "bounces", "escapes", "exhausted", "sub_steps", "faults"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.deepest = min(self.deepest, other.deepest)

    def __str__(self) -> str:
        """Return the report."""
        lines = [f"{self.steps:,} steps in {self.rooms:,} rooms, {self.bounces:,} bounces"]
        lines += [f"escapes {self.escapes}, exhausted {self.exhausted}, clearance >= {self.deepest:.2e} x scale"]
        total = sum(self.sub_steps.values())
        lines += [f"{n:3} sub-steps: {count:14,}  {count / total:.1e}" for n, count in sorted(self.sub_steps.items())]
        return "\n".join([*lines, *self.faults])


def build_room(seed: int) -> Room:
    """Return room number ``seed``: in half of them a wall of 1 cm, standing askew or not, parts the room."""
    rng = np.random.default_rng(seed)
    world, frame = random_room(rng)
    if rng.random() < 0.5:
        return Room(world, frame, None)
    size = float(np.linalg.norm(frame[:, 0]))
    at = rng.uniform(-0.3, 0.3)
    slab = box([at * size - 0.005, -size, -size], [at * size + 0.005, size, 2 * size])
    parted = [*world.meshes, mesh(slab, random_surface(rng), frame / size)]
    return Room(World(parted, world.ball_radius, world.gravity, world.dt, world.impact), frame, at)


def sub_steps(shot: Shot) -> Counter[int]:
    """Return how many steps of a recorded run had how many pieces; nothing as long as runs do not record that."""
    return Counter(getattr(shot, "sub_steps", np.empty(0, int)).tolist())


def throws(room: Room, rng: np.random.Generator) -> Iterator[tuple[FloatArray, FloatArray, Shot]]:
    """Throw balls from free places, each again from where it ended; give position, velocity and what became of it."""
    for p in free_starts(rng, room.world, room.frame, 4 * BALLS)[:BALLS]:
        for _ in range(THROWS):
            v = rng.normal(size=3)
            v *= rng.choice(SPEEDS) / np.linalg.norm(v)
            shot = room.world.simulate(p, v, max_time=STEPS * room.world.dt, record=True)
            yield p, v, shot
            p = shot.position


def soak_room(seed: int) -> Tally:
    """Throw balls in room number ``seed`` and look at every step."""
    numba.set_num_threads(1)
    room = build_room(seed)
    tally = Tally(rooms=1)
    for p, v, shot in throws(room, np.random.default_rng([seed, 1])):
        assert shot.path is not None
        clearances = room.world.clearance(shot.path) / room.world.scale
        sides = room.sides(shot.path)
        astray = (sides != sides[0]) | ~np.isfinite(shot.velocity).all()
        # In a solid the clearance is positive again: where the run ends, count how often the meshes go round the ball.
        escaped = bool(astray.any()) or not turns_right(room.world, shot.position)
        tally.steps += len(shot.path) - 1
        tally.bounces += shot.bounces
        tally.escapes += escaped
        tally.exhausted += shot.exhausted
        tally.deepest = min(tally.deepest, float(clearances.min()))
        tally.sub_steps += sub_steps(shot)
        if escaped or shot.exhausted or not clearances.min() >= GUARANTEE:
            first = int(np.argmax(astray if astray.any() else clearances < GUARANTEE))
            tally.faults.append(
                f"room {seed}: {escaped=}, {shot.exhausted=}, clearance {clearances.min():.2e} x scale, step {first}:\n"
                f"    from tools.soak import build_room; world = build_room({seed}).world\n"
                f"    world.simulate({p.tolist()}, {v.tolist()}, max_time={STEPS} * world.dt, record=True)"
            )
            break  # Wherever this ball is now, the next would start from there.
    return tally


def soak(args: Args, run: Callable[[Callable[[int], Tally], range], Iterator[Tally]]) -> Tally:
    """Go through rooms with ``run`` (as the built-in map) until there are enough steps."""
    total, began = Tally(), time.perf_counter()
    while total.steps < args.steps:
        first = args.seed + total.rooms
        for tally in run(soak_room, range(first, first + ROUND)):
            total.add(tally)
        rate = total.steps / (time.perf_counter() - began)
        print(f"\r{total.steps:,} steps, {rate:,.0f} a second, {len(total.faults)} faults ", end="", file=sys.stderr)
    print(file=sys.stderr)
    return total


def main(args: Args) -> int:
    """Soak on all cores, print the report; return 1 if there was a fault."""
    soak_room(args.seed)  # Compiles once, before the processes start.
    pool: Executor
    with ProcessPoolExecutor(args.processes, mp_context=get_context("spawn")) as pool:
        total = soak(args, pool.map)
    print(total)
    return 1 if total.faults else 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
