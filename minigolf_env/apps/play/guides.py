"""Bands on the ground that help to aim: the arrow, the way foreseen, a hint's ghost. Numpy only."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import NDArray

from minigolf_env.apps.play.aim import Aim
from minigolf_env.rendering import Line
from minigolf_env.rendering.scene_state import Color

FloatArray = NDArray[np.float64]

SHORTEST, LONGEST = 6.0, 34.0
"""Lengths of the arrow at no and at full power, in its unit."""

GAP, HEAD = 1.6, 4.4
"""Where the arrow begins, from the ball's centre, and the length of its head, in its unit."""

DASH, SPACE = 2.2, 1.8
"""Of a way foreseen, in the unit."""

LARGEST_UNIT = 0.045
"""The unit of bands is the ball's radius, but no more than this: a large ball needs no longer arrow, m."""

MOST_DASHES = 90

SUNK = 0.9
"""Bands lie this much of a radius below the ball's centre."""

GHOST = (0.35, 0.85, 1.0)
"""Colour of a hint."""


def tint(power: float) -> tuple[float, float, float]:
    """Return the colour of a power: green, yellow, red."""
    return colorsys.hsv_to_rgb((1.0 - power) * 0.36, 0.85, 0.95)


class Guides:
    """Draws what helps to aim a ball.

    Args:
        radius: the ball's, m.
        flying: whether it is thrown, so that bands follow its centre and not the ground below it.
    """

    def __init__(self, radius: float, flying: bool) -> None:
        self._unit = min(radius, LARGEST_UNIT)
        self._flying = flying
        self._sunk = np.array([0.0, 0.0, 0.0 if flying else SUNK * radius])

    def arrow(self, ball: FloatArray, aim: Aim) -> tuple[Line, ...]:
        """Return the arrow from the ball (3,) where it is to go, longer and redder with its power."""
        unit, length = self._unit, self._reach(aim)
        foot = ball - self._sunk
        tail, neck, tip = (foot + aim.direction * along for along in (GAP * unit, length - HEAD * unit, length))
        color = tint(aim.power)
        shaft = Line(np.stack([tail, neck]), 1.5 * unit, (*color, 0.25), (*color, 0.95))
        return shaft, Line(np.stack([neck, tip]), 4.4 * unit, (*color, 0.95), (*color, 0.95), taper=0.0)

    def dashes(self, way: FloatArray, aim: Aim) -> tuple[Line, ...]:
        """Return the way (K, 3) that an aim leads to, as dashes that fade with the distance."""
        points, unit = way - self._sunk, self._unit
        along = _along(points)
        first = 0.0 if self._flying else self._reach(aim)  # On the ground the arrow lies there.
        starts = np.arange(first + SPACE * unit, along[-1], (DASH + SPACE) * unit)[:MOST_DASHES]
        lines = []
        for k, start in enumerate(starts):
            ends = np.array([start, min(start + DASH * unit, along[-1])])
            color: Color = (1.0, 1.0, 1.0, 0.9 - 0.65 * k / max(len(starts), 12))
            lines.append(Line(_at(points, along, ends), 0.75 * unit, color, color))
        return tuple(lines)

    def ghost(self, way: FloatArray) -> tuple[Line, ...]:
        """Return a way (K, 3) as the band of a hint."""
        points = way - self._sunk
        along = _along(points)
        even = _at(points, along, np.linspace(0.0, along[-1], 160))
        return (Line(even, 1.3 * self._unit, (*GHOST, 0.25), (*GHOST, 0.75)),)

    def _reach(self, aim: Aim) -> float:
        """Return how far from the ball's centre the arrow's head ends, m."""
        return self._unit * (SHORTEST + (LONGEST - SHORTEST) * aim.power)


def _along(points: FloatArray) -> FloatArray:
    """Return how far along the way points (K, 3) are (K,), m."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _at(points: FloatArray, along: FloatArray, distances: FloatArray) -> FloatArray:
    return np.stack([np.interp(distances, along, points[:, k]) for k in range(3)], axis=-1)
