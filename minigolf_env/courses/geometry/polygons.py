"""Triangulation of polygons in space, as mesh files hold them: concave ones, and with corners on straight edges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from minigolf_env._validation import quote
from minigolf_env.courses.course import CourseError

AREA_TOLERANCE = 1e-6
"""Largest difference of the areas of a polygon and its triangles, as a fraction; beyond it the edges cross."""


def triangulate_polygons(
    vertices: NDArray[np.float64], polygons: Sequence[Sequence[int]], lines: Sequence[int] | None = None
) -> NDArray[np.int64]:
    """Return triangles (F, 3) of polygons that use all of their corners, so that they fit the neighbours' edges.

    A polygon that is not flat is triangulated as it appears along its mean normal.

    Args:
        vertices: (V, 3) vertices, m.
        polygons: rows of ``vertices``, at least three for each polygon.
        lines: number of the line of each polygon in its file, for error messages.

    Raises:
        CourseError: a polygon crosses itself.
    """
    faces: list[NDArray[np.int64]] = []
    for number, polygon in enumerate(polygons):
        corners = np.asarray(polygon, np.int64)
        if len(corners) > 3:
            triangles = _triangulate_polygon(vertices[corners])
            if triangles is None:
                where = f"line {lines[number]}" if lines is not None else f"face {number}"
                raise CourseError(
                    f"{where}: expected a polygon whose edges do not cross, received corners "
                    f"{quote(corners.tolist())}; triangulate the mesh before you export it."
                )
            faces.append(corners[triangles])
        else:
            faces.append(corners[None])
    return np.concatenate(faces) if faces else np.empty((0, 3), np.int64)


def _triangulate_polygon(corners: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """Return triangles (N - 2 or fewer, 3) of a polygon (N, 3); None if it crosses itself."""
    n = len(corners)
    fan = np.array([(0, k, k + 1) for k in range(1, n - 1)])
    relative = corners - corners[0]
    normals = np.cross(relative[fan[:, 1]], relative[fan[:, 2]])
    normal = normals.sum(axis=0)
    area = float(np.linalg.norm(normal))
    if area == 0.0:  # All corners on one line, or edges that cross.
        return None if normals.any() else fan
    # A fan is right for a convex polygon; a corner on an edge or a repeated corner gives a triangle without area.
    if (normals @ normal >= 0.0).all():
        return fan
    # Project the polygon along its normal, and match the corners of the triangles by their places.
    axis = np.eye(3)[np.abs(normal).argmin()]
    u = np.cross(normal, axis)
    v = np.cross(normal, u) / area
    flat = np.c_[relative @ u, relative @ v] / np.linalg.norm(u)
    ring = flat[(flat != np.roll(flat, 1, axis=0)).any(axis=1)]  # Without repeated corners.
    try:
        pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(ring)))
    except (ValueError, shapely.errors.ShapelyError):
        return None
    places = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    rows = {tuple(place): row for row, place in reversed(list(enumerate(flat.tolist())))}
    triangles = np.array([rows[tuple(place)] for place in places.reshape(-1, 2).tolist()], np.int64).reshape(-1, 3)
    # Wind the triangles as the polygon.
    crosses = np.cross(
        relative[triangles[:, 1]] - relative[triangles[:, 0]], relative[triangles[:, 2]] - relative[triangles[:, 0]]
    )
    heights = crosses @ normal / area
    triangles[heights < 0.0] = triangles[heights < 0.0][:, ::-1]
    is_covered = abs(np.abs(heights).sum() - area) <= AREA_TOLERANCE * area
    return triangles if is_covered else None
