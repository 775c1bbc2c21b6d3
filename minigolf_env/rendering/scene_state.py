"""The moving things of a scene at one instant: the ball, the flag, and lines on the ground. Numpy only."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Color = tuple[float, float, float, float]
"""Red, green, blue and opacity, each from 0 to 1."""


class Line(NamedTuple):
    """A flat band along a polyline, such as the trail of a putt."""

    points: FloatArray
    """Vertices (K, 3) of the polyline, K >= 2, m."""
    width: float
    """Width of the band, m."""
    start_color: Color
    """Colour at the first point; it changes linearly to ``end_color``."""
    end_color: Color
    """Colour at the last point."""
    taper: float = 1.0
    """Width at the last point as a share of ``width``."""

    def triangle_strip(self) -> tuple[FloatArray, NDArray[np.float64]]:
        """Return the positions (2 K, 3) and colours (2 K, 4) of a triangle strip whose cross-section is horizontal."""
        direction = np.gradient(self.points, axis=0)
        side = np.stack([-direction[:, 1], direction[:, 0]], axis=-1)
        length = np.linalg.norm(side, axis=1, keepdims=True)
        side = np.divide(side, length, out=np.tile([1.0, 0.0], (len(side), 1)), where=length > 0.0)
        fraction = np.linspace(0.0, 1.0, len(self.points))
        half_width = 0.5 * self.width * (1.0 + (self.taper - 1.0) * fraction)[:, None]
        offset = half_width * np.pad(side, ((0, 0), (0, 1)))
        positions = np.stack([self.points - offset, self.points + offset], axis=1).reshape(-1, 3)
        colors = np.asarray(self.start_color) + fraction[:, None] * np.subtract(self.end_color, self.start_color)
        return positions, np.repeat(colors, 2, axis=0)


class SceneState(NamedTuple):
    """Poses of everything that moves at one instant."""

    ball: FloatArray
    """Centre (3,) of the ball, m."""
    rotation: FloatArray
    """Rotation matrix (3, 3) of the ball: how it has rolled."""
    flag: FloatArray
    """Foot (3,) of the flag's pole, m; above the bottom of the cup while the flag is lifted."""
    lines: tuple[Line, ...] = ()
    """Bands on the ground, such as the trail."""
    marker_radius: float = 0.0
    """Radius, m, of a marker that is drawn for the ball in images in which that would be too small; 0: none.

    The marker is white, and no shadow falls on it; it casts one."""

    def drawn_radius(self, ball_radius: float) -> float:
        """Return the radius of what is drawn for a ball of a radius, m: its own or the marker's."""
        return self.marker_radius or ball_radius
