"""The BVH changes the cost of a query and never its result."""

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.physics import TriangleMesh, World, sweep_sphere
from minigolf_env.physics.bvh import MAX_LEAF_SIZE, MAX_SPLIT_RATIO, build_bvh
from minigolf_env.physics.jit import kernel
from minigolf_env.physics.traversal import (
    MAX_STACK_DEPTH,
    new_traversal,
    next_leaf_in_radius,
    next_leaf_in_sweep,
    start_traversal,
)
from minigolf_env.physics.types import BVH_WIDTH, INT64_ONE, INT64_ZERO, RecordArray, Vec3
from tests.physics.scenes import BALL_RADIUS, SOUPS, FloatArray, sphere, triangle_soup


def paths(rng: np.random.Generator, triangles: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return starts and ends: random, axis-parallel, of no length, from far away, ending on corners, and short."""
    starts = rng.uniform(-2, 2, (count, 3))
    ends = rng.uniform(-2, 2, (count, 3))
    case = np.arange(count) % 6
    axis = rng.integers(0, 3, count)
    along_axis = starts.copy()
    along_axis[np.arange(count), axis] *= -1.0
    ends[case == 1] = along_axis[case == 1]
    ends[case == 2] = starts[case == 2]
    starts[case == 3] *= 1e6
    ends[case == 4] = triangles[rng.integers(len(triangles), size=count), 0][case == 4]
    ends[case == 5] = starts[case == 5] + 1e-3 * rng.normal(size=(count, 3))[case == 5]
    return starts, ends


@pytest.mark.parametrize("radius", [BALL_RADIUS, 0.3])
@pytest.mark.parametrize("kind", SOUPS)
def test_bvh_sweep_equals_brute_force_bitwise(kind: str, radius: float) -> None:
    """World.sweep equals sweep_sphere, which tests every triangle, bit for bit."""
    rng = np.random.default_rng(1)
    triangles = triangle_soup(kind, rng)
    starts, ends = paths(rng, triangles, 600)
    # The tolerance depends on the largest coordinate: one distant triangle makes it the same for both.
    far = np.full((1, 3, 3), 2.0 * max(np.abs(array).max() for array in (starts, ends, triangles)))
    triangles = np.concatenate([triangles, far])
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    hits = World([TriangleMesh(triangles.reshape(-1, 3), faces, two_sided=True)], radius).sweep_batch(starts, ends)
    for i, (start, end) in enumerate(zip(starts, ends)):
        brute_force = sweep_sphere(start, end, radius, triangles)
        assert (hits.hit[i], hits.alpha[i], hits.triangle[i]) == (
            brute_force.hit,
            brute_force.alpha,
            brute_force.triangle,
        )
        assert np.array_equal(hits.normal[i], brute_force.normal)
    assert kind == "one" or hits.hit.sum() > 50


def test_traversal_stack_suffices_for_the_deepest_bvh() -> None:
    """The stack suffices for 10^8 triangles with the most uneven splits."""
    levels = np.log(1e8 / MAX_LEAF_SIZE) / -np.log1p(-1.0 / MAX_SPLIT_RATIO)
    assert levels * (BVH_WIDTH - 1) + BVH_WIDTH < MAX_STACK_DEPTH


def test_clearance_is_the_distance_to_the_nearest_triangle() -> None:
    """The clearance outside a fine sphere is the distance of the centre from the sphere, less the ball's radius."""
    world = World([TriangleMesh(*sphere([0.0, 0.0, 0.0], 1.0, 64, 48))], ball_radius=BALL_RADIUS)
    directions = np.random.default_rng(4).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for distance in (1.1, 2.0, 1000.0):
        assert world.clearance(distance * directions) == pytest.approx(distance - 1.0 - BALL_RADIUS, abs=5e-3)
    body = sphere([0.0, 0.0, 0.0], 1.0, 64, 48)
    assert world.clearance(body[0] * 1.5) == pytest.approx(0.5 - BALL_RADIUS, abs=1e-12)


@kernel
def write_leaves(
    nodes: RecordArray, traversal: RecordArray, p: Vec3, w: Vec3, reach: float, leaves: NDArray[np.int64]
) -> int:
    """Write the leaves (N, 2) on a path, or around a point if it has no length; return their number."""
    start_traversal(traversal)
    count = INT64_ZERO
    size = INT64_ONE
    while size > 0:
        if w.x == 0.0:
            first, size = next_leaf_in_radius(nodes, traversal, p, reach)
        else:
            first, size = next_leaf_in_sweep(nodes, traversal, p, w, reach)
        leaves[count, 0] = first
        leaves[count, 1] = size
        count += size > 0
    return count


@pytest.mark.parametrize("length", [0.0, 100.0, -100.0])
def test_traversal_returns_exactly_the_near_leaves_nearest_first(length: float) -> None:
    """In a row of point triangles, along a path or around a point, all near leaves are returned and no others."""
    nodes, order = build_bvh(np.arange(64.0)[:, None, None] + np.zeros((64, 3, 3)))
    start = 20.2
    leaves = np.empty((64, 2), np.int64)
    count = write_leaves(
        nodes, new_traversal(), Vec3(*[start] * 3), Vec3(*[length] * 3), 10.0 if length == 0.0 else 0.1, leaves
    )
    rows_of_leaves = [order[first : first + size] for first, size in leaves[:count]]
    distance_ahead = np.arange(64) - start
    is_near = np.abs(distance_ahead) * np.sqrt(3.0) <= 10.0 if length == 0.0 else distance_ahead * length >= -0.1
    assert set(np.flatnonzero(is_near)) <= set(np.concatenate(rows_of_leaves))
    assert all(is_near[rows].any() for rows in rows_of_leaves)
    distances = np.array([np.abs(rows - start).min() for rows in rows_of_leaves])
    assert len(distances) > 3
    assert distances[0] == distances.min()
    assert length == 0.0 or (np.diff(distances) > 0.0).all()
