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
    profile: Sequence[tuple[float, float]], radius: float, distances: FloatArray, mirrored: bool = False
) -> FloatArray:
    """Return the heights at distances along a polyline with rounded corners.

    A corner is rounded by a parabola that begins one radius before it and ends one radius behind it. The height of the
    rounded line is the mean of the polyline over [distance - radius, distance + radius], computed from its integral.
    """
    x, z = np.array(profile).T
    if mirrored:
        x = np.concatenate([-x[::-1], x])
        z = np.concatenate([z[::-1], z])
    if not radius:
        return np.asarray(np.interp(distances, x, z))
    # Extend the polyline by constant heights, and integrate it.
    x = np.concatenate([[x[0] - 3.0 * radius], x, [x[-1] + 3.0 * radius]])
    z = np.concatenate([z[:1], z, z[-1:]])
    total = np.concatenate([[0.0], np.cumsum(np.diff(x) * (z[1:] + z[:-1]) / 2.0)])
    distances = np.clip(distances, x[0] + radius, x[-1] - radius)
    exact = np.interp(distances, x, z)
    low, high = (
        np.clip(np.searchsorted(x, distances + offset, side="right") - 1, 0, len(x) - 2) for offset in (-radius, radius)
    )

    def integrate_to(segment: NDArray[np.int64], end: FloatArray) -> FloatArray:
        return np.asarray(total[segment] + (end - x[segment]) * (z[segment] + np.interp(end, x, z)) / 2.0)

    mean = (integrate_to(high, distances + radius) - integrate_to(low, distances - radius)) / (2.0 * radius)
    # Away from corners, return the polyline's exact height, so that level segments stay level.
    return np.asarray(np.where(low == high, exact, mean))


def build_terrain(area: ShapelyPolygon, height_at: HeightFunction, cell: tuple[float, float], bottom: float) -> Trimesh:
    """Return the closed solid over an area, from a level bottom up to a height function.

    The top is a grid of cells of two triangles each, with narrow triangles between the grid and the outline.

    Raises:
        CourseError: the ground is below the bottom.
    """
    # Triangulate the top and the bottom.
    area = shapely.segmentize(shapely.geometry.polygon.orient(area), min(cell))
    points, top_faces = _triangulate_grid(area, cell)
    bottom_points, bottom_faces = triangulate([area])
    z = height_at(points)
    if not z.min() > bottom:
        raise CourseError(
            f"heights: expected all above the bottom at {bottom:g} m, received {z.min():g} m; raise them."
        )
    # Connect both along each ring of the outline.
    rings = [np.array(ring.coords)[:-1] for ring in (area.exterior, *area.interiors)]
    corners = np.concatenate(rings)
    num_corners = len(corners)
    next_corner = np.concatenate([np.roll(np.arange(len(ring)), -1) for ring in rings])
    next_corner += np.repeat(np.cumsum([0] + [len(ring) for ring in rings[:-1]]), [len(ring) for ring in rings])
    upper = len(points) + np.arange(num_corners)
    next_upper = len(points) + next_corner
    lower = upper + num_corners
    next_lower = next_upper + num_corners
    sides = np.concatenate([np.c_[lower, next_upper, upper], np.c_[lower, next_lower, next_upper]])
    vertices = np.concatenate(
        [
            np.c_[points, z],
            np.c_[corners, height_at(corners)],
            np.c_[corners, np.full(num_corners, bottom)],
            np.c_[bottom_points, np.full(len(bottom_points), bottom)],
        ]
    )
    bottom_faces = bottom_faces[:, ::-1] + len(points) + 2 * num_corners
    return Trimesh(vertices, np.concatenate([top_faces, sides, bottom_faces]))


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
    column, row = (index.ravel() for index in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    is_inside = shapely.contains(inner, shapely.box(xs[column], ys[row], xs[column + 1], ys[row + 1]))
    is_cell = is_inside.reshape(columns, rows)
    column = column[is_inside]
    row = row[is_inside]
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    # Divide each cell into two triangles, along alternating diagonals, so that waves do not lean to one side.
    left_corner = column * (rows + 1) + row
    right_corner = (column + 1) * (rows + 1) + row
    quads = np.c_[left_corner, right_corner, right_corner + 1, left_corner + 1]
    is_odd = ((column + row) % 2 == 1)[:, None]
    first = np.where(is_odd, quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where(is_odd, quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
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
