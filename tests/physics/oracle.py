"""An independent oracle of sweeps: integer arithmetic on the exact values of the floats, no tolerance, no shared code.

Floats are dyadic rationals, so after multiplying by a power of two every coordinate is an integer. Squared distances to
segments and faces are then fractions of integers, and comparing them with a radius is exact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Integers = tuple[int, int, int]
HALVINGS = 60


class Nearest(NamedTuple):
    """The squared distance num / den of a point to a triangle, and the sign of its change along a direction."""

    num: int
    den: int
    change: int


def _dot(a: Integers, b: Integers) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _sub(a: Integers, b: Integers) -> Integers:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Integers, b: Integers) -> Integers:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _to_segment(p: Integers, a: Integers, b: Integers, w: Integers) -> Nearest:
    ab = _sub(b, a)
    ap = _sub(p, a)
    length2 = _dot(ab, ab)
    projection = _dot(ap, ab)
    if projection <= 0:
        return Nearest(_dot(ap, ap), 1, _dot(w, ap))
    if projection >= length2:
        bp = _sub(p, b)
        return Nearest(_dot(bp, bp), 1, _dot(w, bp))
    return Nearest(
        _dot(ap, ap) * length2 - projection * projection, length2, _dot(w, ap) * length2 - projection * _dot(w, ab)
    )


def squared_distance(p: Integers, triangle: tuple[Integers, Integers, Integers], w: Integers) -> Nearest:
    """Return the squared distance from p to the triangle and the sign of its change along w."""
    a, b, c = triangle
    n = _cross(_sub(b, a), _sub(c, a))
    sides = [_dot(_cross(_sub(y, x), _sub(p, x)), n) for x, y in ((a, b), (b, c), (c, a))]
    if any(n) and min(sides) >= 0:
        height = _dot(_sub(p, a), n)
        return Nearest(height * height, _dot(n, n), height * _dot(w, n))
    best = _to_segment(p, a, b, w)
    for x, y in ((b, c), (c, a)):
        candidate = _to_segment(p, x, y, w)
        if candidate.num * best.den < best.num * candidate.den:
            best = candidate
    return best


class Sweep:
    """The exact sweep of one sphere from start to end against one two-sided triangle."""

    def __init__(self, start: FloatArray, end: FloatArray, radius: float, triangle: FloatArray) -> None:
        """Convert all numbers to integers: ``unit`` of them make a metre, ``2**HALVINGS`` a whole path."""
        floats = [*map(float, start), *map(float, end), float(radius), *map(float, np.ravel(triangle))]
        self.unit = max(x.as_integer_ratio()[1] for x in floats) << HALVINGS
        numbers = [x.as_integer_ratio()[0] * (self.unit // x.as_integer_ratio()[1]) for x in floats]
        self.start: Integers = (numbers[0], numbers[1], numbers[2])
        self.path = _sub((numbers[3], numbers[4], numbers[5]), self.start)
        self.radius = numbers[6]
        corners = numbers[7:]
        self.triangle = tuple((corners[k], corners[k + 1], corners[k + 2]) for k in (0, 3, 6))

    def distance_at(self, alpha: float) -> Nearest:
        """Return the distance at a fraction of the path (rounded down to 2**-HALVINGS of it)."""
        num, den = float(alpha).as_integer_ratio()
        x, y, z = ((k << HALVINGS) * num // den >> HALVINGS for k in self.path)
        return squared_distance((self.start[0] + x, self.start[1] + y, self.start[2] + z), self.triangle, self.path)  # type: ignore[arg-type]

    def is_deeper(self, alpha: float, depth: float) -> bool:
        """Return whether the sphere, at a fraction of its path, is more than ``depth`` (m) inside; negative: above."""
        distance = self.distance_at(alpha)
        reach = self.radius - int(depth * self.unit)
        return reach > 0 and distance.num < reach * reach * distance.den

    def depth_at_start(self) -> float:
        """Return how deep the sphere is inside at the start, rounded, m; negative outside."""
        distance = self.distance_at(0.0)
        return (self.radius - math.isqrt(distance.num // distance.den)) / self.unit

    def closest_fraction(self) -> float:
        """Return the fraction of the path where the sphere is closest, by bisection of the convex distance."""
        if self.distance_at(0.0).change >= 0:
            return 0.0
        if self.distance_at(1.0).change <= 0:
            return 1.0
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            midpoint = 0.5 * (low + high)
            low, high = (midpoint, high) if self.distance_at(midpoint).change < 0 else (low, midpoint)
        return low

    def fault(self, hit: bool, alpha: float, tolerance: float) -> str:
        """Return what is wrong with a result, or "".

        A hit touches within the tolerance (m) and approaches, so that by convexity nothing was touched before. Without
        a hit the sphere never gets deeper than the tolerance, or than it starts.
        """
        if not 0.0 <= alpha <= 1.0:
            return f"alpha {alpha} is not in [0, 1]"
        if not hit:
            return (
                "missed" if self.is_deeper(self.closest_fraction(), tolerance + max(0.0, self.depth_at_start())) else ""
            )
        if not self.is_deeper(alpha, -tolerance):
            return "a hit without touching"
        if alpha > 0.0 and self.is_deeper(alpha, tolerance):
            return "a hit that comes late"
        return (
            "a hit of a sphere that moves away"
            if self.distance_at(alpha).change > 0 and self.distance_at(0.0).change > 0
            else ""
        )
