"""Orientation of the shells of a mesh: its connected pieces, each of which a ball meets from one side."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from trimesh import Trimesh

from minigolf_env.courses.course import CourseError
from minigolf_env.physics import TriangleMesh

MAX_NESTED_SHELLS = 1000
"""Largest number of pairs of shells, one in the bounding box of the other."""

MAX_TESTED_CORNERS = 16
"""Largest number of a shell's corners that are tested to be within another shell."""

MIN_WINDING_INSIDE = 0.75
"""Smallest winding number of a shell around a point inside; on its surface it is a half."""


def orient_shells(mesh: Trimesh) -> Trimesh:
    """Return a mesh whose shells are wound outwards, and shells within a shell the other way: cavities.

    Winding within a shell is left as it is.

    Raises:
        CourseError: too many shells lie within each other.
    """
    corners = np.array(mesh.triangles)
    shells = _split_into_shells(mesh)
    if len(shells) == 1:
        return mesh if mesh.volume >= 0.0 else Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)
    depths = np.zeros(len(shells), np.int64)
    for inner, outer in _nested_boxes(corners, shells):
        depths[inner] += _contains(corners[shells[outer]], corners[shells[inner]])
    is_turned = np.zeros(len(corners), np.bool_)
    for rows, depth in zip(shells, depths, strict=True):
        a, b, c = np.moveaxis(corners[rows] - corners[rows[0], 0], 1, 0)
        volume = float(np.sum(a * np.cross(b, c)))
        is_turned[rows] = volume < 0.0 if depth % 2 == 0 else volume > 0.0
    if not is_turned.any():
        return mesh
    return Trimesh(mesh.vertices, np.where(is_turned[:, None], mesh.faces[:, ::-1], mesh.faces), process=False)


def _split_into_shells(mesh: Trimesh) -> list[NDArray[np.int64]]:
    """Return the rows of the faces of each shell; faces that share an edge are of one shell."""
    _, unique = np.unique(mesh.vertices, axis=0, return_inverse=True)
    joined = Trimesh(mesh.vertices, unique.reshape(-1)[mesh.faces], process=False)
    labels = _connected_components(joined.face_adjacency, len(mesh.faces))
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)


def _connected_components(edges: NDArray[np.int64], num_nodes: int) -> NDArray[np.int64]:
    """Return a label for each node of a graph (num_nodes,): nodes that edges (E, 2) connect have the same."""
    labels = np.arange(num_nodes)
    while True:
        # Give both ends of an edge, and all nodes of their labels, the smaller label.
        first, second = labels[edges].T
        smaller = labels.copy()
        np.minimum.at(smaller, first, second)
        np.minimum.at(smaller, second, first)
        smaller = smaller[smaller[labels]]
        if np.array_equal(smaller, labels):
            return labels
        labels = smaller


def _nested_boxes(corners: NDArray[np.float64], shells: list[NDArray[np.int64]]) -> Iterator[tuple[int, int]]:
    """Yield pairs of shells of which the first lies in the bounding box of the second."""
    lower = np.array([corners[rows].min(axis=(0, 1)) for rows in shells])
    upper = np.array([corners[rows].max(axis=(0, 1)) for rows in shells])
    boxes = shapely.box(*lower[:, :2].T, *upper[:, :2].T)
    tree = shapely.STRtree(boxes)
    count = 0
    for inner, box in enumerate(boxes):
        for outer in tree.query(box, predicate="within").tolist():
            count += outer != inner
            if count > MAX_NESTED_SHELLS:
                raise CourseError(
                    f"expected at most {MAX_NESTED_SHELLS} pieces of a mesh over or within each other, received more; "
                    "export them as objects of their own."
                )
            if lower[outer, 2] < lower[inner, 2] and upper[outer, 2] > upper[inner, 2]:
                yield inner, outer


def _contains(outer: NDArray[np.float64], inner: NDArray[np.float64]) -> bool:
    """Return whether a shell is within another: whether all of its corners are, or a number of them.

    Args:
        outer: (F, 3, 3) triangles.
        inner: (G, 3, 3) triangles.
    """
    solid = TriangleMesh(outer.reshape(-1, 3), np.arange(3 * len(outer)).reshape(-1, 3))
    corners = inner.reshape(-1, 3)
    tested = corners[:: max(1, len(corners) // MAX_TESTED_CORNERS)]
    return all(abs(float(solid.winding_number(corner[None])[0])) > MIN_WINDING_INSIDE for corner in tested)
