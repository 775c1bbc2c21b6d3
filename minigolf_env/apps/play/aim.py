"""The aim of a putt or throw, set by a mouse drag or by keys. Numpy only."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from minigolf_env.rendering import Camera

FloatArray = NDArray[np.float64]

MIN_DRAG_LENGTH = 0.025
"""Shortest drag that aims, as a share of the window's height."""

FULL_POWER_DRAG_LENGTH = 0.4
"""Length of a drag at full power, as a share of the window's height."""

MIN_POWER = 0.01
"""Smallest power of an aim; at 0 the aim would lose its direction."""

DEFAULT_POWER = 0.3
"""Power of an aim that starts by keys, as a share of the top speed."""


@dataclass(frozen=True)
class Aim:
    """Direction and power of a stroke.

    The putt vector (x, y) points where the ball is to go. Its length, at most 1, is the power.
    """

    x: float
    """x component of the putt vector."""
    y: float
    """y component of the putt vector."""
    elevation: float = 0.0
    """Angle above the horizon, degrees; a putt has 0."""

    @property
    def power(self) -> float:
        """Launch speed as a share of the top speed."""
        return math.hypot(self.x, self.y)

    @property
    def direction(self) -> FloatArray:
        """Unit vector (3,) of the launch."""
        scale = math.cos(math.radians(self.elevation)) / max(self.power, 1e-12)
        return np.array([self.x * scale, self.y * scale, math.sin(math.radians(self.elevation))])

    def turned(self, degrees: float) -> Aim:
        """Return the aim turned to the left, seen from above."""
        cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        return replace(self, x=cos * self.x - sin * self.y, y=sin * self.x + cos * self.y)

    def stronger(self, change: float) -> Aim:
        """Return the aim with more power, limited to MIN_POWER and 1."""
        power = min(1.0, max(MIN_POWER, self.power + change))
        return replace(self, x=self.x / self.power * power, y=self.y / self.power * power)


def aim_from_drag(
    camera: Camera, ball: FloatArray, drag: tuple[float, float], size: tuple[int, int], elevation: float = 0.0
) -> Aim | None:
    """Return the aim of a drag that draws the ball back like a slingshot, or None if the drag is too short.

    On the screen the putt points away from the end of the drag. The direction on the screen is mapped to the ground
    with the derivative of the projection at the ball.

    Args:
        camera: the player's camera.
        ball: (3,) centre of the ball, m.
        drag: vector from the press to the present position of the mouse, right and up, pixels.
        size: width and height of the window, pixels.
        elevation: elevation of the launch, degrees.
    """
    width, height = size
    length = math.hypot(*drag) / height
    if length < MIN_DRAG_LENGTH:
        return None
    x, y = _screen_to_ground(camera, ball, (-2.0 * drag[0] / width, -2.0 * drag[1] / height), width / height)
    power = (length - MIN_DRAG_LENGTH) / (FULL_POWER_DRAG_LENGTH - MIN_DRAG_LENGTH)
    power = max(MIN_POWER, min(1.0, power))
    return Aim(x * power, y * power, elevation)


def aim_along_view(camera: Camera, power: float = DEFAULT_POWER, elevation: float = 0.0) -> Aim:
    """Return the aim along the camera's line of sight."""
    x, y = camera.target[0] - camera.eye[0], camera.target[1] - camera.eye[1]
    length = max(math.hypot(x, y), 1e-9)
    return Aim(x / length * power, y / length * power, elevation)


def _screen_to_ground(
    camera: Camera, ball: FloatArray, screen_direction: tuple[float, float], aspect: float
) -> tuple[float, float]:
    """Return the unit vector in the xy-plane that has a direction on the screen, at the ball."""
    matrix = camera.clip_from_world(aspect)
    clip = matrix @ np.append(ball, 1.0)
    # The Jacobian of clip[:2] / clip[3] with respect to the ball's x and y, times clip[3]^2, which only scales it.
    jacobian = matrix[:2, :2] * clip[3] - np.outer(clip[:2], matrix[3, :2])
    if clip[3] <= 0.0 or abs(np.linalg.det(jacobian)) < 1e-12:  # The ball is behind the camera, or at its height.
        fallback = aim_along_view(camera, 1.0)
        return fallback.x, fallback.y
    x, y = np.linalg.solve(jacobian, screen_direction)
    length = math.hypot(x, y)
    return float(x / length), float(y / length)
