"""Closed solids from a few lines of numpy: the same vertices and faces on every machine, built in microseconds.

Lengths are in metres, z points up. Faces are counter-clockwise seen from outside.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from minigolf_env.courses.procedural.portable_rng import unit_circle

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]

VERTEX_GRID = 2.0**-24
"""Grid that coordinates are rounded to, m, which removes rounding errors of the computation that led to them."""

ROOF_SLOPE = 0.25
"""Slope of the tops of borders and obstacles: no ball comes to rest on them."""


class SolidMesh(NamedTuple):
    """Closed mesh of a solid."""

    vertices: FloatArray
    """Vertices (V, 3), m."""
    faces: IntArray
    """Faces (F, 3) as indices of vertices."""

    def transformed(self, x: float, y: float, z: float, direction: tuple[float, float] = (1.0, 0.0)) -> SolidMesh:
        """Return the solid with its origin at (x, y, z), m, and its x axis along a unit vector."""
        c, s = direction
        u, v, w = self.vertices.T
        return SolidMesh(np.column_stack([x + c * u - s * v, y + s * u + c * v, z + w]), self.faces)


def merge_solids(solids: Sequence[SolidMesh]) -> SolidMesh:
    """Return several solids as one mesh, with its vertices rounded to the grid."""
    starts = np.cumsum([0, *(len(solid.vertices) for solid in solids)])
    faces = [solid.faces + start for solid, start in zip(solids, starts, strict=False)]
    vertices = np.concatenate([solid.vertices for solid in solids])
    return SolidMesh(np.round(vertices / VERTEX_GRID) * VERTEX_GRID, np.concatenate(faces))


def loft(rings: ArrayLike, cyclic: bool = False) -> SolidMesh:
    """Return the solid through rings (M, N, 3), each counter-clockwise seen from the next one.

    The first and the last ring, which must be convex, close its ends; ``cyclic``: the last ring is joined to the first.
    """
    array = np.asarray(rings, dtype=np.float64)
    num_rings, sides = array.shape[:2]
    index = np.arange(num_rings * sides).reshape(num_rings, sides)
    faces = [_connect_rows(np.vstack([index, index[:1]]) if cyclic else index)]
    if not cyclic:
        faces += [_fan_faces(index[0, ::-1]), _fan_faces(index[-1])]
    return SolidMesh(array.reshape(-1, 3), np.concatenate(faces))


def make_prism(outline: ArrayLike, bottom: float, top: float) -> SolidMesh:
    """Return the solid over a convex outline (N, 2), counter-clockwise, from a level to a roof that rises with y."""
    corners = np.asarray(outline, dtype=np.float64)
    roof = top + ROOF_SLOPE * (corners[:, 1] - corners[:, 1].min())
    return loft([np.column_stack([corners, level]) for level in (np.full(len(corners), bottom), roof)])


def make_box(length: float, width: float, bottom: float, top: float) -> SolidMesh:
    """Return a box centred on the z axis, with its length along x."""
    x = length / 2.0
    y = width / 2.0
    return make_prism([(-x, -y), (x, -y), (x, y), (-x, y)], bottom, top)


def revolve_profile(profile: ArrayLike, sides: int, radius_factors: FloatArray | None = None) -> SolidMesh:
    """Return the solid with ``sides`` sides that a profile (K, 2) of (radius, z) sweeps around the z axis.

    The profile runs counter-clockwise from the axis around to the axis. ``radius_factors`` (K, sides) multiply its
    radii.
    """
    radius, level = np.asarray(profile, dtype=np.float64).T
    radii = radius[:, None] * (np.ones((1, sides)) if radius_factors is None else radius_factors)
    unit = np.array(unit_circle(sides))
    rings = np.stack([radii * unit[:, 0], radii * unit[:, 1], np.repeat(level[:, None], sides, axis=1)], axis=-1)
    # A ring on the axis is a single vertex.
    counts = np.where(radius > 0.0, sides, 1)
    starts = np.cumsum(counts) - counts
    index = starts[:, None] + np.where(radius[:, None] > 0.0, np.arange(sides), 0)
    vertices = np.concatenate([ring[:count] for ring, count in zip(rings, counts.tolist(), strict=True)])
    return SolidMesh(vertices, _connect_rows(index))


def extrude_surface_down(top: FloatArray, faces: IntArray, bottom: float) -> SolidMesh:
    """Return the solid between a surface, given by its vertices (V, 3) and faces, and a level below it."""
    n = len(top)
    # Boundary edges are those that no face has in the opposite direction.
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    boundary = edges[~np.isin(edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0])]
    a, b = boundary.T
    below = np.column_stack([top[:, :2], np.full(n, bottom)])
    sides = [np.column_stack([b, a, a + n]), np.column_stack([b, a + n, b + n])]
    return SolidMesh(np.concatenate([top, below]), np.concatenate([faces, faces[:, ::-1] + n, *sides]))


def fill_between_loops(outer: Sequence[int], inner: Sequence[int], points: Sequence[Any]) -> list[tuple[int, int, int]]:
    """Return faces that fill the area between two loops of vertex indices, both counter-clockwise around one centre.

    ``points``: x, y, ... of each vertex. Each side of the inner loop is joined to the corner of the outer loop whose
    direction is closest to the side's, so the outer loop must be convex and much larger than the inner.
    """
    x = sum(points[i][0] for i in inner) / len(inner)
    y = sum(points[i][1] for i in inner) / len(inner)

    def closest_corner(i: int, j: int) -> int:
        u = points[i][0] + points[j][0] - 2.0 * x, points[i][1] + points[j][1] - 2.0 * y
        directions = [(points[k][0] - x, points[k][1] - y) for k in outer]
        cosines = [(u[0] * v[0] + u[1] * v[1]) / (v[0] * v[0] + v[1] * v[1]) ** 0.5 for v in directions]
        return cosines.index(max(cosines))

    # Join each side of the inner loop to a corner of the outer loop.
    sides = list(zip(inner, [*inner[1:], inner[0]], strict=True))
    corners = [closest_corner(i, j) for i, j in sides]
    faces = [(outer[corner], j, i) for (i, j), corner in zip(sides, corners, strict=True)]
    # Both loops have the same orientation: the outer sides between the corners of two successive inner sides are joined
    # to the vertex that the inner sides share.
    for k, (i, _) in enumerate(sides):
        corner = corners[k - 1]
        while corner != corners[k]:
            after = (corner + 1) % len(outer)
            faces.append((outer[corner], outer[after], i))
            corner = after
    return faces


def _connect_rows(index: IntArray) -> IntArray:
    """Return the faces (F, 3) between the rows of a table of vertex indices whose columns are cyclic."""
    following = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], following[:-1], following[1:], index[1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    first, second, third = faces.T
    return np.asarray(faces[(first != second) & (second != third) & (third != first)])


def _fan_faces(ring: IntArray) -> IntArray:
    return np.column_stack([np.full(len(ring) - 2, ring[0]), ring[1:-1], ring[2:]])
