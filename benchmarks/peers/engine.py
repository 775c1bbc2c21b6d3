"""What the benchmarks ask of an engine, and minigolf_env itself behind it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from benchmarks.scenes import FloatArray, Scene

GRAVITY = 9.81
"""m/s^2, downwards."""


class Engine(ABC):
    """A scene in one engine, with balls that do not see each other.

    In the peers a ball cannot turn: then sliding friction of coefficient c brakes it by c g on a level floor, which is
    what rolling resistance c does in minigolf_env. Balls never sleep, so that every step is a step.

    Args:
        scene: what to build.
        balls: the number of balls, > 0.
        dt: the time step, s.
    """

    name: ClassVar[str]
    cast_kind: ClassVar[str]
    """What ``cast`` sends through the scene: a "sphere" as large as the ball, or only a "ray"."""

    @abstractmethod
    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None: ...

    @abstractmethod
    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Put the balls at positions (balls, 3), m, with velocities (balls, 3), m/s."""

    @abstractmethod
    def step(self, steps: int) -> None:
        """Move all balls by so many time steps."""

    @abstractmethod
    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions (balls, 3), m, and velocities (balls, 3), m/s."""

    @abstractmethod
    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the shares (N,) of the ways from starts to ends (N, 3) that are free, 1 where nothing is hit."""

    def close(self) -> None:  # noqa: B027 (most engines have nothing to give back)
        """Give back what the engine holds outside of Python."""


class Minigolf(Engine):
    """minigolf_env with the seed's response to impacts."""

    name = "minigolf_env, average"
    cast_kind = "sphere"
    impact: ClassVar[str] = "average"

    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None:
        self.world = scene.world(dt=dt, impact=self.impact)
        self.positions, self.velocities = np.zeros((balls, 3)), np.zeros((balls, 3))

    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Put the balls somewhere."""
        self.positions, self.velocities = positions, velocities

    def step(self, steps: int) -> None:
        """Move all balls; runs can be cut at any step without changing a bit."""
        shots = self.world.simulate_batch(self.positions, self.velocities, max_time=steps * self.world.dt)
        self.positions, self.velocities = shots.position, shots.velocity

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        return self.positions, self.velocities

    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Sweep the ball."""
        return np.asarray(self.world.sweep_batch(starts, ends).alpha)


class Conservative(Minigolf):
    """minigolf_env with impacts that keep energy."""

    name = "minigolf_env, conservative"
    impact = "conservative"
