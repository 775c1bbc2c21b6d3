"""Orientation of the shells of a mesh: its connected pieces, each of which a ball meets from one side."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray
from trimesh import Trimesh

from minigolf_env.courses.course import CourseError
from minigolf_env.physics import TriangleMesh

MAX_SOLID_ANGLES = 100_000_000
"""Largest number of solid angles, of a triangle seen from a corner, that are computed to find shells within others."""

MAX_BOX_PAIRS = 20_000_000
"""Largest number of pairs of shells, of which one has its middle in the other's box, that are compared."""

MAX_SOLID_ANGLES_AT_ONCE = 50_000
"""Largest number of solid angles that are computed together, unless a shell alone has more."""

MAX_TESTED_CORNERS = 16
"""Largest number of a shell's corners that are tested to be within another shell."""

MIN_WINDING_INSIDE = 0.75
"""Smallest winding number of a shell around a point inside; on its surface it is a half."""

ANGLE_DECIMALS = 6
"""Decimals to which angles of faces around an edge are compared, rad: equal ones lie on each other."""


def orient_shells(mesh: Trimesh) -> Trimesh:
    """Return a mesh whose shells are wound outwards, and shells within a shell the other way: cavities.

    Winding within a shell is left as it is.

    Raises:
        CourseError: too many shells lie within each other.
    """
    corners = np.array(mesh.triangles)
    _, places = np.unique(mesh.vertices, axis=0, return_inverse=True)
    shells = _split_into_shells(corners, places.reshape(-1)[mesh.faces])
    depths = _count_enclosing_shells(corners, shells)
    is_turned = np.zeros(len(corners), np.bool_)
    for rows, depth in zip(shells, depths, strict=True):
        a, b, c = np.moveaxis(corners[rows] - corners[rows[0], 0], 1, 0)
        volume = float(np.sum(a * np.cross(b, c)))
        is_turned[rows] = volume < 0.0 if depth % 2 == 0 else volume > 0.0
    if not is_turned.any():
        return mesh
    return Trimesh(mesh.vertices, np.where(is_turned[:, None], mesh.faces[:, ::-1], mesh.faces), process=False)


def _split_into_shells(corners: NDArray[np.float64], places: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the rows of the faces of each shell.

    Two faces that share an edge are of one shell. Where more meet at an edge, because shells touch, each face is joined
    with the next around the edge that passes it the other way.

    Args:
        corners: (F, 3, 3) corners of the faces, m.
        places: (F, 3) numbers of the corners' places: corners at the same place have the same.
    """
    # Number the edges and count the sides of faces at each; side s of face f is number s * F + f.
    starts = places.T.reshape(-1)
    ends = np.roll(places, -1, axis=1).T.reshape(-1)
    keys = np.minimum(starts, ends) * (places.max() + 1) + np.maximum(starts, ends)
    _, edge, count = np.unique(keys, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    count[edge[starts == ends]] = 0  # No edge: both ends are at one place.
    order = np.argsort(edge, kind="stable")
    pairs = order[count[edge[order]] == 2].reshape(-1, 2) % len(places)
    labels = _connected_components(pairs, len(places))

    # Join faces at edges where shells touch.
    shared = order[count[edge[order]] > 2]
    if shared.size:
        is_forward = (starts < ends)[shared]
        around = _order_around_edges(shared, edge[shared], is_forward, corners, labels)
        joined = _match_directions((shared % len(places))[around], edge[shared][around], is_forward[around])
        labels = _connected_components(np.concatenate([pairs, joined]), len(places))
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)


def _order_around_edges(
    sides: NDArray[np.int64],
    edges: NDArray[np.int64],
    is_forward: NDArray[np.bool_],
    corners: NDArray[np.float64],
    labels: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Return the order (K,) of sides of faces by edge, and by angle around each edge.

    Faces that lie on each other are taken in the order of their labels along one normal, whatever edge they are seen
    from, so that the same faces are joined at all edges of the place where shells touch.

    Args:
        sides: (K,) numbers of the sides, those of an edge in a row.
        edges: (K,) numbers of their edges.
        is_forward: (K,) whether the sides pass their edges in the direction that angles are measured around.
        corners: (F, 3, 3) corners of the faces, m.
        labels: (F,) labels of the patches of faces that are joined already.
    """
    side, face = np.divmod(sides, len(corners))
    start = corners[face, (side + np.logical_not(is_forward)) % 3]
    axis = corners[face, (side + is_forward) % 3] - start
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    # Measure the angles from the first face of each edge. An arm and the direction ahead of it are equally long.
    arms = corners[face, (side + 2) % 3] - start
    arms -= (arms * axis).sum(axis=1)[:, None] * axis
    ahead = np.cross(axis, arms)
    _, first, group = np.unique(edges, return_index=True, return_inverse=True)
    origin = first[group.reshape(-1)]
    angles = np.arctan2((arms * ahead[origin]).sum(axis=1), (arms * arms[origin]).sum(axis=1))
    angles = np.round(angles, ANGLE_DECIMALS)
    angles[angles <= -round(np.pi, ANGLE_DECIMALS)] *= -1.0
    largest = np.abs(ahead).argmax(axis=1)
    towards = np.sign(ahead[np.arange(len(ahead)), largest]).astype(np.int64)
    return np.lexsort((towards * labels[face], angles, edges))


def _match_directions(
    faces: NDArray[np.int64], edges: NDArray[np.int64], is_forward: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return pairs (P, 2) of faces next to each other around an edge that pass it in opposite directions.

    The directions are matched as brackets are. All arrays are (K,), in the order around the edges.
    """
    pairs = []
    unmatched: list[tuple[int, int, bool]] = []
    for use in zip(faces.tolist(), edges.tolist(), is_forward.tolist(), strict=True):
        if unmatched and unmatched[-1][1] != use[1]:
            unmatched.clear()
        if unmatched and unmatched[-1][2] != use[2]:
            pairs.append((unmatched.pop()[0], use[0]))
        else:
            unmatched.append(use)
    return np.array(pairs, np.int64).reshape(-1, 2)


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


def _count_enclosing_shells(corners: NDArray[np.float64], shells: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Return for each shell the number of shells that it is within.

    Raises:
        CourseError: too many pairs of shells would have to be compared, or too many solid angles computed.
    """
    depths = np.zeros(len(shells), np.int64)
    num_solid_angles = 0
    sample_corners = functools.cache(lambda shell: _sample_corners(corners[shells[shell]]))
    for outer, inners in _nested_boxes(corners, shells):
        triangles = corners[shells[outer]]
        solid = TriangleMesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
        # Most shells that are outside have their first corner outside.
        for is_first in (True, False):
            tested = [corners[shells[inner][0], :1] if is_first else sample_corners(inner) for inner in inners]
            num_solid_angles += len(triangles) * sum(len(points) for points in tested)
            if num_solid_angles > MAX_SOLID_ANGLES:
                raise _too_many_pieces(len(shells))
            inside = _are_inside(solid, np.concatenate([np.empty((0, 3)), *tested]))
            bounds = np.cumsum([len(points) for points in tested])[:-1]
            inners = [inner for inner, each in zip(inners, np.split(inside, bounds), strict=True) if each.all()]
            if not inners:
                break
        depths[inners] += 1
    return depths


def _too_many_pieces(num_shells: int) -> CourseError:
    return CourseError(
        "expected a mesh of which few pieces lie within the boxes around others, received one of "
        f"{num_shells} pieces; export them as objects of their own, or simplify the large ones."
    )


def _sample_corners(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return several corners (N, 3) of a shell's triangles, m."""
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    return corners[:: -(-len(corners) // MAX_TESTED_CORNERS)]


def _are_inside(solid: TriangleMesh, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether points (N, 3) are within a solid, whichever way it is wound."""
    size = max(1, MAX_SOLID_ANGLES_AT_ONCE // len(solid.faces))
    numbers = [solid.winding_number(points[k : k + size]) for k in range(0, len(points), size)]
    return np.abs(np.concatenate(numbers)) > MIN_WINDING_INSIDE


def _nested_boxes(corners: NDArray[np.float64], shells: list[NDArray[np.int64]]) -> Iterator[tuple[int, list[int]]]:
    """Yield each shell in whose bounding box others lie, with the others.

    Raises:
        CourseError: too many pairs of shells would have to be compared.
    """
    lower = np.array([corners[rows].min(axis=(0, 1)) for rows in shells])
    upper = np.array([corners[rows].max(axis=(0, 1)) for rows in shells])
    middles = (lower + upper) / 2.0
    tree = shapely.STRtree(shapely.points(middles[:, :2]))
    boxes = shapely.box(*lower[:, :2].T, *upper[:, :2].T)
    num_pairs = 0
    for outer in np.flatnonzero((lower < upper).all(axis=1)).tolist():
        inside = tree.query(boxes[outer])
        num_pairs += len(inside)
        if num_pairs > MAX_BOX_PAIRS:
            raise _too_many_pieces(len(shells))
        is_nested = (lower[outer] < lower[inside]).all(axis=1) & (upper[inside] < upper[outer]).all(axis=1)
        if is_nested.any():
            yield outer, inside[is_nested].tolist()
