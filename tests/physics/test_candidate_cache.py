"""A neighbourhood changes the cost of a sweep and never its answer."""

from collections.abc import Iterator

import numpy as np
import pytest

from minigolf_env.physics import TriangleMesh, World
from minigolf_env.physics.candidate_cache import (
    MULTI_STEP_CAPACITY,
    SINGLE_STEP_CAPACITY,
    new_candidate_cache,
    sweep_cached,
)
from minigolf_env.physics.sweep import sweep
from minigolf_env.physics.traversal import new_traversal
from minigolf_env.physics.types import Vec3
from tests.physics.scenes import FloatArray, grid, mesh, random_room


def scene(kind: str, rng: np.random.Generator) -> World:
    """Return a world in which few triangles, about as many as a list has room for, or far more are near a ball."""
    if kind == "room":
        return random_room(rng)[0]
    if kind == "green":
        return World([mesh(grid(1.0, 60, rng.uniform(-1e-3, 1e-3, (61, 61))))])
    count, radius = (6000, 0.3) if kind == "throng" else (2000, rng.uniform(0.05, 0.3))
    triangles = rng.uniform(-1, 1, (count, 1, 3)) + 0.1 * rng.normal(size=(count, 3, 3))
    return World([TriangleMesh(triangles.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))], radius)


def walk(world: World, rng: np.random.Generator, count: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Give paths as a ball's are: each from about where the last ended, bent; now and then back, nowhere, elsewhere."""
    corners = np.concatenate([body.triangles for body in world.meshes])
    p, way = np.zeros(3), np.zeros(3)
    for _ in range(count):
        event = rng.random()
        if event < 0.02 or not way.any():  # Towards a point of a triangle, from where the ball nearly touches it.
            way = rng.normal(size=3)
            way /= np.linalg.norm(way)
            p = rng.dirichlet([1, 1, 1]) @ corners[rng.integers(len(corners))] - 1.05 * world.ball_radius * way
            way *= 10.0 ** rng.uniform(-4, -0.5)
        elif event < 0.06:
            way = -way
        length = np.linalg.norm(way)
        yield p, np.zeros(3) if event > 0.98 else way
        p = p + rng.random() * way
        way = way + length * 10.0 ** rng.uniform(-4, -0.5) * rng.normal(size=3)
        way *= length / np.linalg.norm(way)


@pytest.mark.parametrize("kind", ["room", "green", "crowd", "throng"])
def test_sweep_near_is_sweep(kind: str) -> None:
    """Along a walk, with a neighbourhood that has seen all of it, each answer is the whole tree's, bit for bit."""
    hits, listed = 0, []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        world, cache = scene(kind, rng), new_candidate_cache()
        for p, way in walk(world, rng, 1000):
            hit = sweep_cached(world._scene, cache, Vec3(*p), Vec3(*way))
            assert hit == sweep(world._scene, new_traversal(), Vec3(*p), Vec3(*way))
            hits += hit.row >= 0
            listed.append(
                cache.state[0]["num_candidates"] if cache.state[0]["length"] >= 0.0 else SINGLE_STEP_CAPACITY + 1
            )
    assert hits > 300
    assert min(listed) < 5
    assert kind == "room" or any(MULTI_STEP_CAPACITY < count <= SINGLE_STEP_CAPACITY for count in listed)
    assert kind == "green" or max(listed) > SINGLE_STEP_CAPACITY
