"""A candidate cache changes the cost of a sweep and never its result."""

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
    """Return a world with few triangles near a ball, about as many as the cache has room for, or far more."""
    if kind == "room":
        return random_room(rng)[0]
    if kind == "green":
        return World([mesh(grid(1.0, 60, rng.uniform(-1e-3, 1e-3, (61, 61))))])
    count, radius = (6000, 0.3) if kind == "dense crowd" else (2000, rng.uniform(0.05, 0.3))
    triangles = rng.uniform(-1, 1, (count, 1, 3)) + 0.1 * rng.normal(size=(count, 3, 3))
    return World([TriangleMesh(triangles.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))], radius)


def random_paths(world: World, rng: np.random.Generator, count: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield paths like a ball's: each starts near the end of the last, bent; some reverse, stop or jump."""
    corners = np.concatenate([body.triangles for body in world.meshes])
    p = np.zeros(3)
    displacement = np.zeros(3)
    for _ in range(count):
        event = rng.random()
        if event < 0.02 or not displacement.any():
            # Start next to a random point of a triangle and move towards it.
            displacement = rng.normal(size=3)
            displacement /= np.linalg.norm(displacement)
            p = rng.dirichlet([1, 1, 1]) @ corners[rng.integers(len(corners))] - 1.05 * world.ball_radius * displacement
            displacement *= 10.0 ** rng.uniform(-4, -0.5)
        elif event < 0.06:
            displacement = -displacement
        length = np.linalg.norm(displacement)
        yield p, np.zeros(3) if event > 0.98 else displacement
        p = p + rng.random() * displacement
        displacement = displacement + length * 10.0 ** rng.uniform(-4, -0.5) * rng.normal(size=3)
        displacement *= length / np.linalg.norm(displacement)


@pytest.mark.parametrize("kind", ["room", "green", "crowd", "dense crowd"])
def test_cached_sweep_equals_full_sweep_bitwise(kind: str) -> None:
    """Along a random sequence of paths each cached sweep equals the sweep of the whole BVH, bit for bit."""
    hits = 0
    num_candidates = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        world = scene(kind, rng)
        cache = new_candidate_cache()
        for p, displacement in random_paths(world, rng, 1000):
            hit = sweep_cached(world.scene, cache, Vec3(*p), Vec3(*displacement))
            assert hit == sweep(world.scene, new_traversal(), Vec3(*p), Vec3(*displacement))
            hits += hit.row >= 0
            num_candidates.append(
                cache.state[0]["num_candidates"] if cache.state[0]["length"] >= 0.0 else SINGLE_STEP_CAPACITY + 1
            )
    assert hits > 300
    assert min(num_candidates) < 5
    assert kind == "room" or any(MULTI_STEP_CAPACITY < count <= SINGLE_STEP_CAPACITY for count in num_candidates)
    assert kind == "green" or max(num_candidates) > SINGLE_STEP_CAPACITY
