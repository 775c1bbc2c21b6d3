"""What the rules know of the holes that balls play, as arrays: one hole for all, or one a ball."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course

FloatArray = NDArray[np.float64]


class Holes(NamedTuple):
    """What the rules know of holes, as arrays; each has a leading shape () for one hole, or (N,) for a hole a ball."""

    cup: FloatArray
    """(..., 3) the rim's centre, m."""
    cup_radius: FloatArray
    """m."""
    ball_radius: FloatArray
    """m."""
    gravity: FloatArray
    """Downwards, m/s^2."""
    top_speed: FloatArray
    """Launch speed of a full putt, m/s."""
    bounds: FloatArray
    """(..., 2, 3) lower and upper corner, m."""
    route: FloatArray
    """(..., K, 2) the way of play, m; its last point as often as it takes to fill K rows."""

    @staticmethod
    def of(course: Course, top_speed: float) -> Holes:
        """Return a course's hole.

        Raises:
            ValueError: it has no cup.
        """
        if course.cup is None:
            raise ValueError(f"course: expected one with a cup, received {course.name!r}; it has no hole to play.")
        numbers = (course.cup.position, course.cup.radius, course.ball_radius, abs(course.gravity[2]), top_speed)
        return Holes(*(np.asarray(number) for number in (*numbers, course.bounds, course.route)))

    @staticmethod
    def together(holes: Sequence[Holes]) -> Holes:
        """Return N holes as one table."""
        routes = np.empty((len(holes), max(len(hole.route) for hole in holes), 2))
        for row, hole in zip(routes, holes, strict=True):
            row[:] = hole.route[-1]
            row[: len(hole.route)] = hole.route
        fields = zip(*(hole[:-1] for hole in holes), strict=True)
        return Holes(*(np.array(field) for field in (*fields, routes)))

    def of_rows(self, rows: NDArray[np.int64]) -> Holes:
        """Return the holes of some balls."""
        return Holes(*(field[rows] for field in self))
