"""What moves in a picture: the ball, the flag, and bands on the ground. Numpy only."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Color = tuple[float, float, float, float]
"""Red, green, blue and opacity, each 0 to 1."""


class Line(NamedTuple):
    """A flat band along points, such as the trail of a putt."""

    points: FloatArray
    """(K, 3), K >= 2, m."""
    width: float
    """m."""
    start: Color
    """At the first point; it changes evenly to ``end``."""
    end: Color
    taper: float = 1.0
    """The share of the width that is left at the last point."""

    def band(self) -> tuple[FloatArray, NDArray[np.float64]]:
        """Return positions (2 K, 3) and colours (2 K, 4) of a strip of triangles, level across its way."""
        way = np.gradient(self.points, axis=0)
        side = np.stack([-way[:, 1], way[:, 0]], axis=-1)
        length = np.linalg.norm(side, axis=1, keepdims=True)
        side = np.divide(side, length, out=np.tile([1.0, 0.0], (len(side), 1)), where=length > 0.0)
        share = np.linspace(0.0, 1.0, len(self.points))
        half = 0.5 * self.width * (1.0 + (self.taper - 1.0) * share)[:, None] * np.pad(side, ((0, 0), (0, 1)))
        positions = np.stack([self.points - half, self.points + half], axis=1).reshape(-1, 3)
        tints = np.asarray(self.start) + share[:, None] * np.subtract(self.end, self.start)
        return positions, np.repeat(tints, 2, axis=0)


class Frame(NamedTuple):
    """One moment."""

    ball: FloatArray
    """(3,) the ball's centre, m."""
    turn: FloatArray
    """(3, 3) how the ball has rolled: a rotation."""
    flag: FloatArray
    """(3,) the foot of the flag's pole, m; above the cup's bottom while it is lifted."""
    lines: tuple[Line, ...] = ()
    size: float = 1.0
    """How much larger than it is the ball is drawn."""
