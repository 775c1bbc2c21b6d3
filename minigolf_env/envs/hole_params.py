"""Numbers that the rules need of the holes that balls play, as arrays: one hole for all balls, or one for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course

FloatArray = NDArray[np.float64]

MIN_SEGMENT_LENGTH = 1e-9
"""Smallest length of a route segment that is divided by, m; shorter segments count as points."""


class RouteSegment(NamedTuple):
    """A straight segment of the route of play in the xy-plane; each field has the shape of the holes, () or (N,)."""

    start: tuple[FloatArray, FloatArray]
    """x and y of its start, m."""
    vector: tuple[FloatArray, FloatArray]
    """x and y from its start to its end, m."""
    length_sq: FloatArray
    """Its squared length, m^2; greater than 0."""
    end: tuple[FloatArray, FloatArray]
    """x and y of its end, m."""
    remaining: FloatArray
    """Length of the segments after it, m."""


class HoleParams(NamedTuple):
    """Parameters of holes as arrays; each has a leading shape () for one hole, or (N,) for one hole a ball."""

    cup: FloatArray
    """(..., 3) centre of the cup's rim, m."""
    cup_radius: FloatArray
    """(...) radius of the cup, m."""
    ball_radius: FloatArray
    """(...) radius of the ball, m."""
    gravity: FloatArray
    """(...) gravity downwards, m/s^2."""
    top_speed: FloatArray
    """(...) launch speed of a full putt, m/s."""
    tee: FloatArray
    """(..., 2, 3) lower and upper corner of the box in which the ball's centre starts, m."""
    bounds: FloatArray
    """(..., 2, 3) lower and upper corner of the course's bounds, m."""
    route: FloatArray
    """(..., K, 2) corners of the route of play, m; shorter routes repeat their last corner to fill K rows."""

    @staticmethod
    def from_course(course: Course, top_speed: float) -> HoleParams:
        """Return the parameters of a course's hole.

        Raises:
            ValueError: the course has no cup.
        """
        if course.cup is None:
            raise ValueError(f"course: expected one with a cup, received {course.name!r}; it has no hole to play.")
        height = course.tee.height + course.ball_radius
        tee = [(*corner, height) for corner in (course.tee.lower, course.tee.upper)]
        return HoleParams(
            cup=np.asarray(course.cup.position),
            cup_radius=np.asarray(course.cup.radius),
            ball_radius=np.asarray(course.ball_radius),
            gravity=np.asarray(abs(course.gravity[2])),
            top_speed=np.asarray(top_speed),
            tee=np.asarray(tee),
            bounds=np.asarray(course.bounds),
            route=np.asarray(course.route),
        )

    @staticmethod
    def stack(holes: Sequence[HoleParams]) -> HoleParams:
        """Return the parameters of N holes as arrays with a leading axis (N,)."""
        routes = np.empty((len(holes), max(len(hole.route) for hole in holes), 2))
        for row, hole in zip(routes, holes, strict=True):
            row[:] = hole.route[-1]
            row[: len(hole.route)] = hole.route
        fields = zip(*(hole[:-1] for hole in holes), strict=True)
        return HoleParams(*(np.array(field) for field in (*fields, routes)))

    def take(self, rows: NDArray[np.int64]) -> HoleParams:
        """Return the parameters of some balls' holes."""
        return HoleParams(*(field[rows] for field in self))

    def route_segments(self) -> list[RouteSegment]:
        """Return the segments of the route, from the tee to the cup."""
        x, y = self.route[..., 0], self.route[..., 1]
        segments: list[RouteSegment] = []
        remaining = np.zeros(x.shape[:-1])
        for k in reversed(range(x.shape[-1] - 1)):
            start = (x[..., k], y[..., k])
            end = (x[..., k + 1], y[..., k + 1])
            vector = (end[0] - start[0], end[1] - start[1])
            length = np.hypot(*vector)
            length_sq = np.maximum(length, MIN_SEGMENT_LENGTH) ** 2
            segments.append(RouteSegment(start, vector, length_sq, end, remaining))
            remaining = remaining + length
        return segments[::-1]
