"""Floors that are not level: closed solids of triangles whose top follows a height function."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from trimesh import Trimesh

from minigolf_env.courses.course import CourseError
from minigolf_env.courses.geometry.solids import ShapelyPolygon
from minigolf_env.courses.schema.heights import AnyHeight, DirectionalHeight, RadialHeight, WaveHeight

FloatArray = NDArray[np.float64]
HeightFunction = Callable[[FloatArray], FloatArray]


def make_height_function(level: float, heights: Sequence[AnyHeight]) -> HeightFunction:
    """Return the function that maps points (N, 2) to z (N,), m: a level plus all heights."""

    def height_at(points: FloatArray) -> FloatArray:
        z = np.full(len(points), level)
        for height in heights:
            z = z + _evaluate_height(height, points)
        return z

    return height_at


def _evaluate_height(height: AnyHeight, points: FloatArray) -> FloatArray:
    if isinstance(height, RadialHeight):
        return _evaluate_profile(height.profile, height.rounding, np.hypot(*(points - height.at).T), mirrored=True)
    angle = math.radians(height.turn)
    distance = (points - height.at) @ (math.cos(angle), math.sin(angle))
    if isinstance(height, DirectionalHeight):
        return _evaluate_profile(height.profile, height.rounding, distance)
    return _evaluate_waves(height, distance, points)


def _evaluate_waves(waves: WaveHeight, distance: FloatArray, points: FloatArray) -> FloatArray:
    z = waves.amplitude * np.sin(2.0 * math.pi * distance / waves.length)
    for x, y, inner, outer in waves.level:
        fraction = np.clip((np.hypot(*(points - (x, y)).T) - inner) / (outer - inner), 0.0, 1.0)
        z = z * fraction**2 * (3.0 - 2.0 * fraction)
    return np.asarray(z)


def _evaluate_profile(
    profile: Sequence[tuple[float, float]], rounding: float, s: FloatArray, mirrored: bool = False
) -> FloatArray:
    """Return the height at distances s of a polyline whose corners are parabolas, ``rounding`` long to either side.

    The rounded line is the mean of the polyline over [s - rounding, s + rounding], computed from its integral.
    """
    x, z = np.array(profile).T
    if mirrored:
        x = np.concatenate([-x[::-1], x])
        z = np.concatenate([z[::-1], z])
    if not rounding:
        return np.asarray(np.interp(s, x, z))
    # Extend the polyline by constant heights, and integrate it.
    x = np.concatenate([[x[0] - 3.0 * rounding], x, [x[-1] + 3.0 * rounding]])
    z = np.concatenate([z[:1], z, z[-1:]])
    total = np.concatenate([[0.0], np.cumsum(np.diff(x) * (z[1:] + z[:-1]) / 2.0)])
    s = np.clip(s, x[0] + rounding, x[-1] - rounding)
    unrounded = np.interp(s, x, z)
    low, high = (np.clip(np.searchsorted(x, s + r, side="right") - 1, 0, len(x) - 2) for r in (-rounding, rounding))

    def integrate_to(k: NDArray[np.int64], at: FloatArray) -> FloatArray:
        return np.asarray(total[k] + (at - x[k]) * (z[k] + np.interp(at, x, z)) / 2.0)

    mean = (integrate_to(high, s + rounding) - integrate_to(low, s - rounding)) / (2.0 * rounding)
    # Away from corners, take the polyline exactly: what is level stays level.
    return np.asarray(np.where(low == high, unrounded, mean))


def build_terrain(area: ShapelyPolygon, height_at: HeightFunction, cell: tuple[float, float], bottom: float) -> Trimesh:
    """Return the closed solid over an area, from a level bottom up to a height function.

    The top is a grid of cells of two triangles each, with narrow triangles between the grid and the outline.

    Raises:
        CourseError: the ground is below the bottom.
    """
    # Triangulate the top and the bottom.
    area = shapely.segmentize(shapely.geometry.polygon.orient(area), min(cell))
    points, faces = _triangulate_grid(area, cell)
    ring_points, under = triangulate([area])
    z = height_at(points)
    if not z.min() > bottom:
        raise CourseError(
            f"heights: expected all above the bottom at {bottom:g} m, received {z.min():g} m; raise them."
        )
    # Connect both along each ring of the outline.
    rings = [np.array(ring.coords)[:-1] for ring in (area.exterior, *area.interiors)]
    corners = np.concatenate(rings)
    n = len(corners)
    m = len(points)
    after = np.concatenate([np.roll(np.arange(len(ring)), -1) for ring in rings])
    after += np.repeat(np.cumsum([0] + [len(ring) for ring in rings[:-1]]), [len(ring) for ring in rings])
    k = np.arange(n)
    sides = np.concatenate([np.c_[m + n + k, m + after, m + k], np.c_[m + n + k, m + n + after, m + after]])
    vertices = np.concatenate(
        [
            np.c_[points, z],
            np.c_[corners, height_at(corners)],
            np.c_[corners, np.full(n, bottom)],
            np.c_[ring_points, np.full(len(ring_points), bottom)],
        ]
    )
    return Trimesh(vertices, np.concatenate([faces, sides, under[:, ::-1] + m + 2 * n]))


def _triangulate_grid(area: ShapelyPolygon, cell: tuple[float, float]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return vertices (V, 2) and counter-clockwise faces (F, 3) of an area: cells of a grid, and a seam around them."""
    # Find the cells that lie inside the area.
    left, low, right, high = area.bounds
    columns = math.ceil((right - left) / cell[0])
    rows = math.ceil((high - low) / cell[1])
    xs = np.linspace(left, right, columns + 1)
    ys = np.linspace(low, high, rows + 1)
    inner = area.buffer(-0.2 * min(cell))
    shapely.prepare(inner)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    inside = shapely.contains(inner, shapely.box(xs[i], ys[j], xs[i + 1], ys[j + 1]))
    is_cell = inside.reshape(columns, rows)
    i, j = i[inside], j[inside]
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    # Divide each cell into two triangles, along alternating diagonals, so that waves do not lean to one side.
    a = i * (rows + 1) + j
    b = (i + 1) * (rows + 1) + j
    quads = np.c_[a, b, b + 1, a + 1]
    odd = ((i + j) % 2 == 1)[:, None]
    first = np.where(odd, quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where(odd, quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    # Fill the seam between the cells and the outline.
    seam_polygons = _build_seam(
        area, points, quads, lambda x, y: is_cell[_interval_index(xs, x), _interval_index(ys, y)]
    )
    seam_points, seam = triangulate(seam_polygons)
    faces = np.concatenate([first, second, seam + len(points)])
    used, faces = np.unique(faces, return_inverse=True)
    return np.concatenate([points, seam_points])[used], faces.reshape(-1, 3)


def _interval_index(corners: FloatArray, values: FloatArray) -> NDArray[np.int64]:
    """Return the index (N,) of the interval between corners (C,) that contains each of the values (N,)."""
    return np.clip(np.searchsorted(corners, values) - 1, 0, len(corners) - 2)


def _build_seam(
    area: ShapelyPolygon,
    points: FloatArray,
    quads: NDArray[np.int64],
    is_in_cell: Callable[[FloatArray, FloatArray], NDArray[np.bool_]],
) -> list[ShapelyPolygon]:
    """Return the polygons between the cells and the area's outline, with all corners of both."""
    if not len(quads):
        return [area]
    # Collect the edges that bound the cells, and those of the area's outline.
    edges = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])
    _, index, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    cell_edges = shapely.linestrings(points[edges[index[count == 1]]])
    rings = [area.exterior, *area.interiors]
    outer = np.concatenate([np.array(ring.coords) for ring in rings])
    ends = np.cumsum([len(ring.coords) for ring in rings])[:-1] - 1
    outer_edges = np.delete(np.stack([outer[:-1], outer[1:]], axis=1), ends, axis=0)
    # Keep the faces of this planar graph that are inside the area and outside the cells.
    pieces = shapely.get_parts(shapely.polygonize([*cell_edges, *shapely.linestrings(outer_edges)]))
    inner_points = shapely.point_on_surface(pieces)
    in_cells = is_in_cell(*shapely.get_coordinates(inner_points).T)
    return list(pieces[~in_cells & shapely.contains(area, inner_points)])


def triangulate(polygons: Sequence[ShapelyPolygon]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return vertices and counter-clockwise faces of polygons; every corner is used, also those on straight edges."""
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(list(polygons)))
    corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    a, b, c = np.moveaxis(corners, 1, 0)
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    corners[clockwise] = corners[clockwise][:, ::-1]
    points, faces = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return points, faces.reshape(-1, 3)
