"""Triangle meshes: vertices and faces are validated and converted here once."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from minigolf_env._validation import finite_array, quote, quote_unless_plain
from minigolf_env.physics.types import FloatArray, Surface

MAX_COORDINATE = 1e9
"""Largest coordinate accepted in a mesh, m: the tolerance of contacts is then 0.5 mm. ``sweep_sphere`` accepts
coordinates up to MAX_NUMBER, as its radius may be as large."""


class TriangleMesh:
    """A triangle mesh with a surface material.

    Faces are wound so that their normals (right-hand rule) point into the space where the ball moves: a box to bounce
    in has normals inwards, an obstacle outwards. A closed mesh is one-sided: it stops a ball that comes from its
    front. An open one is two-sided. Triangles without area are allowed and act as the segments or points they are.

    Args:
        vertices: (V, 3) finite coordinates, m.
        faces: (F, 3) integers, rows of ``vertices``; F >= 1.
        surface: material: the velocity kept by an impact, and the rolling resistance.
        two_sided: sides from which the mesh stops a ball.
            None: both, unless the mesh is closed and consistently wound.
            False: the front only; an error unless the mesh is closed and consistently wound.
            True: both. Required for a closed mesh of which a piece is inside out, or that crosses itself: this is not
                detected. Mesh parts of courses are oriented piece by piece.
        name: name of the mesh in error messages.

    Raises:
        ValueError: wrong shapes, values that are not finite, faces out of range, no faces, or an open mesh that is to
            be one-sided: a ball could get behind it.
    """

    vertices: FloatArray
    faces: NDArray[np.int64]
    surface: Surface
    two_sided: bool
    name: str

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        surface: Surface | None = None,
        two_sided: bool | None = None,
        name: str = "mesh",
    ) -> None:
        self.name = str(name)
        title = quote_unless_plain(self.name)
        self.vertices = _validated_vertices(vertices, title)
        self.faces = _validated_faces(faces, len(self.vertices), title)
        self.surface = Surface() if surface is None else surface
        if not isinstance(self.surface, Surface):
            raise ValueError(f"{title}: surface: expected a Surface, received {type(surface).__name__}.")
        self.two_sided = self._validated_two_sided(two_sided, title)

    @property
    def triangles(self) -> FloatArray:
        """The vertices of each face (F, 3, 3), m."""
        return self.vertices[self.faces]

    @property
    def is_closed(self) -> bool:
        """True if the mesh is closed and consistently wound: faces pass each edge equally often in both directions."""
        return not self._is_unpaired_edge().any()

    def _is_unpaired_edge(self) -> NDArray[np.bool_]:
        """Return whether each edge (3, F) of the faces is not passed equally often in both directions."""
        # Number the edges by their vertices, where vertices at the same place count as one.
        _, unique = np.unique(self.vertices, axis=0, return_inverse=True)
        faces = unique.reshape(-1)[self.faces]
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        keys = edges.min(axis=1) * len(self.vertices) + edges.max(axis=1)
        _, edge = np.unique(keys, return_inverse=True)

        # Sum the directions of each edge: 0 where they are paired.
        direction = np.sign(edges[:, 1] - edges[:, 0])
        is_unpaired: NDArray[np.bool_] = np.bincount(edge.reshape(-1), weights=direction)[edge.reshape(-1)] != 0.0
        return is_unpaired.reshape(3, -1)

    def unpaired_edge(self) -> FloatArray | None:
        """Return the ends (2, 3), m, of an edge at which the mesh is open or wound two ways; None if it is closed."""
        is_unpaired = self._is_unpaired_edge()
        if not is_unpaired.any():
            return None
        side, face = np.argwhere(is_unpaired)[0]
        corners: FloatArray = self.vertices[self.faces[face][[side, (side + 1) % 3]]]
        return corners

    def _validated_two_sided(self, two_sided: bool | None, title: str) -> bool:
        if two_sided not in (None, True, False):
            raise ValueError(f"{title}: two_sided: expected None, True or False, received {quote(two_sided)}.")
        if two_sided:
            return True
        has_unpaired = self._is_unpaired_edge().any(axis=0)
        if two_sided is not None and has_unpaired.any():
            face = int(has_unpaired.argmax())
            raise ValueError(
                f"{title}: two_sided: expected None or True for a mesh that is open or not wound one way, received "
                f"False; an edge of face {face}, {self.faces[face].tolist()}, lacks a neighbour that passes it the "
                "other way: close the mesh, wind its faces alike, or leave two_sided out."
            )
        return bool(has_unpaired.any())

    def winding_number(self, points: FloatArray) -> FloatArray:
        """Return the winding numbers (N,) of the mesh around points (N, 3).

        A closed mesh has 0 outside, and inside 1, or -1 if it is wound inwards. The number is the sum of the solid
        angles of the triangles (A. Van Oosterom and J. Strackee, "The solid angle of a plane triangle", IEEE
        Transactions on Biomedical Engineering 30, 1983), divided by 4 pi.
        """
        numbers = np.zeros(len(points))
        lower, upper = self._bounds
        # A closed mesh has 0 beyond its bounding box.
        is_near = ((lower <= points) & (points <= upper)).all(axis=1) | self.two_sided
        if is_near.any():
            # x, y, z first: sums over short last axes take several times as long.
            a, b, c = np.moveaxis(self.triangles, 0, 2)[..., None] - points[is_near].T[:, None]
            la, lb, lc = (np.sqrt(_dot(vertex, vertex)) for vertex in (a, b, c))
            cross = (b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0])
            denominator = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
            half_angles = np.arctan2(_dot(a, cross), denominator)
            numbers[is_near] = half_angles.sum(axis=0) / (2.0 * np.pi)
        return numbers

    @functools.cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        """The lower and the upper corner of the bounding box, m."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    @functools.cached_property
    def volume(self) -> float:
        """Volume that a closed mesh encloses, m^3; negative if wound inwards, as a room is."""
        a, b, c = np.moveaxis(self.triangles - self.vertices.mean(axis=0), 1, 0)
        return float(np.sum(a * np.cross(b, c)) / 6.0)

    def __repr__(self) -> str:
        """Return the size and the kind."""
        sides = "two-sided" if self.two_sided else "one-sided"
        return f"TriangleMesh({self.name!r}, {len(self.vertices)} vertices, {len(self.faces)} faces, {sides})"


def _dot(a: Sequence[FloatArray], b: Sequence[FloatArray]) -> FloatArray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _validated_vertices(vertices: ArrayLike, title: str) -> FloatArray:
    hint = "give one row (x, y, z) per vertex, in metres, near the origin."
    array = finite_array(vertices, (None, 3), f"{title}: vertices", hint, MAX_COORDINATE)
    array.flags.writeable = False
    return array


def _validated_faces(faces: ArrayLike, num_vertices: int, title: str) -> NDArray[np.int64]:
    try:
        raw = np.asarray(faces)
    except ValueError as error:
        raise ValueError(f"{title}: faces: expected shape (F, 3), received rows of different lengths.") from error
    if raw.ndim != 2 or raw.shape[1] != 3 or len(raw) == 0:
        raise ValueError(
            f"{title}: faces: expected shape (F, 3) with F >= 1, received {raw.shape}; "
            "give one row of three vertex numbers per triangle (split larger polygons)."
        )
    if not np.issubdtype(raw.dtype, np.integer):
        raise ValueError(f"{title}: faces: expected integers, received {raw.dtype}; faces number rows of vertices.")
    if raw.min() < 0 or raw.max() >= num_vertices:
        face = int(np.argwhere((raw < 0) | (raw >= num_vertices))[0, 0])
        raise ValueError(
            f"{title}: faces: expected vertex numbers 0 to {num_vertices - 1}, received {raw[face].tolist()} in "
            f"face {face}; vertices are counted from 0."
        )
    array = raw.astype(np.int64)
    array.flags.writeable = False
    return array
