"""Levels of the ground: a tee and a cup within rounding of a floor stand on it exactly."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

LEVEL_TOLERANCE = 1e-6
"""Largest difference of two levels that count as the same, m: coordinates in float32 are as far apart at 10 m."""

MIN_UPWARD_NORMAL = 0.5
"""Smallest z of the unit normal of a triangle that is ground."""

BARYCENTRIC_TOLERANCE = 1e-6
"""Distance beyond an edge of a triangle, as a fraction of its height, at which a point still counts as over it."""


def ground_level(triangles: NDArray[np.float64], x: float, y: float, z: float) -> float | None:
    """Return the level of the ground at a place if it is within LEVEL_TOLERANCE of z, else None.

    It is the highest corner of the triangle there, if the triangle is level, so that it has the bits of the mesh.

    Args:
        triangles: (F, 3, 3) corners of a mesh, m.
        x: m.
        y: m.
        z: m.
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    is_near = (triangles[:, :, 2].min(axis=1) <= z + LEVEL_TOLERANCE) & (
        triangles[:, :, 2].max(axis=1) >= z - LEVEL_TOLERANCE
    )
    is_near &= (triangles[:, :, :2].min(axis=1) <= (x, y)).all(axis=1) & (
        triangles[:, :, :2].max(axis=1) >= (x, y)
    ).all(axis=1)
    a, b, c = a[is_near], b[is_near], c[is_near]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    levels = []
    for p, q, r, normal, length in zip(a, b, c, normals, lengths, strict=True):
        if normal[2] <= MIN_UPWARD_NORMAL * length:
            continue
        # Find the barycentric coordinates of the place.
        u = ((r[0] - p[0]) * (p[1] - y) - (r[1] - p[1]) * (p[0] - x)) / normal[2]
        v = ((p[0] - x) * (q[1] - p[1]) - (p[1] - y) * (q[0] - p[0])) / normal[2]
        if min(u, v, 1.0 - u - v) < -BARYCENTRIC_TOLERANCE:
            continue
        is_level = max(p[2], q[2], r[2]) - min(p[2], q[2], r[2]) <= LEVEL_TOLERANCE
        level = max(p[2], q[2], r[2]) if is_level else p[2] + u * (q[2] - p[2]) + v * (r[2] - p[2])
        if abs(level - z) <= LEVEL_TOLERANCE:
            levels.append(float(level))
    return max(levels, default=None)


def snap_to_ground(meshes: Iterable[NDArray[np.float64]], places: Iterable[Sequence[float]], z: float) -> float:
    """Return the highest level of the ground at some places that is within LEVEL_TOLERANCE of z; without any, z."""
    triangles = list(meshes)
    found = [ground_level(mesh, x, y, z) for mesh in triangles for x, y in places]
    return max((level for level in found if level is not None), default=z)
