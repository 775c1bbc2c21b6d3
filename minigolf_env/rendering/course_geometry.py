"""The fixed geometry of a course as vertex and index arrays for the graphics card. Numpy only, no OpenGL.

Each part of the course becomes triangles with smooth normals, split into chunks of neighbouring triangles, so that the
renderer skips chunks outside of the view.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course, Part

FloatArray = NDArray[np.float64]
IndexedMesh = tuple[NDArray[np.void], NDArray[np.uint32]]
"""Vertices (V,) of VERTEX_DTYPE, and indices (3 F,)."""

MIN_SMOOTH_COSINE = np.cos(np.radians(35.0))
"""Cosine of 35 degrees, the angle between normals below which faces are shaded as one smooth surface."""

MAX_SMOOTH_FACES = 100
"""Largest number of faces at a smooth vertex; one with more is the tip of a cone or the centre of a disc."""

MAX_CHUNK_TRIANGLES = 2048
"""Number of triangles that are drawn or culled together; more chunks cull better and take more draw calls."""

VERTEX_DTYPE = np.dtype(
    [
        ("position", "<f4", (3,)),  # m
        ("normal", "<f4", (3,)),  # unit vector
        ("grain", "<f4", (3,)),  # direction of the wood's grain; zero for other materials
    ]
)
"""A vertex as the vertex shader surface.vert reads it."""


class Chunk(NamedTuple):
    """Consecutive triangles of one material and colour that are close together."""

    material: str
    """Name of the material."""
    color: tuple[float, float, float] | None
    """Tint of the material, sRGB; None: its own colour."""
    start: int
    """Position of the first index."""
    size: int
    """Number of indices, three per triangle."""
    lower: FloatArray
    """Lower corner (3,) of the bounding box, m."""
    upper: FloatArray
    """Upper corner (3,) of the bounding box, m."""


@dataclass(frozen=True, eq=False)
class CourseGeometry:
    """Vertex arrays of a course."""

    vertices: NDArray[np.void]
    """Vertices (V,) of VERTEX_DTYPE."""
    indices: NDArray[np.uint32]
    """Indices (3 F,), three per triangle, counter-clockwise from the side where the ball is."""
    chunks: tuple[Chunk, ...]
    """Runs of indices, ordered by material."""
    lower: FloatArray
    """Lower corner (3,) of the bounding box, m."""
    upper: FloatArray
    """Upper corner (3,) of the bounding box, m."""


def build_course_geometry(course: Course) -> CourseGeometry:
    """Build the vertex arrays of a course."""
    vertices = []
    indices = []
    chunks = []
    first_vertex = 0
    first_index = 0
    for part in sorted(course.parts, key=lambda part: (part.material, part.color or ())):
        corners = part_corners(part)
        for rows in _split_into_chunks(corners["position"]):
            # Equal corners share a vertex.
            unique, index = np.unique(corners[rows].reshape(-1).view("V36"), return_inverse=True)
            points = unique.view(VERTEX_DTYPE)
            vertices.append(points)
            indices.append((index.reshape(-1) + first_vertex).astype(np.uint32))
            position = points["position"].astype(np.float64)
            lower, upper = position.min(axis=0), position.max(axis=0)
            chunks.append(Chunk(part.material, part.color, first_index, index.size, lower, upper))
            first_vertex += len(points)
            first_index += index.size
    lower = np.min([chunk.lower for chunk in chunks], axis=0)
    upper = np.max([chunk.upper for chunk in chunks], axis=0)
    return CourseGeometry(np.concatenate(vertices), np.concatenate(indices), tuple(chunks), lower, upper)


def part_corners(part: Part) -> NDArray[np.void]:
    """Return a vertex of VERTEX_DTYPE for each corner (F, 3) of a part's faces; faces without area are left out."""
    triangles = part.mesh.triangles
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    has_area = areas > 0.0
    faces = part.mesh.faces[has_area]
    triangles = triangles[has_area]
    normals = normals[has_area] / areas[has_area, None]
    corners = np.zeros((len(faces), 3), VERTEX_DTYPE)
    corners["position"] = triangles
    corners["normal"] = _smooth_normals(faces, normals)
    if part.material == "wood":
        corners["grain"] = _grain_directions(triangles)[:, None]
    return corners


def _smooth_normals(faces: NDArray[np.int64], normals: FloatArray) -> FloatArray:
    """Return unit normals (F, 3, 3) of the corners: means over the faces at the vertex that meet at small angles."""
    # Sort the corners by vertex: each vertex has a run of corners.
    sorted_corners = np.argsort(faces.reshape(-1), kind="stable")
    vertex = faces.reshape(-1)[sorted_corners]
    starts = np.flatnonzero(np.concatenate([[True], vertex[1:] != vertex[:-1]]))
    counts = np.diff(np.append(starts, len(vertex)))
    smooth = np.repeat(normals, 3, axis=0)
    is_smooth = counts <= MAX_SMOOTH_FACES
    starts = starts[is_smooth]
    counts = counts[is_smooth]
    # Pair every corner with every corner at the same vertex.
    num_partners = np.repeat(counts, counts)
    corner = np.repeat(sorted_corners[_concatenated_ranges(starts, counts)], num_partners)
    partner = sorted_corners[_concatenated_ranges(np.repeat(starts, counts), num_partners)]
    # Average the normals of the partners' faces that meet the corner's face at a small angle.
    corner_normals = normals[corner // 3]
    partner_normals = normals[partner // 3]
    is_gentle = np.sum(corner_normals * partner_normals, axis=1) >= MIN_SMOOTH_COSINE
    sums = [np.bincount(corner, partner_normals[:, k] * is_gentle, faces.size) for k in range(3)]
    total = np.stack(sums, axis=-1)
    smoothed = np.unique(corner)
    smooth[smoothed] = total[smoothed] / np.linalg.norm(total[smoothed], axis=1, keepdims=True)
    return smooth.reshape(-1, 3, 3)


def _concatenated_ranges(starts: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return start, start + 1, ... of each range, one after another."""
    return np.arange(counts.sum()) + np.repeat(starts - np.cumsum(counts) + counts, counts)


def _grain_directions(triangles: FloatArray) -> FloatArray:
    """Return the direction (F, 3) of each triangle's second longest edge: the long side of its rectangle."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    second_longest = np.argsort(np.linalg.norm(edges, axis=2), axis=1)[:, 1]
    edge = edges[np.arange(len(edges)), second_longest]
    edge = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    # Edges point either way round a triangle: give all edges of a direction the same sign.
    sign = np.where(edge @ np.array([1.0, 0.9, 0.8]) < 0.0, -1.0, 1.0)
    return np.asarray(np.round(edge * sign[:, None], 4))


def _split_into_chunks(positions: FloatArray) -> list[NDArray[np.int64]]:
    """Return the rows of triangles (F, 3, 3) in groups of at most MAX_CHUNK_TRIANGLES that are close in the xy-plane.

    Groups are halved at the median of their longer side.
    """
    centers = positions.mean(axis=1)
    groups = [np.arange(len(centers))]
    chunks = []
    while groups:
        group = groups.pop()
        if len(group) <= MAX_CHUNK_TRIANGLES:
            chunks.append(group)
            continue
        axis = int(np.argmax(np.ptp(centers[group, :2], axis=0)))
        ordered = group[np.argsort(centers[group, axis], kind="stable")]
        groups += [ordered[len(ordered) // 2 :], ordered[: len(ordered) // 2]]
    return chunks
