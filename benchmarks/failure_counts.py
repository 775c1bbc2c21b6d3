"""Count putts that fail: at the time limit, exhausted, inside a solid, or stuck where no putt moves the ball."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from minigolf_env.envs import MiniGolfEnv, Task
from minigolf_env.envs.hole_params import FloatArray
from minigolf_env.envs.task import Outcome
from minigolf_env.physics import Shot, Status, World

PENETRATION_TOLERANCE = 1e-12
"""Depth beyond which a ball counts as inside a solid, as a fraction of the world's coordinate scale."""

NUM_ESCAPE_PUTTS = 16
"""Number of putts that try to move a ball: in evenly spaced directions, at 1 and 0.15 of the top speed by turns."""

MIN_ESCAPE_DISTANCE = 0.3
"""Distance by which a putt has to move a ball that is not stuck, m."""


class CountingWorld:
    """World that counts the failures among its putts.

    Args:
        world: simulates the putts.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.num_putts = 0
        self.num_timed_out = 0
        """Number of balls that were still moving at the time limit."""
        self.num_exhausted = 0
        """Number of balls that needed more sub-steps in a time step than the limit."""
        self.num_inside = 0
        """Number of balls that ended inside a solid."""

    def simulate_batch(self, positions: FloatArray, velocities: FloatArray, max_time: float) -> Shot:
        """Return the result of ``World.simulate_batch``."""
        shot = self._world.simulate_batch(positions, velocities, max_time)
        min_clearance = -PENETRATION_TOLERANCE * self._world.coordinate_scale
        self.num_putts += len(positions)
        self.num_timed_out += int((np.asarray(shot.status) == Status.TIME_LIMIT).sum())
        self.num_exhausted += int(np.asarray(shot.exhausted).sum())
        self.num_inside += int((self._world.clearance(shot.position) < min_clearance).sum())
        return shot

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)


def count_failures(env: MiniGolfEnv) -> CountingWorld:
    """Replace the world of an environment's task by a counting one, and return it; it counts until the task changes."""
    world = CountingWorld(env.task.world)
    env.task = replace(env.task, world=world)
    return world


def random_putts(task: Task, balls: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, Outcome]:
    """Return the launch velocities (N, 3) and outcomes of random putts, uniform over the disc of actions."""
    angles = rng.uniform(0.0, 2.0 * np.pi, len(balls))
    speeds = rng.random(len(balls)) ** 0.5
    actions = np.stack([speeds * np.cos(angles), speeds * np.sin(angles)], axis=-1)
    velocities = task.launch_velocity(actions)
    return velocities, task.simulate(balls, velocities)


def count_stuck(task: Task, balls: FloatArray) -> int:
    """Return the number of balls (N, 3) that no putt moves away or holes out."""
    index = np.arange(NUM_ESCAPE_PUTTS)
    angles = 2.0 * np.pi * index / NUM_ESCAPE_PUTTS
    speeds = np.where(index[:, None] % 2, 0.15, 1.0)
    actions = speeds * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    starts = np.repeat(balls, NUM_ESCAPE_PUTTS, axis=0)
    outcome = task.simulate(starts, task.launch_velocity(np.tile(actions, (len(balls), 1))))
    distances = np.linalg.norm(outcome.position - starts, axis=1).reshape(-1, NUM_ESCAPE_PUTTS)
    has_moved = distances.max(axis=1) > MIN_ESCAPE_DISTANCE
    has_holed = outcome.holed.reshape(-1, NUM_ESCAPE_PUTTS).any(axis=1)
    return int((~(has_moved | has_holed)).sum())
