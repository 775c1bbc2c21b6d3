"""Find at which speeds the cup captures a rolling ball: ``python -m benchmarks.capture``.

The ball rolls on a level green towards the cup of the rules of golf, past its centre at an offset. A row has the lowest
speed that misses and the highest that is captured, next to the speed up to which free fall alone captures the ball.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import tyro

from benchmarks.peers.engine import GRAVITY_ACCELERATION
from benchmarks.report import print_table
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.envs.config import build_task

START_DISTANCES = np.linspace(0.01, 0.05, 32)
"""Distances from the rim at which the ball starts to roll, m: time steps begin at different places before the cup."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    offsets: tuple[float, ...] = (0.0, 0.2, 0.4, 0.5, 0.6, 0.8)
    """Offsets of the ball's path from the cup's centre, as fractions of the cup's radius."""
    resolution: float = 0.01
    """Step of the speeds, m/s."""
    max_speed: float = 4.0
    """Highest speed, m/s."""


def free_fall_speed(offset: float, cup_radius: float, ball_radius: float) -> float:
    """Return the speed, m/s, up to which a ball drops by its radius before it reaches the far rim (A. R. Penner, 2002).

    Args:
        offset: distance of the path from the cup's centre, m.
        cup_radius: m.
        ball_radius: m.
    """
    inner = (cup_radius - ball_radius) ** 2 - offset**2
    if inner < 0.0:
        return 0.0
    length = math.sqrt(cup_radius**2 - offset**2) + math.sqrt(inner)
    return length * math.sqrt(GRAVITY_ACCELERATION / (2.0 * ball_radius))


def main(args: Args) -> None:
    """Print a row for each offset."""
    builder = CourseBuilder("green", tee=(1.0, 2.0), cup=(2.0, 2.0, 0.0), par=2)
    task = build_task(builder.add("lane", outline=[{"box": (0, 0, 4, 4)}]).course())
    radius, ball_radius = task.cup.radius, task.course.ball_radius
    speeds = np.arange(args.resolution, args.max_speed, args.resolution)
    rows = []
    for fraction in args.offsets:
        offset = fraction * radius
        rim = 2.0 - math.sqrt(radius**2 - offset**2)
        speed, distance = (grid.ravel() for grid in np.meshgrid(speeds, START_DISTANCES))
        positions = np.column_stack([rim - distance, 2.0 + offset + 0.0 * speed, ball_radius + 0.0 * speed])
        shots = task.world.simulate_batch(positions, np.outer(speed, [1.0, 0.0, 0.0]))
        # Balls that are too slow rest before the cup.
        has_arrived = np.asarray(shots.position)[:, 0] > rim + ball_radius
        is_captured = task.is_holed(shots.position, shots.velocity)
        lowest_miss = speed[has_arrived & ~is_captured].min()
        free_fall = free_fall_speed(offset, radius, ball_radius)
        rows.append([f"{fraction:g}", f"{lowest_miss:.2f}", f"{speed[is_captured].max():.2f}", f"{free_fall:.2f}"])
    print_table(["offset / radius", "lowest miss (m/s)", "highest capture (m/s)", "free fall (m/s)"], rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
