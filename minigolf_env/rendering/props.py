"""The things that belong to no course: ball, flag and the lawn around. Numpy only."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from minigolf_env.rendering.scene import VERTEX

FloatArray = NDArray[np.float64]
Mesh = tuple[NDArray[np.void], NDArray[np.uint32]]
"""Vertices (V,) of VERTEX and indices (3 F,)."""

POLE_HEIGHT, POLE_RADIUS = 0.62, 0.006
"""m."""

CLOTH_LENGTH, CLOTH_WIDTH = 0.26, 0.17
"""Of the pennant, m."""


def sphere(rings: int, sides: int) -> Mesh:
    """Return the unit sphere."""
    polar, turn = np.linspace(0.0, np.pi, rings + 1), np.linspace(0.0, 2.0 * np.pi, sides + 1)
    p, t = np.meshgrid(polar, turn, indexing="ij")
    points = np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], axis=-1)
    return _grid(points, points)


def pole(sides: int = 10) -> Mesh:
    """Return the flag's pole, standing on the origin."""
    turn = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    round_ = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=-1)
    profile = np.array([(POLE_RADIUS, POLE_HEIGHT), (POLE_RADIUS, 0.0)])
    points = profile[:, None, :1] * round_ + np.array([0.0, 0.0, 1.0]) * profile[:, None, 1:]
    return _grid(points, np.broadcast_to(round_, points.shape))


def cloth(direction: FloatArray, steps: int = 16) -> Mesh:
    """Return the pennant, waving from the top of the pole along a unit vector (2,)."""
    s = np.linspace(0.0, 1.0, steps + 1)
    wave = 0.035 * np.sin(5.5 * s) * s
    middle = POLE_HEIGHT - 0.5 * CLOTH_WIDTH
    along = np.append(direction, 0.0)
    across = np.array([-direction[1], direction[0], 0.0])
    spine = CLOTH_LENGTH * s[:, None] * along + wave[:, None] * across + np.array([0.0, 0.0, middle])
    half = 0.5 * CLOTH_WIDTH * (1.0 - s)[:, None] * np.array([0.0, 0.0, 1.0])
    points = np.stack([spine - half, spine + half])
    slope = np.gradient(wave, CLOTH_LENGTH * s)[:, None]
    normals = across - slope * along
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return _grid(points, np.stack([normals, normals]))


def lawn(covered: NDArray[np.bool_], lower: FloatArray, upper: FloatArray, reach: float) -> Mesh:
    """Return the level ground around a box in plan, at the height of its lower corner.

    Args:
        covered: (rows along y, columns along x): the cells of the box where something lies on the ground and hides it.
        lower: (3,) corner of the box, m.
        upper: (3,) the other, m.
        reach: how far the ground goes on around it, m.
    """
    rows, columns = covered.shape
    size = (upper[:2] - lower[:2]) / (columns, rows)
    row, column = np.nonzero(covered)
    corners = lower[:2] + np.column_stack([column, row]) * size
    site = shapely.box(*lower[:2], *upper[:2])
    free = site - shapely.union_all(shapely.box(*corners.T, *(corners + size).T))
    around = shapely.box(*(lower[:2] - reach), *(upper[:2] + reach)) - site
    # Triangulated apart: slivers from afar to every corner of the course would cost more than the pixels they fill.
    pieces = [trimesh.creation.triangulate_polygon(area, engine="earcut") for area in [*_polygons(free), around]]
    vertices = np.zeros(sum(len(points) for points, _ in pieces), VERTEX)
    vertices["position"][:, :2] = np.concatenate([points for points, _ in pieces])
    vertices["position"][:, 2] = lower[2]
    vertices["normal"] = 0.0, 0.0, 1.0
    firsts = np.cumsum([0] + [len(points) for points, _ in pieces[:-1]])
    faces = np.concatenate([faces + first for (_, faces), first in zip(pieces, firsts, strict=True)])
    a, b, c = np.moveaxis(vertices["position"][faces].astype(np.float64), 1, 0)
    clockwise = np.cross(b - a, c - a)[:, 2] < 0.0
    faces[clockwise] = faces[clockwise][:, ::-1]
    return vertices, faces.astype(np.uint32).reshape(-1)


def _polygons(area: Any) -> list[Any]:
    """Return the polygons that a shapely geometry consists of."""
    return [piece for piece in getattr(area, "geoms", [area]) if piece.area > 0.0]


def _grid(points: FloatArray, normals: FloatArray) -> Mesh:
    """Return the surface over a grid (M, N, 3) of points; its front is where rows x columns of the grid look."""
    rows, columns = points.shape[:2]
    vertices = np.zeros(rows * columns, VERTEX)
    vertices["position"], vertices["normal"] = points.reshape(-1, 3), normals.reshape(-1, 3)
    k = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]
    indices = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1)
    return vertices, indices.astype(np.uint32)
