"""Queries on the whole scene: the first collision of a moving ball, the distance to the nearest triangle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from minigolf_env.physics.jit import entry_kernel, kernel
from minigolf_env.physics.swept_sphere import LATER, MISS, offset, sweep_triangle
from minigolf_env.physics.traversal import begin, next_leaf_on_path, next_leaf_within
from minigolf_env.physics.types import TRUE, ZERO, RecordArray, Scene, Vec3
from minigolf_env.physics.vec3 import dot, norm, scale


class Collision(NamedTuple):
    """The first collision of a path in the kernels' terms."""

    alpha: float
    """Share of the path before it; ``MISS`` without one."""
    normal: Vec3
    """From the surface to the centre."""
    row: int
    """Row of the triangle in the scene; -1 without one."""
    order: int
    """The caller's number of the triangle, which settles ties."""


@kernel
def no_collision() -> Collision:
    """Return the collision of a path that meets nothing."""
    return Collision(MISS, Vec3(0.0, 0.0, 0.0), -1, -1)


@kernel
def earlier(new: Collision, old: Collision, w: Vec3) -> Collision:
    """Return the collision that counts: the smaller alpha, then the steeper approach, then the lower triangle.

    A total order, so that the answer does not depend on the order in which triangles are met.
    """
    if new.alpha != old.alpha:
        return new if new.alpha < old.alpha else old
    steeper = dot(w, old.normal) - dot(w, new.normal)
    if steeper != 0.0:
        return new if steeper > 0.0 else old
    return new if new.order < old.order else old


@entry_kernel
def sweep(scene: Scene, walk: RecordArray, p: Vec3, w: Vec3) -> Collision:
    """Return the first collision of the ball on its way from p to p + w.

    Only the path before the best collision so far is looked at: within twice the tolerance, so that rounding loses no
    tie.
    """
    best = no_collision()
    reach = scene.radius + 2.0 * scene.eps
    begin(walk)
    size = ZERO + 1
    while size > 0:
        first, size = next_leaf_on_path(scene.nodes, walk, p, scale(w, best.alpha), reach)
        for i in range(first, first + size):
            best, _ = sooner(scene.triangles, i, p, w, scene.radius, scene.eps, best, TRUE)
    return best


@entry_kernel
def sweep_scan(triangles: RecordArray, p: Vec3, w: Vec3, radius: float, eps: float) -> Collision:
    """Return the first collision with any of the triangles, by looking at every one: the definition."""
    best = no_collision()
    for i in range(len(triangles)):
        best, _ = sooner(triangles, i, p, w, radius, eps, best, TRUE)
    return best


@kernel
def sooner(
    triangles: RecordArray, i: int, p: Vec3, w: Vec3, radius: float, eps: float, best: Collision, borders: bool
) -> tuple[Collision, bool]:
    """Return the collision with triangle i if it counts before the best one so far, which it is otherwise.

    Without ``borders`` there may be one at the triangle's border, which is told by the second value.
    """
    alpha, normal = sweep_triangle(p, w, radius, eps, triangles[i], best.alpha, borders)
    if alpha >= MISS:
        return best, alpha == LATER
    return earlier(Collision(alpha, normal, i, triangles[i]["number"]), best, w), False


@kernel
def distance(scene: Scene, walk: RecordArray, p: Vec3) -> float:
    """Return the distance from the point p to the nearest triangle."""
    best = np.inf
    begin(walk)
    size = ZERO + 1
    while size > 0:
        first, size = next_leaf_within(scene.nodes, walk, p, best)
        for i in range(first, first + size):
            best = min(best, norm(offset(scene.triangles[i], p)))
    return best


@kernel
def is_near(scene: Scene, walk: RecordArray, p: Vec3, reach: float) -> bool:
    """Return whether a triangle is nearer than ``reach`` to the point p: sooner told than how near the nearest is."""
    begin(walk)
    size = ZERO + 1
    while size > 0:
        first, size = next_leaf_within(scene.nodes, walk, p, reach)
        for i in range(first, first + size):
            if norm(offset(scene.triangles[i], p)) < reach:
                return True
    return False
