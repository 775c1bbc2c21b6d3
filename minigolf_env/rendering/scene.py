"""What is drawn of a course, as arrays for the graphics card: numpy only, no OpenGL."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course, Part

FloatArray = NDArray[np.float64]

CREASE = np.cos(np.radians(35.0))
"""Faces that meet at less than this angle are shaded as one smooth surface."""

FAN = 100
"""Faces around a vertex from which on it is the tip of a cone or the middle of a disc, and not smooth."""

CHUNK = 2048
"""Triangles drawn or left out together, about: what the camera does not see costs nothing."""

VERTEX = np.dtype([("position", "<f4", (3,)), ("normal", "<f4", (3,)), ("grain", "<f4", (3,))])
"""A vertex: m; unit vector; the direction of the wood's grain (zero for what has none)."""


class Chunk(NamedTuple):
    """A run of triangles of one material that lie close together."""

    material: str
    start: int
    """In the indices."""
    size: int
    """Of indices: three a triangle."""
    lower: FloatArray
    upper: FloatArray
    """Corners (3,) of the box around it, m."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The fixed things of a course, ready to be drawn."""

    vertices: NDArray[np.void]
    """(V,) of VERTEX."""
    indices: NDArray[np.uint32]
    """(3 F,): three vertices a triangle, counter-clockwise from where the ball is."""
    chunks: tuple[Chunk, ...]
    """In the order of materials."""
    lower: FloatArray
    upper: FloatArray
    """Corners (3,) of the box around everything, m."""


def build_scene(course: Course) -> Scene:
    """Return what is drawn of a course."""
    vertices, indices, chunks = [], [], []
    first_vertex = first_index = 0
    for part in sorted(course.parts, key=lambda part: part.material):
        corners = part_corners(part)
        for run in _runs(corners["position"]):
            unique, index = np.unique(corners[run].reshape(-1).view("V36"), return_inverse=True)
            points = unique.view(VERTEX)
            vertices.append(points)
            indices.append((index.reshape(-1) + first_vertex).astype(np.uint32))
            box = points["position"].astype(np.float64)
            chunks.append(Chunk(part.material, first_index, index.size, box.min(axis=0), box.max(axis=0)))
            first_vertex += len(points)
            first_index += index.size
    lower = np.min([chunk.lower for chunk in chunks], axis=0)
    upper = np.max([chunk.upper for chunk in chunks], axis=0)
    return Scene(np.concatenate(vertices), np.concatenate(indices), tuple(chunks), lower, upper)


def part_corners(part: Part) -> NDArray[np.void]:
    """Return a VERTEX for each corner (F, 3) of a part's faces that have an area."""
    faces, triangles = part.mesh.faces, part.mesh.triangles
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    solid = areas > 0.0
    faces, triangles, normals = faces[solid], triangles[solid], normals[solid] / areas[solid, None]
    corners = np.zeros((len(faces), 3), VERTEX)
    corners["position"] = triangles
    corners["normal"] = _smooth(faces, normals)
    if part.material == "wood":
        corners["grain"] = _grain(triangles)[:, None]
    return corners


def _smooth(faces: NDArray[np.int64], normals: FloatArray) -> FloatArray:
    """Return unit normals (F, 3, 3) of the corners: the mean of the faces around the vertex that meet gently."""
    corner = np.argsort(faces.reshape(-1), kind="stable")
    vertex = faces.reshape(-1)[corner]
    starts = np.flatnonzero(np.concatenate([[True], vertex[1:] != vertex[:-1]]))
    counts = np.diff(np.append(starts, len(vertex)))
    smooth = np.repeat(normals, 3, axis=0)
    starts, counts = starts[counts <= FAN], counts[counts <= FAN]
    # Every corner with every corner at the same vertex.
    many = np.repeat(counts, counts)
    one = np.repeat(corner[_ranges(starts, counts)], many)
    other = corner[_ranges(np.repeat(starts, counts), many)]
    n, m = normals[one // 3], normals[other // 3]
    gentle = np.sum(n * m, axis=1) >= CREASE
    total = np.stack([np.bincount(one, m[:, k] * gentle, faces.size) for k in range(3)], axis=-1)
    met = np.unique(one)
    smooth[met] = total[met] / np.linalg.norm(total[met], axis=1, keepdims=True)
    return smooth.reshape(-1, 3, 3)


def _ranges(starts: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return start, start + 1, ... of each range, one after another."""
    return np.arange(counts.sum()) + np.repeat(starts - np.cumsum(counts) + counts, counts)


def _grain(triangles: FloatArray) -> FloatArray:
    """Return the direction (F, 3) of each triangle's second longest edge: the long side of the board it is half of."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    second = np.argsort(np.linalg.norm(edges, axis=2), axis=1)[:, 1]
    edge = edges[np.arange(len(edges)), second]
    edge = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    # Boards that lie side by side need one sign.
    sign = np.where(edge @ np.array([1.0, 0.9, 0.8]) < 0.0, -1.0, 1.0)
    return np.asarray(np.round(edge * sign[:, None], 4))


def _runs(positions: FloatArray) -> list[NDArray[np.int64]]:
    """Return the rows of triangles (F, 3, 3) in groups of neighbours in plan, each of about CHUNK."""
    middles = positions.mean(axis=1)
    groups = [np.arange(len(middles))]
    done = []
    while groups:
        group = groups.pop()
        if len(group) <= CHUNK:
            done.append(group)
            continue
        axis = int(np.argmax(np.ptp(middles[group, :2], axis=0)))
        ordered = group[np.argsort(middles[group, axis], kind="stable")]
        groups += [ordered[len(ordered) // 2 :], ordered[: len(ordered) // 2]]
    return done
