"""The triangles near the ball, kept from one sweep to the next.

A neighbourhood is a cylinder in space and a list of every triangle that a ball can touch while its centre is in there.
A path with both ends in a cylinder stays in it, so its sweep looks at the listed triangles only: at none in flight, at
the floor's one or two while rolling. What a sweep finds does not depend on what it looks at besides the triangles it
can meet; so the answers are the whole tree's, bit for bit, whatever the neighbourhood and whoever used it before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.jit import entry_kernel, kernel
from minigolf_env.physics.sweep import Collision, no_collision, sooner, sweep
from minigolf_env.physics.swept_sphere import may_come_near
from minigolf_env.physics.traversal import leaf, mark_on_path, new_walk
from minigolf_env.physics.types import WIDTH, ZERO, RecordArray, Scene, Vec3
from minigolf_env.physics.vec3 import add, along, column, dot, norm, put, scale, store, sub, vec3

CAPACITY = 64
"""Triangles in the list of one path: more cost more than walking through the tree once for each of its pieces."""

FEW = 24
"""Triangles in the list of several paths: more cost more than a list for each."""

CANDIDATES = 2 * CAPACITY
"""Triangles of leaves that a search for a list may come to: more are taken to be too many."""

QUEUE = 2 * CANDIDATES
"""Boxes that such a search may come to, in a walk's stack: it has room for them."""

FURTHEST = 8.0
"""Paths like the present one that a neighbourhood holds at most: longer ones meet too much that is not on the way."""

CYLINDER = np.dtype(
    [
        *((name, "f8", (3,)) for name in ("foot", "axis")),
        *((name, "f8") for name in ("length", "radius2", "paths")),
        *((name, "i8") for name in ("count", "met")),
    ]
)
"""The middle of an end, the unit vector to the other end, the length (m; negative while there is no cylinder) and the
squared radius (m^2); how many paths the next one should hold; the number of triangles in the list, and the row of the
one that a list's sweep met last, 0 at first."""

LIST = np.dtype(
    [
        *((name, "f8", (3, CANDIDATES)) for name in ("a", "n", "u", "v")),
        *((name, "i8", (CANDIDATES,)) for name in ("row", "maybe")),
    ]
)
"""A column for each triangle of the list, or candidate for it: what ``may_come_near`` asks of it, its row in the scene,
and the answer."""


class Cylinder(NamedTuple):
    """A cylinder in the kernels' terms."""

    foot: Vec3
    axis: Vec3
    length: float
    radius2: float


class Neighbourhood(NamedTuple):
    """Scratch memory of one thread."""

    cylinder: RecordArray
    """(1,) of CYLINDER."""
    listed: RecordArray
    """(1,) of LIST."""
    walk: RecordArray
    """(1,) of WALK; its stack also holds the boxes to look into, during a search, and the triangles, during a sweep."""


def no_neighbourhood() -> Neighbourhood:
    """Return scratch memory for one thread, which holds no place yet."""
    cylinder = np.zeros(1, CYLINDER)
    forget(cylinder)
    return Neighbourhood(cylinder, np.zeros(1, LIST), new_walk())


def forget(cylinder: RecordArray) -> None:
    """Let scratch memory hold no place, as it must before it is used in another scene."""
    cylinder["length"], cylinder["paths"], cylinder["met"] = -1.0, FURTHEST, 0


@entry_kernel
def sweep_near(scene: Scene, near: Neighbourhood, p: Vec3, w: Vec3) -> Collision:
    """Return what ``sweep`` returns, sooner."""
    cylinder = _cylinder(near)
    if not ((holds(cylinder, p) and holds(cylinder, add(p, w))) or _look_around(scene, near, p, w)):
        return sweep(scene, near.walk, p, w)
    listed, queue, count = near.listed[0], near.walk[0]["stack"], near.cylinder[0]["count"]
    first = _pick(listed, count, p, w, scene.radius + 2.0 * scene.eps, queue)
    best, k, last = no_collision(), ZERO, first
    while k < last:
        best, later = sooner(scene.triangles, queue[k], p, w, scene.radius, scene.eps, best, k >= first)
        if later:  # Once more, when the faces have told how much of the path is left for borders.
            queue[last] = queue[k]
            last += 1
        k += 1
    if best.row >= 0:
        near.cylinder[0]["met"] = best.row
    return best


@kernel
def _cylinder(near: Neighbourhood) -> Cylinder:
    record = near.cylinder[0]
    return Cylinder(vec3(record["foot"]), vec3(record["axis"]), record["length"], record["radius2"])


@kernel
def holds(cylinder: Cylinder, p: Vec3) -> bool:
    """Return whether a cylinder holds the point p, without a branch."""
    way = sub(p, cylinder.foot)
    height = dot(way, cylinder.axis)
    return bool((height >= 0.0) & (height <= cylinder.length) & (dot(way, way) - height * height <= cylinder.radius2))


@kernel
def around(p: Vec3, w: Vec3, radius: float) -> Cylinder:
    """Return a cylinder around the path p to p + w, whose points are at most 1.42 radii from it."""
    length = norm(w)
    axis = scale(w, 1.0 / length) if length > 1e-100 else Vec3(0.0, 0.0, 0.0)
    longer = length + 2.0 * radius
    return Cylinder(along(p, -radius, axis), axis, longer, radius * radius - 1e-14 * longer * longer)  # For rounding.


@kernel
def reach_around(scene: Scene, radius: float) -> float:
    """Return how near to a path a triangle is that a ball can meet from within the path's cylinder, m."""
    return 1.42 * radius + scene.radius + 4.0 * scene.eps


@kernel
def _look_around(scene: Scene, near: Neighbourhood, p: Vec3, w: Vec3) -> bool:
    """Make a neighbourhood for the path from p to p + w and those after it; return whether there is room for it.

    A rolling ball's paths dip into the ground by half of what gravity does in their time: there the cylinder is wide
    enough to its end, and no wider, for the fewer triangles. In flight paths bend more, and leave it sooner.
    """
    record = near.cylinder[0]
    paths = record["paths"]
    way = scale(w, paths)
    radius = 0.52 * paths * scene.dt * scene.dt * norm(scene.gravity) + 1e-4 * norm(way) + 4.0 * scene.eps
    if not _list_triangles(scene, near, p, way, reach_around(scene, radius), FEW if paths > 1.0 else CAPACITY):
        record["length"], record["paths"] = -1.0, max(1.0, 0.5 * paths)
        return False
    cylinder = around(p, way, radius)
    store(record["foot"], cylinder.foot)
    store(record["axis"], cylinder.axis)
    record["length"], record["radius2"] = cylinder.length, cylinder.radius2
    if is_short(near):
        record["paths"] = min(FURTHEST, 2.0 * paths)
    return True


@kernel
def is_short(near: Neighbourhood) -> bool:
    """Return whether there is a list with room for more."""
    record = near.cylinder[0]
    return bool(record["length"] >= 0.0 and 3 * record["count"] <= FEW)


@kernel
def _list_triangles(scene: Scene, near: Neighbourhood, p: Vec3, w: Vec3, reach: float, most: int) -> bool:
    """List the triangles, ``most`` at most, that may be within ``reach`` of the path p to p + w; return whether it did.

    The tree is searched breadth first: the processor can look at several nodes at a time, as none waits for another.
    """
    walk, listed = near.walk[0], near.listed[0]
    queue = walk["stack"]
    queue[0], waiting, done, count = 0, ZERO + 1, ZERO, ZERO
    while done < waiting:
        i = queue[done]
        if i >= 0:
            mark_on_path(scene.nodes, i, near.walk, p, w, reach)
            for k in range(WIDTH):
                queue[waiting] = scene.nodes[i]["inside"][k]
                waiting += walk["near"][k]
            if waiting > QUEUE:
                return False
        else:
            first, size = leaf(i)
            if count + size > CANDIDATES:
                return False
            for row in range(first, first + size):
                listed["row"][count] = row
                count += 1
        done += 1
    _read(scene.triangles, listed, count)
    count = _pick(listed, count, p, w, reach, listed["row"])
    if count > most:
        return False
    _read(scene.triangles, listed, count)
    near.cylinder[0]["count"] = count
    return True


@kernel
def _read(triangles: RecordArray, listed: np.void, count: int) -> None:
    """Read the columns of a list from the triangles that its rows name."""
    for k in range(count):
        triangle = triangles[listed["row"][k]]
        put(listed["a"], k, vec3(triangle["a"]))
        put(listed["n"], k, vec3(triangle["n"]))
        put(listed["u"], k, vec3(triangle["u"]))
        put(listed["v"], k, vec3(triangle["v"]))


@kernel
def _pick(listed: np.void, count: int, p: Vec3, w: Vec3, reach: float, rows: NDArray[np.int64]) -> int:
    """Write the rows of the listed triangles that the path p to p + w may come within ``reach`` of; return how many.

    They are told apart in vector instructions, as nothing branches.
    """
    for k in range(count):
        a, n, u, v = column(listed["a"], k), column(listed["n"], k), column(listed["u"], k), column(listed["v"], k)
        listed["maybe"][k] = may_come_near(sub(a, p), n, u, v, w, 0.0, 1.0, reach)
    picked = ZERO
    for k in range(count):
        rows[picked] = listed["row"][k]
        picked += listed["maybe"][k]
    return picked
