"""What the rules know of the holes that balls play, as arrays: one hole for all, or one a ball."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course

FloatArray = NDArray[np.float64]

MIN_SEGMENT_LENGTH = 1e-9
"""Legs of a route shorter than this are points, m."""


class RouteSegment(NamedTuple):
    """A straight part of the way of play, in plan; each field has the shape of the holes, () or (N,)."""

    start: tuple[FloatArray, FloatArray]
    """x, y of its beginning, m."""
    vector: tuple[FloatArray, FloatArray]
    """x, y from its beginning to its end, m."""
    length_sq: FloatArray
    """Its squared length, m^2; not zero."""
    end: tuple[FloatArray, FloatArray]
    """x, y of its end, m."""
    remaining: FloatArray
    """How long the legs after it are, m."""


class HoleParams(NamedTuple):
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
    tee: FloatArray
    """(..., 2, 3) lower and upper corner of where the ball's centre starts, m."""
    bounds: FloatArray
    """(..., 2, 3) lower and upper corner, m."""
    route: FloatArray
    """(..., K, 2) the way of play, m; its last point as often as it takes to fill K rows."""

    @staticmethod
    def from_course(course: Course, top_speed: float) -> HoleParams:
        """Return a course's hole.

        Raises:
            ValueError: it has no cup.
        """
        if course.cup is None:
            raise ValueError(f"course: expected one with a cup, received {course.name!r}; it has no hole to play.")
        height = course.tee.height + course.ball_radius
        tee = [(*corner, height) for corner in (course.tee.lower, course.tee.upper)]
        numbers = (course.cup.position, course.cup.radius, course.ball_radius, abs(course.gravity[2]), top_speed)
        return HoleParams(*(np.asarray(number) for number in (*numbers, tee, course.bounds, course.route)))

    @staticmethod
    def stack(holes: Sequence[HoleParams]) -> HoleParams:
        """Return N holes as one table."""
        routes = np.empty((len(holes), max(len(hole.route) for hole in holes), 2))
        for row, hole in zip(routes, holes, strict=True):
            row[:] = hole.route[-1]
            row[: len(hole.route)] = hole.route
        fields = zip(*(hole[:-1] for hole in holes), strict=True)
        return HoleParams(*(np.array(field) for field in (*fields, routes)))

    def take(self, rows: NDArray[np.int64]) -> HoleParams:
        """Return the holes of some balls."""
        return HoleParams(*(field[rows] for field in self))

    def route_segments(self) -> list[RouteSegment]:
        """Return the legs of the way of play, in their order."""
        x, y = self.route[..., 0], self.route[..., 1]
        legs, after = [], np.zeros(x.shape[:-1])
        for k in reversed(range(x.shape[-1] - 1)):
            start, end = (x[..., k], y[..., k]), (x[..., k + 1], y[..., k + 1])
            way = end[0] - start[0], end[1] - start[1]
            length = np.hypot(*way)
            legs.append(RouteSegment(start, way, np.maximum(length, MIN_SEGMENT_LENGTH) ** 2, end, after))
            after = after + length
        return legs[::-1]
