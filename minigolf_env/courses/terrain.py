"""Floors that are not level: a height for each place, as a closed solid of triangles."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from trimesh import Trimesh

from minigolf_env.courses.course import CourseError
from minigolf_env.courses.shapes import Along, Height, Radial, Waves
from minigolf_env.courses.solids import Outline

FloatArray = NDArray[np.float64]
HeightFunction = Callable[[FloatArray], FloatArray]


def height_function(level: float, heights: Sequence[Height]) -> HeightFunction:
    """Return z (N,) of places (N, 2), m: a level, and all heights added to it."""

    def height(places: FloatArray) -> FloatArray:
        z = np.full(len(places), level)
        for one in heights:
            z = z + _one_height(one, places)
        return z

    return height


def _one_height(height: Height, places: FloatArray) -> FloatArray:
    if isinstance(height, Radial):
        return _rounded(height.profile, height.rounding, np.hypot(*(places - height.at).T), mirrored=True)
    turn = math.radians(height.turn)
    along = (places - height.at) @ (math.cos(turn), math.sin(turn))
    if isinstance(height, Along):
        return _rounded(height.profile, height.rounding, along)
    return _waves(height, along, places)


def _waves(waves: Waves, along: FloatArray, places: FloatArray) -> FloatArray:
    z = waves.amplitude * np.sin(2.0 * math.pi * along / waves.length)
    for x, y, inner, outer in waves.level:
        share = np.clip((np.hypot(*(places - (x, y)).T) - inner) / (outer - inner), 0.0, 1.0)
        z = z * share**2 * (3.0 - 2.0 * share)
    return np.asarray(z)


def _rounded(
    profile: Sequence[tuple[float, float]], rounding: float, s: FloatArray, mirrored: bool = False
) -> FloatArray:
    """Return the height at s of a line through points whose corners are parabolas, ``rounding`` long to either side.

    It is the mean of the straight line over [s - rounding, s + rounding], from the line's integral.
    """
    x, z = np.array(profile).T
    if mirrored:
        x, z = np.concatenate([-x[::-1], x]), np.concatenate([z[::-1], z])
    if not rounding:
        return np.asarray(np.interp(s, x, z))
    x = np.concatenate([[x[0] - 3.0 * rounding], x, [x[-1] + 3.0 * rounding]])
    z = np.concatenate([z[:1], z, z[-1:]])
    total = np.concatenate([[0.0], np.cumsum(np.diff(x) * (z[1:] + z[:-1]) / 2.0)])
    s = np.clip(s, x[0] + rounding, x[-1] - rounding)
    straight = np.interp(s, x, z)
    low, high = (np.clip(np.searchsorted(x, s + r, side="right") - 1, 0, len(x) - 2) for r in (-rounding, rounding))

    def integral(k: NDArray[np.int64], at: FloatArray) -> FloatArray:
        return np.asarray(total[k] + (at - x[k]) * (z[k] + np.interp(at, x, z)) / 2.0)

    mean = (integral(high, s + rounding) - integral(low, s - rounding)) / (2.0 * rounding)
    # Away from corners the line itself, exactly: what is level stays level.
    return np.asarray(np.where(low == high, straight, mean))


def terrain(area: Outline, height: HeightFunction, cell: tuple[float, float], bottom: float) -> Trimesh:
    """Return the closed solid over an area, from a level bottom up to a height.

    The top is a grid of cells of two triangles each, and narrow triangles between it and the outline.

    Raises:
        CourseError: the ground is below the bottom.
    """
    area = shapely.segmentize(shapely.geometry.polygon.orient(area), min(cell))
    points, faces = _plan(area, cell)
    ring_points, under = triangulated([area])
    z = height(points)
    if not z.min() > bottom:
        raise CourseError(
            f"heights: expected all above the bottom at {bottom:g} m, received {z.min():g} m; raise them."
        )
    rings = [np.array(ring.coords)[:-1] for ring in (area.exterior, *area.interiors)]
    corners = np.concatenate(rings)
    n, m = len(corners), len(points)
    after = np.concatenate([np.roll(np.arange(len(ring)), -1) for ring in rings])
    after += np.repeat(np.cumsum([0] + [len(ring) for ring in rings[:-1]]), [len(ring) for ring in rings])
    k = np.arange(n)
    tops = m + k, m + after
    sides = np.concatenate([np.c_[m + n + k, tops[1], tops[0]], np.c_[m + n + k, m + n + after, tops[1]]])
    vertices = np.concatenate(
        [
            np.c_[points, z],
            np.c_[corners, height(corners)],
            np.c_[corners, np.full(n, bottom)],
            np.c_[ring_points, np.full(len(ring_points), bottom)],
        ]
    )
    return Trimesh(vertices, np.concatenate([faces, sides, under[:, ::-1] + m + 2 * n]))


def _plan(area: Outline, cell: tuple[float, float]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return vertices (V, 2) and counter-clockwise faces (F, 3) that cover an area with cells and a seam."""
    left, low, right, high = area.bounds
    columns, rows = math.ceil((right - left) / cell[0]), math.ceil((high - low) / cell[1])
    xs, ys = np.linspace(left, right, columns + 1), np.linspace(low, high, rows + 1)
    inner = area.buffer(-0.2 * min(cell))
    shapely.prepare(inner)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    inside = shapely.contains(inner, shapely.box(xs[i], ys[j], xs[i + 1], ys[j + 1]))
    cells = inside.reshape(columns, rows)
    i, j = i[inside], j[inside]
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    a, b = i * (rows + 1) + j, (i + 1) * (rows + 1) + j
    quads = np.c_[a, b, b + 1, a + 1]
    # One diagonal in every other cell, or waves would lean one way.
    odd = ((i + j) % 2 == 1)[:, None]
    first = np.where(odd, quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where(odd, quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    seam_points, seam = triangulated(_seam(area, points, quads, lambda x, y: cells[_cell(xs, x), _cell(ys, y)]))
    faces = np.concatenate([first, second, seam + len(points)])
    used, faces = np.unique(faces, return_inverse=True)
    return np.concatenate([points, seam_points])[used], faces.reshape(-1, 3)


def _cell(corners: FloatArray, places: FloatArray) -> NDArray[np.int64]:
    """Return which of the intervals between corners (C,) places (N,) are in."""
    return np.clip(np.searchsorted(corners, places) - 1, 0, len(corners) - 2)


def _seam(
    area: Outline,
    points: FloatArray,
    quads: NDArray[np.int64],
    is_cell: Callable[[FloatArray, FloatArray], NDArray[np.bool_]],
) -> list[Outline]:
    """Return the polygons between the cells and the area's outline, with all corners of both."""
    if not len(quads):
        return [area]
    edges = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])
    _, index, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    rim = shapely.linestrings(points[edges[index[count == 1]]])
    rings = [area.exterior, *area.interiors]
    outer = np.concatenate([np.array(ring.coords) for ring in rings])
    ends = np.cumsum([len(ring.coords) for ring in rings])[:-1] - 1
    pairs = np.delete(np.stack([outer[:-1], outer[1:]], axis=1), ends, axis=0)
    pieces = shapely.get_parts(shapely.polygonize([*rim, *shapely.linestrings(pairs)]))
    middle = shapely.point_on_surface(pieces)
    in_cells = is_cell(*shapely.get_coordinates(middle).T)
    return list(pieces[~in_cells & shapely.contains(area, middle)])


def triangulated(polygons: Sequence[Outline]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return vertices and counter-clockwise faces of polygons; every corner is used, those on straight lines too."""
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(list(polygons)))
    corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    a, b, c = np.moveaxis(corners, 1, 0)
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    corners[clockwise] = corners[clockwise][:, ::-1]
    points, faces = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return points, faces.reshape(-1, 3)
