"""Scenes of the golden trajectories, whose hashes are stored (tools/determinism.py).

Their coordinates are stored or exact numbers, since the last bits of sine and cosine differ between machines.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from minigolf_env.physics import Surface, TriangleMesh, World
from tests.physics.scenes import BALL_RADIUS, FloatArray, box, grid, mesh, room, tetrahedron

DATA = Path(__file__).parents[1] / "data"
GREEN = Surface(restitution=0.3, tangential=1.0, rolling=0.0625)
WOOD = Surface(damping=0.75)
SHOTS_PER_SCENE = 16
"""Number of balls in each scene."""


def spread(lower: tuple[float, ...], upper: tuple[float, ...]) -> FloatArray:
    """Return SHOTS_PER_SCENE points, one per row, that fill a box evenly: multiples of irrational numbers, modulo 1."""
    steps = np.array([0.618033988749895, 0.414213562373095, 0.732050807568877])[: len(lower)]
    fractions = (np.arange(1, SHOTS_PER_SCENE + 1)[:, None] * steps) % 1.0
    return np.array(lower) + fractions * (np.array(upper) - np.array(lower))


def dogleg() -> tuple[World, FloatArray, FloatArray]:
    """Return the bundled hole with its stored meshes, and putts from its tee."""
    with np.load(DATA / "golden_dogleg.npz") as data:
        names = sorted({key.split(".")[0] for key in data})
        fields = ("vertices", "faces", "surface")
        parts = [[data[f"{name}.{field}"] for field in fields] for name in names]
        meshes = [TriangleMesh(vertices, faces, Surface(*surface)) for vertices, faces, surface in parts]
    p = np.c_[spread((0.2, 0.325), (0.5, 0.925)), np.full(SHOTS_PER_SCENE, BALL_RADIUS)]
    return World(meshes), p, np.c_[spread((0.5, -2.0), (6.0, 2.0)), np.zeros(SHOTS_PER_SCENE)]


def furnished() -> tuple[World, FloatArray, FloatArray]:
    """Return a stored, rotated room with a tetrahedron, and balls launched in it; conservative response."""
    with np.load(DATA / "golden_steps.npz") as data:
        vertices = data["vertices"][0]
        faces = data["faces"][0]
        centre = data["states"][0, 0, :3]
        radius = float(data["radius"][0])
    meshes = [TriangleMesh(vertices[:8], faces[:12], WOOD), TriangleMesh(vertices[8:], faces[12:] - 8, WOOD)]
    world = World(meshes, radius, impact="conservative")
    return world, np.tile(centre, (SHOTS_PER_SCENE, 1)), spread((-4.0, -4.0, -4.0), (4.0, 4.0, 4.0))


def green() -> tuple[World, FloatArray, FloatArray]:
    """Return a green of 5,000 uneven triangles, and putts on it."""
    number = np.arange(51 * 51).reshape(51, 51)
    world = World([mesh(grid(4.0, 50, (number * 7919 % 1009) / 1009 * 1e-3), GREEN)])
    p = np.c_[spread((-1.0, -1.0), (1.0, 1.0)), np.full(SHOTS_PER_SCENE, BALL_RADIUS + 2e-3)]
    return world, p, np.c_[spread((-2.0, -2.0), (2.0, 2.0)), np.zeros(SHOTS_PER_SCENE)]


def groove() -> tuple[World, FloatArray, FloatArray]:
    """Return a V of slopes 3:4 and 5:12, descending along its crease, and balls dropped into it."""
    corners = [[0, -8, -1], [0, 8, 1], [4, -8, 2], [4, 8, 4], [-12, -8, 4], [-12, 8, 6]]
    world = World([TriangleMesh(corners, [[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4]], Surface(0.5, rolling=0.0625))])
    return world, spread((-1.0, 0.0, 1.5), (1.0, 2.0, 2.5)), spread((-1.0, -2.0, -1.0), (1.0, 2.0, 1.0))


def pyramid() -> tuple[World, FloatArray, FloatArray]:
    """Return a room under tilted gravity with a block and a tetrahedron, and balls launched at up to 30 m/s."""
    bodies = [room(2.0), box([-0.5, -0.5, 0.0], [0.25, 0.0, 0.375]), tetrahedron([0.5, 0.5, 0.5], 0.375)]
    world = World([mesh(body, Surface(damping=0.875)) for body in bodies], gravity=(1.0, -0.5, -9.5), dt=1 / 60)
    return world, spread((-0.5, 0.25, 1.0), (0.0, 0.75, 1.75)), spread((-17.0, -17.0, -17.0), (17.0, 17.0, 17.0))


SCENES = {scene.__name__: scene for scene in (dogleg, furnished, green, groove, pyramid)}


def hash_of(name: str) -> str:
    """Return the SHA-256 of a scene's positions, velocities, times, bounces and statuses after 0.25 s, 1 s and 20 s."""
    world, p, v = SCENES[name]()
    digest = hashlib.sha256()
    for limit in (0.25, 1.0, 20.0):
        shots = world.simulate_batch(p, v, limit)
        for array in (shots.position, shots.velocity, shots.time, shots.bounces, shots.status):
            digest.update(np.asarray(array).astype("<f8").tobytes())
    return digest.hexdigest()
