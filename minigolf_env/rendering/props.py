"""Everything that is drawn with a course but is not part of it: ball, flag, lawn, sun and sky. No OpenGL."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.course_geometry import VERTEX_DTYPE, IndexedMesh
from minigolf_env.rendering.lighting import LIGHTING

FloatArray = NDArray[np.float64]

SUN_DIRECTION = np.array(LIGHTING.sun_direction)
"""Unit vector (3,) to the sun."""

SKY_COLOR = (0.62, 0.72, 0.80)
"""sRGB colour of the sky and of the haze over the distant lawn."""

POLE_HEIGHT = 0.62
"""Height of the flag's pole, m."""

POLE_RADIUS = 0.006
"""Radius of the flag's pole, m."""

CLOTH_LENGTH = 0.26
"""Length of the flag's cloth, a pennant, m."""

CLOTH_WIDTH = 0.17
"""Width of the cloth at the pole, m."""

CLOTH_DIRECTION = np.array([-SUN_DIRECTION[1], SUN_DIRECTION[0]]) / np.hypot(SUN_DIRECTION[0], SUN_DIRECTION[1])
"""Unit vector (2,) along the cloth: at right angles to the sun, so that the cloth casts a shadow."""


def flag_rest_position(course: Course) -> FloatArray:
    """Return the foot (3,) of the pole when the flag stands in the cup, m; the origin without a cup."""
    if course.cup is None:
        return np.zeros(3)
    x, y, rim = course.cup.position
    return np.array([x, y, rim - course.cup.depth])


def sphere(num_rings: int, num_sides: int) -> IndexedMesh:
    """Return the unit sphere."""
    polar_angles = np.linspace(0.0, np.pi, num_rings + 1)
    azimuths = np.linspace(0.0, 2.0 * np.pi, num_sides + 1)
    polar, azimuth = np.meshgrid(polar_angles, azimuths, indexing="ij")
    points = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    return _grid_mesh(points, points)


def marker() -> IndexedMesh:
    """Return a square in the plane z = 0 with room for the unit disc and its blurred edge."""
    corners = 1.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    vertices = np.zeros(4, VERTEX_DTYPE)
    vertices["position"][:, :2] = corners
    vertices["normal"] = 0.0, 0.0, 1.0
    return vertices, np.array([0, 1, 2, 0, 2, 3], np.uint32)


def pole(num_sides: int = 10) -> IndexedMesh:
    """Return the flag's pole, which stands on the origin."""
    azimuth = np.linspace(0.0, 2.0 * np.pi, num_sides + 1)
    normals = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=-1)
    profile = np.array([(POLE_RADIUS, POLE_HEIGHT), (POLE_RADIUS, 0.0)])
    points = profile[:, None, :1] * normals + np.array([0.0, 0.0, 1.0]) * profile[:, None, 1:]
    return _grid_mesh(points, np.broadcast_to(normals, points.shape))


def cloth(direction: FloatArray, num_steps: int = 16) -> IndexedMesh:
    """Return the pennant, which waves from the top of the pole along a unit vector (2,)."""
    s = np.linspace(0.0, 1.0, num_steps + 1)
    wave = 0.035 * np.sin(5.5 * s) * s
    middle_height = POLE_HEIGHT - 0.5 * CLOTH_WIDTH
    along = np.append(direction, 0.0)
    across = np.array([-direction[1], direction[0], 0.0])
    spine = CLOTH_LENGTH * s[:, None] * along + wave[:, None] * across + np.array([0.0, 0.0, middle_height])
    half_width = 0.5 * CLOTH_WIDTH * (1.0 - s)[:, None] * np.array([0.0, 0.0, 1.0])
    points = np.stack([spine - half_width, spine + half_width])
    slope = np.gradient(wave, CLOTH_LENGTH * s)[:, None]
    normals = across - slope * along
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return _grid_mesh(points, np.stack([normals, normals]))


def lawn(covered: NDArray[np.bool_], lower: FloatArray, upper: FloatArray, margin: float) -> IndexedMesh:
    """Return the level ground under and around a bounding box, at the height of its lower corner.

    Args:
        covered: (rows along y, columns along x): cells of the box's base whose ground is hidden by the course.
        lower: lower corner (3,) of the box, m.
        upper: upper corner (3,) of the box, m.
        margin: how far the ground extends beyond the box, m.
    """
    # The base of the box without its covered cells, and the ring around it.
    rows, columns = covered.shape
    cell_size = (upper[:2] - lower[:2]) / (columns, rows)
    row, column = np.nonzero(covered)
    corners = lower[:2] + np.column_stack([column, row]) * cell_size
    base = shapely.box(*lower[:2], *upper[:2])
    uncovered = base - shapely.union_all(shapely.box(*corners.T, *(corners + cell_size).T))
    ring = shapely.box(*(lower[:2] - margin), *(upper[:2] + margin)) - base
    # Triangulated separately: one polygon would give long thin triangles, which cost more than their pixels.
    pieces = [trimesh.creation.triangulate_polygon(area, engine="earcut") for area in [*_polygons(uncovered), ring]]
    vertices = np.zeros(sum(len(points) for points, _ in pieces), VERTEX_DTYPE)
    vertices["position"][:, :2] = np.concatenate([points for points, _ in pieces])
    vertices["position"][:, 2] = lower[2]
    vertices["normal"] = 0.0, 0.0, 1.0
    first_vertices = np.cumsum([0] + [len(points) for points, _ in pieces[:-1]])
    faces = np.concatenate([faces + first for (_, faces), first in zip(pieces, first_vertices, strict=True)])
    # All faces counter-clockwise from above.
    a, b, c = np.moveaxis(vertices["position"][faces].astype(np.float64), 1, 0)
    is_clockwise = np.cross(b - a, c - a)[:, 2] < 0.0
    faces[is_clockwise] = faces[is_clockwise][:, ::-1]
    return vertices, faces.astype(np.uint32).reshape(-1)


def _polygons(area: Any) -> list[Any]:
    """Return the polygons of a shapely geometry."""
    return [piece for piece in getattr(area, "geoms", [area]) if piece.area > 0.0]


def _grid_mesh(points: FloatArray, normals: FloatArray) -> IndexedMesh:
    """Return the surface over a grid (M, N, 3) of points; its front faces along rows x columns of the grid."""
    rows, columns = points.shape[:2]
    vertices = np.zeros(rows * columns, VERTEX_DTYPE)
    vertices["position"] = points.reshape(-1, 3)
    vertices["normal"] = normals.reshape(-1, 3)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    indices = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1)
    return vertices, indices.astype(np.uint32)
