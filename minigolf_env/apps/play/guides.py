"""Aiming guides on the ground: the arrow, the predicted path and the path of a hint. Numpy only.

Widths and lengths are in units of the ball's radius, or of MAX_UNIT if that is smaller.
"""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import NDArray

from minigolf_env.apps.play.aim import Aim
from minigolf_env.rendering import Line
from minigolf_env.rendering.scene_state import Color

FloatArray = NDArray[np.float64]

MAX_UNIT = 0.045
"""Largest unit of lengths, m; a larger ball needs no longer arrow."""

MIN_ARROW_LENGTH = 6.0
"""Length of the arrow at no power, units."""

MAX_ARROW_LENGTH = 34.0
"""Length of the arrow at full power, units."""

ARROW_START = 1.6
"""Distance of the arrow's tail from the ball's centre, units."""

ARROW_HEAD_LENGTH = 4.4
"""Length and width of the arrow's head, units."""

ARROW_SHAFT_WIDTH = 1.5
"""Width of the arrow's shaft, units."""

DASH_LENGTH = 2.2
"""Length of a dash of the predicted path, units."""

DASH_SPACING = 1.8
"""Space between two dashes, units."""

DASH_WIDTH = 0.75
"""Width of a dash, units."""

MAX_DASHES = 90
"""Largest number of dashes."""

HINT_WIDTH = 1.3
"""Width of the path of a hint, units."""

NUM_HINT_POINTS = 160
"""Number of points of the path of a hint."""

HINT_COLOR = (0.35, 0.85, 1.0)
"""Colour of the path of a hint."""

DEPTH_BELOW_CENTER = 0.9
"""Depth of the guides below the ball's centre, in radii: they lie just above the ground."""


def power_color(power: float) -> tuple[float, float, float]:
    """Return the colour of a power: green at 0, yellow, red at 1."""
    return colorsys.hsv_to_rgb((1.0 - power) * 0.36, 0.85, 0.95)


class Guides:
    """Builds the aiming guides of a ball.

    Args:
        radius: the ball's radius, m.
        flying: True if the ball is thrown; the guides then follow its centre instead of the ground.
    """

    def __init__(self, radius: float, flying: bool) -> None:
        self._unit = min(radius, MAX_UNIT)
        self._flying = flying
        self._offset = np.array([0.0, 0.0, 0.0 if flying else DEPTH_BELOW_CENTER * radius])

    def arrow(self, ball: FloatArray, aim: Aim) -> tuple[Line, ...]:
        """Return the arrow from the ball (3,) along the aim; more power makes it longer and redder."""
        unit = self._unit
        length = self._arrow_length(aim)
        origin = ball - self._offset
        distances = (ARROW_START * unit, length - ARROW_HEAD_LENGTH * unit, length)
        tail, neck, tip = (origin + aim.direction * distance for distance in distances)
        color = power_color(aim.power)
        shaft = Line(np.stack([tail, neck]), ARROW_SHAFT_WIDTH * unit, (*color, 0.25), (*color, 0.95))
        head = Line(np.stack([neck, tip]), ARROW_HEAD_LENGTH * unit, (*color, 0.95), (*color, 0.95), taper=0.0)
        return shaft, head

    def dashes(self, path: FloatArray, aim: Aim) -> tuple[Line, ...]:
        """Return the predicted path (K, 3) of an aim as dashes that fade with the distance."""
        unit = self._unit
        points = path - self._offset
        lengths = _arc_lengths(points)
        start = 0.0 if self._flying else self._arrow_length(aim)  # On the ground the arrow covers the beginning.
        dash_starts = np.arange(start + DASH_SPACING * unit, lengths[-1], (DASH_LENGTH + DASH_SPACING) * unit)
        dash_starts = dash_starts[:MAX_DASHES]
        lines = []
        for k, dash_start in enumerate(dash_starts):
            ends = np.array([dash_start, min(dash_start + DASH_LENGTH * unit, lengths[-1])])
            color: Color = (1.0, 1.0, 1.0, 0.9 - 0.65 * k / max(len(dash_starts), 12))
            lines.append(Line(_points_at(points, lengths, ends), DASH_WIDTH * unit, color, color))
        return tuple(lines)

    def hint_path(self, path: FloatArray) -> tuple[Line, ...]:
        """Return the path (K, 3) of a hint as a band."""
        points = path - self._offset
        lengths = _arc_lengths(points)
        band = _points_at(points, lengths, np.linspace(0.0, lengths[-1], NUM_HINT_POINTS))
        return (Line(band, HINT_WIDTH * self._unit, (*HINT_COLOR, 0.25), (*HINT_COLOR, 0.75)),)

    def _arrow_length(self, aim: Aim) -> float:
        """Return the distance of the arrow's tip from the ball's centre, m."""
        return self._unit * (MIN_ARROW_LENGTH + (MAX_ARROW_LENGTH - MIN_ARROW_LENGTH) * aim.power)


def _arc_lengths(points: FloatArray) -> FloatArray:
    """Return the arc lengths (K,), m, of points (K, 3) along their polyline."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _points_at(points: FloatArray, lengths: FloatArray, distances: FloatArray) -> FloatArray:
    """Return the points (N, 3) at distances (N,) along a polyline."""
    return np.stack([np.interp(distances, lengths, points[:, k]) for k in range(3)], axis=-1)
