"""Aiming: a putt before it is struck, from a mouse's drag or by keys. Numpy only."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from minigolf_env.rendering import Camera

FloatArray = NDArray[np.float64]

CANCEL, REACH = 0.025, 0.4
"""A drag of this much of the window's height is none, and one of this much is a putt at full power."""

WEAKEST = 0.01
"""Least power that keys give, so that the aim keeps its direction."""

FIRST_POWER = 0.3
"""Share of the top speed with which aiming by keys begins."""


@dataclass(frozen=True)
class Aim:
    """Where and how hard to strike."""

    x: float
    """With y the putt vector in plan: it points where the ball is to go, its length, at most 1, is the power."""
    y: float
    elevation: float = 0.0
    """Above the horizon, degrees; a putt has 0."""

    @property
    def power(self) -> float:
        """Share of the top speed."""
        return math.hypot(self.x, self.y)

    @property
    def direction(self) -> FloatArray:
        """Unit vector (3,) of the launch."""
        level = math.cos(math.radians(self.elevation)) / max(self.power, 1e-12)
        return np.array([self.x * level, self.y * level, math.sin(math.radians(self.elevation))])

    def turned(self, degrees: float) -> Aim:
        """Return the aim turned to the left, seen from above."""
        cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        return replace(self, x=cos * self.x - sin * self.y, y=sin * self.x + cos * self.y)

    def stronger(self, share: float) -> Aim:
        """Return the aim with more power, between WEAKEST and 1."""
        power = min(1.0, max(WEAKEST, self.power + share))
        return replace(self, x=self.x / self.power * power, y=self.y / self.power * power)


def from_drag(
    camera: Camera, ball: FloatArray, drag: tuple[float, float], size: tuple[int, int], elevation: float = 0.0
) -> Aim | None:
    """Return the aim of a slingshot drawn back, or None for a drag too short to mean a putt.

    In the picture the putt leaves the ball straight away from where the mouse was dragged to: the drag is taken back to
    the ground by how the picture changes where the ball is, to first order.

    Args:
        camera: where the player looks from.
        ball: (3,) the ball's centre, m.
        drag: from the press to the present place, to the right and up, pixels.
        size: of the window, pixels.
        elevation: of the launch, degrees.
    """
    width, height = size
    length = math.hypot(*drag) / height
    if length < CANCEL:
        return None
    way = _to_ground(camera, ball, (-2.0 * drag[0] / width, -2.0 * drag[1] / height), width / height)
    power = max(WEAKEST, min(1.0, (length - CANCEL) / (REACH - CANCEL)))
    return Aim(way[0] * power, way[1] * power, elevation)


def towards(camera: Camera, power: float = FIRST_POWER, elevation: float = 0.0) -> Aim:
    """Return the aim along the line of sight."""
    x, y = camera.target[0] - camera.eye[0], camera.target[1] - camera.eye[1]
    length = max(math.hypot(x, y), 1e-9)
    return Aim(x / length * power, y / length * power, elevation)


def _to_ground(camera: Camera, ball: FloatArray, way: tuple[float, float], aspect: float) -> tuple[float, float]:
    """Return the unit vector in plan that looks like ``way`` in the picture where the ball is."""
    clip = camera.clip_from_world(aspect)
    place = clip @ np.append(ball, 1.0)
    # The derivative of place[:2] / place[3] by the ball's x and y, times place[3] squared, which scales alone.
    slope = clip[:2, :2] * place[3] - np.outer(place[:2], clip[3, :2])
    if place[3] <= 0.0 or abs(np.linalg.det(slope)) < 1e-12:  # Behind the camera, or level with it.
        ahead = towards(camera, 1.0)
        return ahead.x, ahead.y
    x, y = np.linalg.solve(slope, way)
    length = math.hypot(x, y)
    return float(x / length), float(y / length)
