"""Walks through the tree of boxes: which leaves are near a path, or a point.

A node's boxes are told apart together, in vector instructions. A walk keeps what it has yet to look into on a stack,
the nearer boxes of a node on top, so that a collision there spares what is behind. It comes to a superset of the
triangles that are needed; which ones changes no answer but a distance's last bit, only the cost.
"""

from __future__ import annotations

import numpy as np

from minigolf_env.physics.jit import kernel
from minigolf_env.physics.types import WIDTH, ZERO, RecordArray, Vec3
from minigolf_env.physics.vec3 import add, column, dot, norm, scale, sub

STACK = 4096
"""Places on a walk's stack. A box has at most 31 of 32 of its node's triangles (``bvh.LOPSIDED``), so that 10^8
triangles make 540 levels at most, each of which leaves WIDTH - 1 boxes to look into."""

WALK = np.dtype(
    [
        ("stack", "i8", (STACK,)),
        ("waiting", "i8"),
        ("near", "i8", (WIDTH,)),
        ("order", "f8", (WIDTH,)),
    ]
)
"""What is to be looked into, as a node's ``inside`` names it, the next on top, and how many wait there; which boxes of
a node are near, and their order: that of the highest is looked into first."""


def new_walk() -> RecordArray:
    """Return memory (1,) for the walks of one thread, one at a time: each writes what it reads."""
    return np.empty(1, WALK)


@kernel
def begin(walk: RecordArray) -> None:
    """Begin a walk, with nothing but the root to look into."""
    walk[0]["stack"][0], walk[0]["waiting"] = 0, 1


@kernel
def next_leaf_on_path(nodes: RecordArray, walk: RecordArray, p: Vec3, w: Vec3, reach: float) -> tuple[int, int]:
    """Return the walk's next leaf whose box the path p to p + w may meet within ``reach``: first triangle and number.

    The number is 0 when there is none. What waits on the stack since the path was longer is not asked again.
    """
    while walk[0]["waiting"] > 0:
        i = _pop(walk)
        if i < 0:
            return leaf(i)
        mark_on_path(nodes, i, walk, p, w, reach)
        _push(nodes, i, walk)
    return ZERO, ZERO


@kernel
def next_leaf_within(nodes: RecordArray, walk: RecordArray, p: Vec3, reach: float) -> tuple[int, int]:
    """Return the walk's next leaf whose box is within ``reach`` of the point p, as ``next_leaf_on_path`` does."""
    while walk[0]["waiting"] > 0:
        i = _pop(walk)
        if i < 0:
            return leaf(i)
        _mark_within(nodes, i, walk, p, reach)
        _push(nodes, i, walk)
    return ZERO, ZERO


@kernel
def leaf(inside: int) -> tuple[int, int]:
    """Return the first triangle and the number of triangles of a box whose ``inside`` is negative."""
    return -inside // WIDTH, -inside % WIDTH


@kernel
def _pop(walk: RecordArray) -> int:
    """Return what is to be looked into next."""
    record = walk[0]
    record["waiting"] -= 1
    inside: int = record["stack"][record["waiting"]]
    return inside


@kernel
def _push(nodes: RecordArray, i: int, walk: RecordArray) -> None:
    """Put what is inside the boxes of node i that are near onto the stack, the nearest last."""
    record, node = walk[0], nodes[i]
    stack, order = record["stack"], record["order"]
    first = ZERO + record["waiting"]
    end = first  # First the numbers of the boxes, for sorting, then what is inside them.
    for k in range(WIDTH):
        stack[end] = k
        end += record["near"][k]
    for j in range(first + 1, end):
        k, place = stack[j], j
        while place > first and order[stack[place - 1]] > order[k]:
            stack[place] = stack[place - 1]
            place -= 1
        stack[place] = k
    for j in range(first, end):
        stack[j] = node["inside"][stack[j]]
    record["waiting"] = end


@kernel
def mark_on_path(nodes: RecordArray, i: int, walk: RecordArray, p: Vec3, w: Vec3, reach: float) -> None:
    """Tell which boxes of node i the path from p to p + w may come within ``reach`` of, and in which order.

    Separating axes of a segment and a box (C. Ericson, Real-Time Collision Detection, 2005, section 5.3.3): the three
    axes of the box, the direction from the box to the middle of the path, and the cross products; no division, and no
    branch. Where there is no box, its middle is not a number, and it is not near.
    """
    node, record = nodes[i], walk[0]
    half = scale(w, 0.5)
    middle = add(p, half)
    ax, ay, az = abs(half.x), abs(half.y), abs(half.z)
    for k in range(node["width"]):
        box, way = column(node["half"], k), sub(middle, column(node["middle"], k))
        x, y, z = way
        ex, ey, ez = box.x + reach, box.y + reach, box.z + reach
        near = (abs(x) <= ex + ax) & (abs(y) <= ey + ay) & (abs(z) <= ez + az)
        gap = _gap(way, box)
        distance2 = dot(gap, gap)
        free = distance2 - abs(dot(gap, half))
        off = (free > 0.0) & (free * free > reach * reach * distance2)
        off |= abs(y * half.z - z * half.y) > ey * az + ez * ay
        off |= abs(z * half.x - x * half.z) > ex * az + ez * ax
        off |= abs(x * half.y - y * half.x) > ex * ay + ey * ax
        record["near"][k], record["order"][k] = near & (not off), dot(way, w)


@kernel
def _mark_within(nodes: RecordArray, i: int, walk: RecordArray, p: Vec3, reach: float) -> None:
    """Tell which boxes of node i are within ``reach`` of the point p, and how near."""
    node, record = nodes[i], walk[0]
    for k in range(node["width"]):
        distance = norm(_gap(sub(p, column(node["middle"], k)), column(node["half"], k)))
        record["near"][k], record["order"][k] = distance <= reach, -distance


@kernel
def _gap(way: Vec3, box: Vec3) -> Vec3:
    """Return the way from the nearest point of a box, given its half extents, to a point given from its middle."""
    return Vec3(_outside(way.x, box.x), _outside(way.y, box.y), _outside(way.z, box.z))


@kernel
def _outside(x: float, half: float) -> float:
    """Return how far, and to which side, a coordinate x is outside of -half to half."""
    return x - max(-half, min(half, x))
