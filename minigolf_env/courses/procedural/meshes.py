"""Closed solids from a few lines of numpy: the same vertices and faces everywhere, in microseconds.

Lengths in metres, z up; faces look outwards, counter-clockwise from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from minigolf_env.courses.procedural.portable_rng import circle

FloatArray: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

GRAIN = 2.0**-24
"""Coordinates are multiples of this, m: no rounding of what they were computed with can show."""


PITCH = 0.25
"""Slope of roofs: no ball comes to rest on one, or trembles there."""


class Solid(NamedTuple):
    """A closed mesh."""

    vertices: FloatArray
    """(V, 3), m."""
    faces: Indices
    """(F, 3)."""

    def moved(self, x: float, y: float, z: float, ahead: tuple[float, float] = (1.0, 0.0)) -> Solid:
        """Return the solid with its origin at (x, y, z), m, and its x axis along the unit vector ``ahead``."""
        c, s = ahead
        u, v, w = self.vertices.T
        return Solid(np.column_stack([x + c * u - s * v, y + s * u + c * v, z + w]), self.faces)


def merged(solids: Sequence[Solid]) -> Solid:
    """Return several solids as one, on the grain."""
    starts = np.cumsum([0, *(len(solid.vertices) for solid in solids)])
    faces = [solid.faces + start for solid, start in zip(solids, starts, strict=False)]
    vertices = np.concatenate([solid.vertices for solid in solids])
    return Solid(np.round(vertices / GRAIN) * GRAIN, np.concatenate(faces))


def loft(rings: ArrayLike, cyclic: bool = False) -> Solid:
    """Return the solid through rings (M, N, 3), each counter-clockwise seen from the next one.

    The first and the last ring, convex, are its ends; ``cyclic``: the last is joined to the first instead.
    """
    array = np.asarray(rings, dtype=np.float64)
    many, sides = array.shape[:2]
    index = np.arange(many * sides).reshape(many, sides)
    faces = [_between(np.vstack([index, index[:1]]) if cyclic else index)]
    if not cyclic:
        faces += [_fan(index[0, ::-1]), _fan(index[-1])]
    return Solid(array.reshape(-1, 3), np.concatenate(faces))


def prism(outline: ArrayLike, bottom: float, top: float) -> Solid:
    """Return the solid over a convex outline (N, 2), counter-clockwise, from a level to a roof that rises with y."""
    plan = np.asarray(outline, dtype=np.float64)
    roof = top + PITCH * (plan[:, 1] - plan[:, 1].min())
    return loft([np.column_stack([plan, level]) for level in (np.full(len(plan), bottom), roof)])


def box(length: float, width: float, bottom: float, top: float) -> Solid:
    """Return a box with its middle on the z axis, its length along x."""
    x, y = length / 2.0, width / 2.0
    return prism([(-x, -y), (x, -y), (x, y), (-x, y)], bottom, top)


def revolved(profile: ArrayLike, sides: int, swell: FloatArray | None = None) -> Solid:
    """Return the solid that a profile (K, 2) of (radius, z) sweeps around the z axis, as a prism of ``sides``.

    The profile runs counter-clockwise from the axis round to the axis. ``swell`` (K, sides) multiplies the radius.
    """
    radius, level = np.asarray(profile, dtype=np.float64).T
    swollen = radius[:, None] * (np.ones((1, sides)) if swell is None else swell)
    unit = np.array(circle(sides))
    rings = np.stack([swollen * unit[:, 0], swollen * unit[:, 1], np.repeat(level[:, None], sides, axis=1)], axis=-1)
    counts = np.where(radius > 0.0, sides, 1)
    starts = np.cumsum(counts) - counts
    index = starts[:, None] + np.where(radius[:, None] > 0.0, np.arange(sides), 0)
    vertices = np.concatenate([ring[:count] for ring, count in zip(rings, counts.tolist(), strict=True)])
    return Solid(vertices, _between(index))


def slab(top: FloatArray, faces: Indices, bottom: float) -> Solid:
    """Return the solid between a surface over the plan, given by its vertices (V, 3) and faces, and a level below."""
    many = len(top)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    rim = edges[~np.isin(edges[:, 0] * many + edges[:, 1], edges[:, 1] * many + edges[:, 0])]
    a, b = rim.T
    below = np.column_stack([top[:, :2], np.full(many, bottom)])
    sides = [np.column_stack([b, a, a + many]), np.column_stack([b, a + many, b + many])]
    return Solid(np.concatenate([top, below]), np.concatenate([faces, faces[:, ::-1] + many, *sides]))


def between_loops(outer: Sequence[int], inner: Sequence[int], points: Sequence[Any]) -> list[tuple[int, int, int]]:
    """Return faces that fill the plan between two loops of point numbers, both counter-clockwise around one middle.

    ``points``: x, y, ... of each number. Each side of the inner loop joins the corner of the outer one that is most in
    its direction, so the outer loop must be convex and a good deal larger than the inner.
    """
    x = sum(points[i][0] for i in inner) / len(inner)
    y = sum(points[i][1] for i in inner) / len(inner)

    def nearest(i: int, j: int) -> int:
        u = points[i][0] + points[j][0] - 2.0 * x, points[i][1] + points[j][1] - 2.0 * y
        ways = [(points[k][0] - x, points[k][1] - y) for k in outer]
        cosines = [(u[0] * v[0] + u[1] * v[1]) / (v[0] * v[0] + v[1] * v[1]) ** 0.5 for v in ways]
        return cosines.index(max(cosines))

    sides = list(zip(inner, [*inner[1:], inner[0]], strict=True))
    corners = [nearest(i, j) for i, j in sides]
    faces = [(outer[corner], j, i) for (i, j), corner in zip(sides, corners, strict=True)]
    for k, (i, _) in enumerate(sides):
        corner = corners[k - 1]
        while corner != corners[k]:
            after = (corner + 1) % len(outer)
            faces.append((outer[corner], outer[after], i))
            corner = after
    return faces


def _between(index: Indices) -> Indices:
    """Return the faces (F, 3) between the rows of a table of vertex numbers that is cyclic in its columns."""
    a, b = index, np.roll(index, -1, axis=1)
    quads = np.stack([a[:-1], b[:-1], b[1:], a[1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    first, second, third = faces.T
    return np.asarray(faces[(first != second) & (second != third) & (third != first)])


def _fan(ring: Indices) -> Indices:
    return np.column_stack([np.full(len(ring) - 2, ring[0]), ring[1:-1], ring[2:]])
