"""Watches putts for what must never happen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from minigolf_env.envs import MiniGolfEnv, Task
from minigolf_env.envs.task import FloatArray, Outcome
from minigolf_env.physics import Shot, Status, World

DEEP = 1e-12
"""A ball whose skin is deeper in a surface is inside it, share of the world's size."""

PROBES = 16
"""Putts that try to move a ball: full ones and gentle ones all around."""

MOVED = 0.3
"""A ball that a putt moves by so much is not stuck, m."""


class Watched:
    """A world that counts what becomes of its balls.

    Args:
        world: does the physics.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.putts = 0
        self.late = 0
        """Balls that did not come to rest in time."""
        self.exhausted = 0
        """Balls that used up the pieces of a step."""
        self.inside = 0
        """Balls that ended in a solid."""

    def simulate_batch(self, positions: FloatArray, velocities: FloatArray, max_time: float) -> Shot:
        """Return what World returns."""
        shot = self._world.simulate_batch(positions, velocities, max_time)
        self.putts += len(positions)
        self.late += int((np.asarray(shot.status) == Status.TIME_LIMIT).sum())
        self.exhausted += int(np.asarray(shot.exhausted).sum())
        self.inside += int((self._world.clearance(shot.position) < -DEEP * self._world.coordinate_scale).sum())
        return shot

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)


def watch(env: MiniGolfEnv) -> Watched:
    """Have an environment's putts counted, until its hole changes."""
    watched = Watched(env.task.world)
    env.task = replace(env.task, world=watched)
    return watched


def random_putts(task: Task, balls: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, Outcome]:
    """Return the launch velocities (N, 3) of putts in any direction, most of them strong, and what became of them."""
    turns, shares = rng.uniform(0.0, 2.0 * np.pi, len(balls)), rng.random(len(balls)) ** 0.5
    velocities = task.launch_velocity(np.stack([shares * np.cos(turns), shares * np.sin(turns)], axis=-1))
    return velocities, task.simulate(balls, velocities)


def stuck(task: Task, balls: FloatArray) -> int:
    """Return how many of balls (N, 3) no putt moves on."""
    turns = 2.0 * np.pi * np.arange(PROBES) / PROBES
    putts = np.where(np.arange(PROBES)[:, None] % 2, 0.15, 1.0) * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    starts = np.repeat(balls, PROBES, axis=0)
    outcome = task.simulate(starts, task.launch_velocity(np.tile(putts, (len(balls), 1))))
    away = np.linalg.norm(outcome.position - starts, axis=1).reshape(-1, PROBES)
    moved = (away.max(axis=1) > MOVED) | outcome.holed.reshape(-1, PROBES).any(axis=1)
    return int((~moved).sum())
