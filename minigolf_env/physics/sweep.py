"""Queries on the whole scene, for one ball or many: first hit of a moving ball, distance to the nearest triangle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.swept_sphere import (
    ALPHA_DEFERRED,
    ALPHA_MISS,
    CULLING_MARGIN,
    closest_point_offset,
    sweep_triangle,
)
from minigolf_env.physics.traversal import next_leaf_in_radius, next_leaf_in_sweep, start_traversal
from minigolf_env.physics.types import BOOL_TRUE, INT64_ONE, CompiledScene, FloatArray, RecordArray, Vec3
from minigolf_env.physics.vec3 import dot, norm, scale, store, vec3

OVERLAP_MARGIN = 1.5
"""Depth, in eps, down to which a start is accepted without computing its clearance. It lies between 1, the depth that a
run may reach, and 2, beyond which a start is refused, so that rounding cannot matter."""


class Collision(NamedTuple):
    """The first hit along a path, in compiled code; ``Hit`` is its public form."""

    alpha: float
    """Hit fraction; ``ALPHA_MISS`` without a hit."""
    normal: Vec3
    """Unit contact normal, from the surface to the ball's centre."""
    row: int
    """Row of the triangle in the scene; -1 without a hit."""
    triangle_id: int
    """Index of the triangle in the caller's order; -1 without a hit."""


@device_function
def no_hit() -> Collision:
    """Return the result of a path without a hit."""
    return Collision(ALPHA_MISS, Vec3(0.0, 0.0, 0.0), -1, -1)


@device_function
def first_hit(new: Collision, old: Collision, w: Vec3) -> Collision:
    """Return the first of two hits: the smaller alpha, then the steeper approach, then the lower triangle_id.

    This is a total order: the result does not depend on the order in which triangles are tested.
    """
    if new.alpha != old.alpha:
        return new if new.alpha < old.alpha else old
    steeper = dot(w, old.normal) - dot(w, new.normal)
    if steeper != 0.0:
        return new if steeper > 0.0 else old
    return new if new.triangle_id < old.triangle_id else old


@kernel
def sweep(scene: CompiledScene, traversal: RecordArray, p: Vec3, w: Vec3) -> Collision:
    """Return the first hit of the ball on its way from p to p + w.

    Boxes beyond the first hit so far are culled, with a margin, so that rounding loses no tie.
    """
    best = no_hit()
    inflated_radius = scene.radius + CULLING_MARGIN * scene.eps
    start_traversal(traversal)
    size = INT64_ONE
    while size > 0:
        first, size = next_leaf_in_sweep(scene.nodes, traversal, p, scale(w, best.alpha), inflated_radius)
        for i in range(first, first + size):
            best, _ = update_first_hit(scene.triangles, i, p, w, scene.radius, scene.eps, best, BOOL_TRUE)
    return best


@kernel
def sweep_brute_force(triangles: RecordArray, p: Vec3, w: Vec3, radius: float, eps: float) -> Collision:
    """Return the first hit with any triangle by testing every one: the definition of ``sweep``."""
    best = no_hit()
    for i in range(len(triangles)):
        best, _ = update_first_hit(triangles, i, p, w, radius, eps, best, BOOL_TRUE)
    return best


@device_function
def update_first_hit(
    triangles: RecordArray, i: int, p: Vec3, w: Vec3, radius: float, eps: float, best: Collision, test_edges: bool
) -> tuple[Collision, bool]:
    """Return the first of ``best`` and the hit with triangle i, and whether a test of i's edges was deferred.

    Edges are only tested with ``test_edges``.
    """
    alpha, normal = sweep_triangle(p, w, radius, eps, triangles[i], best.alpha, test_edges)
    if alpha >= ALPHA_MISS:
        return best, alpha == ALPHA_DEFERRED
    return first_hit(Collision(alpha, normal, i, triangles[i]["triangle_id"]), best, w), False


@device_function
def distance_to_nearest(scene: CompiledScene, traversal: RecordArray, p: Vec3) -> float:
    """Return the distance from the point p to the nearest triangle, m."""
    best = np.inf
    start_traversal(traversal)
    size = INT64_ONE
    while size > 0:
        first, size = next_leaf_in_radius(scene.nodes, traversal, p, best)
        for i in range(first, first + size):
            best = min(best, norm(closest_point_offset(scene.triangles[i], p)))
    return best


@device_function
def any_triangle_within(scene: CompiledScene, traversal: RecordArray, p: Vec3, distance: float) -> bool:
    """Return whether a triangle is closer than ``distance`` to the point p: cheaper than finding the nearest."""
    start_traversal(traversal)
    size = INT64_ONE
    while size > 0:
        first, size = next_leaf_in_radius(scene.nodes, traversal, p, distance)
        for i in range(first, first + size):
            if norm(closest_point_offset(scene.triangles[i], p)) < distance:
                return True
    return False


@kernel
def sweep_range(
    first: int,
    last: int,
    scene: CompiledScene,
    traversal: RecordArray,
    starts: FloatArray,
    paths: FloatArray,
    alphas: FloatArray,
    normals: FloatArray,
    triangles: NDArray[np.int64],
) -> None:
    """Sweep balls first to last - 1 of a batch along paths (N, 3), and write alpha, normal and triangle."""
    for i in range(first, last):
        hit = sweep(scene, traversal, vec3(starts[i]), vec3(paths[i]))
        alphas[i] = hit.alpha
        triangles[i] = hit.triangle_id
        store(normals[i], hit.normal)


@kernel
def clearance_range(
    first: int, last: int, scene: CompiledScene, traversal: RecordArray, positions: FloatArray, clearances: FloatArray
) -> None:
    """Write the distance from the surface of balls first to last - 1 to the nearest triangle."""
    for i in range(first, last):
        clearances[i] = distance_to_nearest(scene, traversal, vec3(positions[i])) - scene.radius


@kernel
def possible_overlap_range(
    first: int, last: int, scene: CompiledScene, traversal: RecordArray, positions: FloatArray, flags: NDArray[np.bool_]
) -> None:
    """Write whether balls first to last - 1 may be deeper than OVERLAP_MARGIN in a triangle; false is certain."""
    for i in range(first, last):
        flags[i] = any_triangle_within(scene, traversal, vec3(positions[i]), scene.radius - OVERLAP_MARGIN * scene.eps)
