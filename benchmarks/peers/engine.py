"""The interface of a physics engine in the benchmarks, and minigolf_env behind it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from benchmarks.scenes import FloatArray, Scene

GRAVITY_ACCELERATION = 9.81
"""Gravity, m/s^2, downwards."""


class Engine(ABC):
    """A scene in one engine, with balls that do not collide with each other.

    In the other engines a ball cannot rotate. Sliding friction of coefficient c then decelerates it by c g on a level
    floor, as rolling resistance c does in minigolf_env. Balls never sleep, so that every step is computed.

    Args:
        scene: the scene to build.
        balls: number of balls, > 0.
        dt: time step, s.
    """

    name: ClassVar[str]
    """Name in tables."""
    cast_kind: ClassVar[str]
    """Shape that ``cast`` uses: a "sphere" as large as the ball, or a "ray"."""

    @abstractmethod
    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None: ...

    @abstractmethod
    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Set positions (balls, 3), m, and velocities (balls, 3), m/s."""

    @abstractmethod
    def step(self, steps: int) -> None:
        """Advance all balls by a number of time steps."""

    @abstractmethod
    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions (balls, 3), m, and velocities (balls, 3), m/s."""

    @abstractmethod
    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the hit fractions (N,) of casts from starts to ends (N, 3); 1 where nothing is hit."""

    def close(self) -> None:  # noqa: B027 (most engines hold nothing)
        """Release the engine's resources."""


class Minigolf(Engine):
    """minigolf_env with the average-velocity response of the CS121 notes."""

    name = "minigolf_env, average"
    cast_kind = "sphere"
    impact: ClassVar[str] = "average"

    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None:
        self.world = scene.world(dt=dt, impact=self.impact)
        self.positions, self.velocities = np.zeros((balls, 3)), np.zeros((balls, 3))

    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Set positions and velocities."""
        self.positions, self.velocities = positions, velocities

    def step(self, steps: int) -> None:
        """Advance all balls; splitting a run at any step gives the same bits."""
        shots = self.world.simulate_batch(self.positions, self.velocities, max_time=steps * self.world.dt)
        self.positions, self.velocities = shots.position, shots.velocity

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        return self.positions, self.velocities

    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Sweep the ball."""
        return np.asarray(self.world.sweep_batch(starts, ends).alpha)


class Conservative(Minigolf):
    """minigolf_env with energy-conserving impacts."""

    name = "minigolf_env, conservative"
    impact = "conservative"
