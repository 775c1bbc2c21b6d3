"""Parameters of holes, as the compiled rules read them: of one hole for all balls, or of one for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course

FloatArray = NDArray[np.float64]

MIN_SEGMENT_LENGTH = 1e-9
"""Smallest length of a route segment that is divided by, m; shorter segments count as points."""

HOLE_DTYPE = np.dtype(
    [
        ("cup", "f8", (3,)),  # centre of the cup's rim, m
        ("cup_radius", "f8"),  # m
        ("ball_radius", "f8"),  # m
        ("gravity", "f8"),  # downwards, m/s^2
        ("top_speed", "f8"),  # launch speed of a full putt, m/s
        ("tee", "f8", (2, 3)),  # lower and upper corner of the box in which the ball's centre starts, m
        ("bounds", "f8", (2, 3)),  # lower and upper corner of the course's bounds, m
        ("max_strokes", "f8"),  # strokes after which an episode ends
        ("max_steps", "i8"),  # time steps of the longest putt
        ("first_segment", "i8"),  # row of the route's first segment
        ("num_segments", "i8"),  # number of the route's segments
    ]
)
"""Parameters of a hole and its rules."""

ROUTE_DTYPE = np.dtype(
    [
        ("start", "f8", (2,)),  # x and y of its start, m
        ("vector", "f8", (2,)),  # from its start to its end, m
        ("length_sq", "f8"),  # squared length, m^2; greater than 0
        ("end", "f8", (2,)),  # x and y of its end, m
        ("remaining", "f8"),  # length of the segments after it, m
    ]
)
"""A straight segment of the route of play in the xy-plane."""


class Holes(NamedTuple):
    """One hole or several as the compiled rules read them."""

    params: NDArray[np.void]
    """(M,) records of HOLE_DTYPE."""
    route: NDArray[np.void]
    """(K,) records of ROUTE_DTYPE: the segments of each hole from its tee to its cup, hole after hole."""


def compile_hole(course: Course, top_speed: float, max_strokes: int, max_steps: int) -> Holes:
    """Return the parameters of a course with a cup under an environment's rules.

    Args:
        course: the course; its cup must not be None.
        top_speed: launch speed of a full putt, m/s.
        max_strokes: number of strokes after which an episode ends.
        max_steps: number of time steps of the longest putt.
    """
    cup = course.cup
    assert cup is not None  # noqa: S101 (build_task refuses a course without a cup)
    height = course.tee.height + course.ball_radius
    params = np.zeros(1, HOLE_DTYPE)
    params["cup"] = cup.position
    params["cup_radius"] = cup.radius
    params["ball_radius"] = course.ball_radius
    params["gravity"] = abs(course.gravity[2])
    params["top_speed"] = top_speed
    params["tee"] = [(*corner, height) for corner in (course.tee.lower, course.tee.upper)]
    params["bounds"] = course.bounds
    params["max_strokes"] = max_strokes
    params["max_steps"] = max_steps
    route = _route_segments(np.asarray(course.route))
    params["num_segments"] = len(route)
    return Holes(params, route)


def stack_holes(holes: Sequence[Holes]) -> Holes:
    """Return holes as one, in order."""
    params = _concatenate([hole.params for hole in holes])
    params["first_segment"] = np.cumsum(params["num_segments"]) - params["num_segments"]
    return Holes(params, _concatenate([hole.route for hole in holes]))


def _concatenate(records: Sequence[NDArray[np.void]]) -> NDArray[np.void]:
    """Return arrays of the same records as one; numpy.concatenate takes 10 us an array to compare their fields."""
    return np.frombuffer(bytearray().join(array.tobytes() for array in records), records[0].dtype)


def _route_segments(route: FloatArray) -> NDArray[np.void]:
    """Return the segments (K,) of a route with the corners (K + 1, 2), m."""
    segments = np.zeros(len(route) - 1, ROUTE_DTYPE)
    segments["start"] = route[:-1]
    segments["end"] = route[1:]
    segments["vector"] = segments["end"] - segments["start"]
    lengths = np.sqrt((segments["vector"] ** 2).sum(axis=1))
    segments["length_sq"] = np.maximum(lengths, MIN_SEGMENT_LENGTH) ** 2
    segments["remaining"] = np.append(np.cumsum(lengths[:0:-1])[::-1], 0.0)
    return segments
