"""Rooms and bodies that the tests share: (vertices, faces), wound with outward normals unless stated otherwise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from minigolf_env.physics import Surface, TriangleMesh, World

FloatArray = NDArray[np.float64]
Body = tuple[FloatArray, NDArray[np.int64]]

G = 9.81
BALL_RADIUS = 0.02135
"""Radius of a golf ball, m."""

_BOX_FACES = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]]
_BOX_FACES += [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]


def box(lower: ArrayLike, upper: ArrayLike) -> Body:
    """Return an axis-parallel box."""
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    return low + corners * (high - low), np.array(_BOX_FACES)


def inside_out(body: Body) -> Body:
    """Return the body with reversed winding: a room."""
    return body[0], body[1][:, ::-1].copy()


def room(size: float = 2.0) -> Body:
    """Return a cubic room around the z axis with its floor at z = 0 and inward normals."""
    return inside_out(box([-size / 2, -size / 2, 0.0], [size / 2, size / 2, size]))


def tetrahedron(centre: ArrayLike, size: float) -> Body:
    """Return a regular tetrahedron in a sphere of radius size."""
    corners = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) * (size / math.sqrt(3))
    return np.asarray(centre, float) + corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def sphere(centre: ArrayLike, radius: float, slices: int = 12, stacks: int = 8) -> Body:
    """Return a UV sphere."""
    rings = [math.pi * k / stacks for k in range(1, stacks)]
    angles = [2 * math.pi * k / slices for k in range(slices)]
    ring = [[math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a)] for a in rings for b in angles]
    vertices = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], *ring])
    faces = []
    for k in range(slices):
        left, right = 2 + k, 2 + (k + 1) % slices
        faces.append([0, left, right])
        for i in range(stacks - 2):
            up = i * slices
            down = (i + 1) * slices
            faces += [[left + up, left + down, right + down], [left + up, right + down, right + up]]
        faces.append([1, right + (stacks - 2) * slices, left + (stacks - 2) * slices])
    return np.asarray(centre, float) + radius * vertices, np.array(faces)


def cone(base_center: ArrayLike, radius: float, height: float, slices: int = 9) -> Body:
    """Return a cone with the centre of its base at ``base_center``; with a small radius a needle."""
    angles = [2 * math.pi * k / slices for k in range(slices)]
    ring = [[radius * math.cos(a), radius * math.sin(a), 0.0] for a in angles]
    vertices = np.array([[0.0, 0.0, height], [0.0, 0.0, 0.0], *ring])
    sides = [[2 + k, 2 + (k + 1) % slices, 0] for k in range(slices)]
    base = [[2 + (k + 1) % slices, 2 + k, 1] for k in range(slices)]
    return np.asarray(base_center, float) + vertices, np.array(sides + base)


def torus(centre: ArrayLike, ring: float, tube: float, slices: int = 12, sides: int = 8) -> Body:
    """Return a torus around the z axis: a circle of radius ``tube`` swept along one of radius ``ring``."""
    a, b = np.meshgrid(np.arange(slices), np.arange(sides), indexing="ij")
    phi, theta = 2 * math.pi * a / slices, 2 * math.pi * b / sides
    reach = ring + tube * np.cos(theta)
    vertices = np.stack([reach * np.cos(phi), reach * np.sin(phi), tube * np.sin(theta)], axis=-1).reshape(-1, 3)
    corners = [((a + i) % slices) * sides + (b + j) % sides for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    w, x, y, z = (corner.ravel() for corner in corners)
    return np.asarray(centre, float) + vertices, np.concatenate([np.c_[w, x, y], np.c_[w, y, z]])


def with_t_junctions(body: Body) -> Body:
    """Return the body with every face divided at the midpoint of its first edge, where its neighbour has no vertex."""
    vertices, faces = body
    a, b, c = faces.T
    middle = len(vertices) + np.arange(len(faces))
    cut = np.concatenate([np.c_[a, middle, c], np.c_[middle, b, c]])
    return np.concatenate([vertices, 0.5 * (vertices[a] + vertices[b])]), cut


def grid(size: float, cells: int, heights: FloatArray | None = None) -> Body:
    """Return a square floor of 2 cells² triangles around the origin, normals up; heights (cells + 1, cells + 1), m."""
    line = np.linspace(-size / 2, size / 2, cells + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    z = np.zeros_like(x) if heights is None else heights
    index = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (index[i : i + cells, j : j + cells].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])


def groove(angle: float, length: float = 20.0, width: float = 5.0) -> Body:
    """Return two planes that meet in a V along the y axis, each ``angle`` above the horizontal; normals up."""
    x = width * math.cos(angle)
    z = width * math.sin(angle)
    y = length / 2
    vertices = np.array([[0, -y, 0], [0, y, 0], [x, -y, z], [x, y, z], [-x, -y, z], [-x, y, z]], float)
    return vertices, np.array([[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4]])


def floor_with_hole(radius: float, size: float = 4.0, slices: int = 128) -> Body:
    """Return a floor with a round hole at the origin, a polygon outside the circle of that radius; normals up."""
    angles = 2 * math.pi * np.arange(slices) / slices
    rim = np.c_[np.cos(angles), np.sin(angles), 0 * angles]
    square = rim / np.abs(rim[:, :2]).max(axis=1, keepdims=True) * (size / 2)
    k = np.arange(slices)
    after = (k + 1) % slices
    faces = np.r_[np.c_[k, k + slices, after + slices], np.c_[k, after + slices, after]]
    return np.r_[rim * (radius / math.cos(math.pi / slices)), square], faces


def rotation(rng: np.random.Generator) -> FloatArray:
    """Return a uniformly random rotation matrix (3, 3)."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def rotation_about_y(angle: float) -> FloatArray:
    """Return the rotation (3, 3) that lowers the positive x axis by ``angle``."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def mesh(body: Body, surface: Surface | None = None, rot: FloatArray | None = None, **kwargs: object) -> TriangleMesh:
    """Return a mesh of the body, rotated about the origin by ``rot`` (3, 3) if given."""
    vertices = body[0] if rot is None else body[0] @ rot.T
    return TriangleMesh(vertices, body[1], surface, **kwargs)  # type: ignore[arg-type]


def floor_world(surface: Surface, **kwargs: object) -> World:
    """Return a world that is one level floor of two triangles, 100 m wide."""
    return World([mesh(grid(100.0, 1), surface)], **kwargs)  # type: ignore[arg-type]


def winding_number(body: TriangleMesh, p: FloatArray) -> float:
    """Return the winding number of a closed mesh around p (A. van Oosterom and J. Strackee, 1983)."""
    corners = body.triangles - p
    lengths = np.sqrt(np.einsum("fij,fij->fi", corners, corners))
    products = np.einsum("fij,fij->fi", corners, corners[:, [1, 2, 0]])  # ab, bc, ca
    spread = lengths.prod(axis=1) + np.einsum("fi,fi->f", products, lengths[:, [2, 0, 1]])
    return float(np.arctan2(np.linalg.det(corners), spread).sum() / (2 * math.pi))


def is_inside_room(world: World, p: FloatArray) -> bool:
    """Return whether p is inside the first mesh, a room, and in no other closed mesh; two-sided ones do not count."""
    expected = [-1.0] + [0.0] * (len(world.meshes) - 1)
    closed = [(body, winding) for body, winding in zip(world.meshes, expected) if not body.two_sided]
    return all(abs(winding_number(body, p) - winding) < 1e-6 for body, winding in closed)


def is_free(world: World, p: FloatArray) -> bool:
    """Return whether a ball at p is in the room, outside all closed obstacles, and touches nothing."""
    return world.clearance(p) > 0.0 and is_inside_room(world, p)


def random_room(rng: np.random.Generator, **kwargs: object) -> tuple[World, FloatArray]:
    """Return a randomly rotated room with obstacles that may overlap, and its frame; gravity is tilted in some."""
    rot = rotation(rng)
    size = float(rng.choice([0.5, 1.0, 3.0]))
    radius = float(rng.choice([BALL_RADIUS, 0.005, 0.05]))
    hall = room(size) if rng.random() < 0.7 else with_t_junctions(room(size))
    meshes = [mesh(hall, random_surface(rng), rot)]
    for _ in range(rng.integers(1, 6)):
        at = rng.uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 0.6]) * size
        s = size * rng.uniform(0.05, 0.35)
        spin = rotation(rng)
        body = [
            lambda s: box(-s * rng.uniform(0.1, 1, 3), s * rng.uniform(0.1, 1, 3)),
            lambda s: box([-s, -s, -0.005], [s, s, 0.005]),
            lambda s: sphere([0, 0, 0], s, int(rng.integers(3, 12)), int(rng.integers(2, 8))),
            lambda s: cone([0, 0, 0], s * 10.0 ** rng.uniform(-2, 0), 2 * s),
            lambda s: tetrahedron([0, 0, 0], s),
            lambda s: slivers(rng, s),
            lambda s: torus([0, 0, 0], s, s * rng.uniform(0.1, 0.6), int(rng.integers(3, 12)), int(rng.integers(3, 8))),
            lambda s: with_t_junctions(tetrahedron([0, 0, 0], s)),
        ][rng.integers(8)](s)
        meshes.append(mesh((body[0] @ spin.T + at, body[1]), random_surface(rng), rot))
    gravity = rot @ [0, 0, -G] if rng.random() < 0.7 else rng.normal(size=3) * G / math.sqrt(3)
    settings = {"gravity": gravity, "dt": float(rng.choice([1 / 60, 1 / 120, 1 / 240]))}
    settings["impact"] = str(rng.choice(["average", "conservative"]))
    return World(meshes, ball_radius=radius, **{**settings, **kwargs}), rot * size


def random_surface(rng: np.random.Generator) -> Surface:
    """Return a surface with damping from 0 to 1, some with separate ratios, with or without rolling resistance."""
    damping, ratio = (float(rng.choice([0.0, 0.3, 0.7, 0.95, 1.0, rng.random()])) for _ in range(2))
    restitution, tangential = [(None, None), (ratio, 1.0), (ratio, 0.0)][rng.integers(3)]
    return Surface(damping, restitution, tangential, rolling=float(rng.choice([0.0, 0.05, 0.3])))


def slivers(rng: np.random.Generator, size: float) -> Body:
    """Return separate triangles from needles to segments."""
    a, b = rng.normal(size=(2, 8, 3)) * size
    c = a + rng.random((8, 1)) * (b - a) + rng.normal(size=(8, 3)) * size * 10.0 ** rng.uniform(-18, -1, (8, 1))
    return np.concatenate([a, b, c]), np.arange(24).reshape(3, 8).T


def free_starts(rng: np.random.Generator, world: World, frame: FloatArray, count: int) -> FloatArray:
    """Return up to ``count`` positions in a random room where a ball may start."""
    places = rng.uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 1.0], (count, 3)) @ frame.T
    return np.array([p for p in places if is_free(world, p)]).reshape(-1, 3)


SOUPS = ["random", "duplicates", "degenerate", "huge and tiny", "floor", "one"]


def triangle_soup(kind: str, rng: np.random.Generator) -> FloatArray:
    """Return triangles (n, 3, 3) that are hard to build a BVH for."""
    triangles = rng.uniform(-1, 1, (200, 1, 3)) + 0.2 * rng.normal(size=(200, 3, 3))
    if kind == "duplicates":
        triangles[50:] = triangles[7]
    elif kind == "degenerate":
        triangles[:100, 1] = triangles[:100, 0]
        triangles[50:150, 2] = triangles[50:150, 0]
    elif kind == "huge and tiny":
        triangles = triangles * 10.0 ** rng.uniform(-6, 3, (200, 1, 1))
    elif kind == "floor":
        vertices, faces = grid(2.0, 12)
        triangles = vertices[faces]
    return triangles[:1] if kind == "one" else triangles
