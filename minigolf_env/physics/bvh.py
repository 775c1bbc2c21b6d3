"""The broad phase: a bounding volume hierarchy over the triangles, walked without a stack.

A walk goes into a node's nearer child, or past its subtree, to what the node's ``skips`` name for the walk's direction.
A query visits a superset of the triangles it needs; which ones never changes an answer, only its cost.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.kernel import entry_kernel, kernel
from minigolf_env.physics.types import NODE, ZERO, FloatArray, RecordArray, Vec3
from minigolf_env.physics.vec3 import add, dot, norm, scale, sub, vec3

LEAF = 4
"""Triangles in a leaf: fewer cost more nodes, more cost more triangle tests."""

BINS = 16
"""Candidate planes of a split, as in I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007."""

LOPSIDED = 32
"""A split that leaves less than this fraction on one side is replaced by halves: building stays n log n."""

TINY = 2.0**-1022
"""The smallest half extent, m: rounding up a zero."""


def build_tree(corners: FloatArray) -> tuple[RecordArray, NDArray[np.int64]]:
    """Build the hierarchy over n >= 1 triangles (n, 3, 3); return its nodes and the order (n,) of its leaves."""
    n = len(corners)
    low, high, order = corners.min(axis=1), corners.max(axis=1), np.arange(n)
    nodes, todo = np.zeros(2 * n, NODE), np.empty((n + 1, 2), np.int64)
    count = _build(low, high, order, nodes, todo, np.empty(BINS), np.empty((BINS, 6)))
    return nodes[:count].copy(), order


@entry_kernel
def _build(
    low: FloatArray,
    high: FloatArray,
    order: NDArray[np.int64],
    nodes: RecordArray,
    todo: NDArray[np.int64],
    inside: FloatArray,
    boxes: FloatArray,
) -> int:
    """Fill in the nodes, sort ``order``, return the number of nodes; ``todo``, ``inside`` and ``boxes`` are scratch."""
    todo[0, 0], todo[0, 1] = 0, len(order)
    waiting, count = ZERO + 1, ZERO
    while waiting > 0:
        waiting -= 1
        start, end = todo[waiting, 0], todo[waiting, 1]
        node = nodes[count]
        for k in range(3):
            node["middle"][k], node["half"][k] = _extent(low, high, order, start, end, k)
        if end - start <= LEAF:
            node["first"], node["size"] = start, end - start
        else:
            cut, node["axis"] = _split(order, start, end, low, high, inside, boxes)
            todo[waiting, 0], todo[waiting, 1] = cut, end
            todo[waiting + 1, 0], todo[waiting + 1, 1] = start, cut
            waiting += 2
        count += 1
    _link(nodes, count)
    return count


@kernel
def _link(nodes: RecordArray, count: int) -> None:
    """Fill in the further children and the skips of nodes that stand in depth-first order."""
    for i in range(count - 1, -1, -1):
        node = nodes[i]
        if node["size"] == 0:
            node["first"] = nodes[i + 1]["skips"][0]
        node["skips"][0] = i + 1 if node["size"] > 0 else nodes[node["first"]]["skips"][0]
    for o in range(1, 8):
        nodes[0]["skips"][o] = count
        for i in range(count):
            node = nodes[i]
            if node["size"] == 0:
                near, far = (node["first"], i + 1) if (o >> node["axis"]) & 1 else (i + 1, node["first"])
                nodes[near]["skips"][o], nodes[far]["skips"][o] = far, node["skips"][o]


@kernel
def _extent(
    low: FloatArray, high: FloatArray, order: NDArray[np.int64], start: int, end: int, axis: int
) -> tuple[float, float]:
    """Return the middle and the half extent of the boxes of order[start:end] along an axis."""
    lowest, highest = math.inf, -math.inf
    for j in range(start, end):
        lowest, highest = min(lowest, low[order[j], axis]), max(highest, high[order[j], axis])
    middle = 0.5 * (lowest + highest)
    # Rounding of the middle must not let a corner stick out.
    return middle, max(highest - middle, middle - lowest) * (1.0 + 2.0**-52) + TINY


@kernel
def _split(
    order: NDArray[np.int64],
    start: int,
    end: int,
    low: FloatArray,
    high: FloatArray,
    inside: FloatArray,
    boxes: FloatArray,
) -> tuple[int, int]:
    """Reorder order[start:end] around the cheapest binned plane; return where the upper part starts, and the axis.

    Nothing is upper among triangles whose boxes have the same middle: they are halved.
    """
    axis, width, origin = ZERO, -1.0, 0.0
    for k in range(3):
        lowest, highest = math.inf, -math.inf
        for j in range(start, end):
            middle = 0.5 * (low[order[j], k] + high[order[j], k])
            lowest, highest = min(lowest, middle), max(highest, middle)
        if highest - lowest > width:
            axis, width, origin = k, highest - lowest, lowest
    half = (start + end) // 2
    if not width > 0.0:
        return half, axis

    for b in range(BINS):
        inside[b] = 0.0
        for k in range(3):
            boxes[b, k], boxes[b, 3 + k] = math.inf, -math.inf
    for j in range(start, end):
        i = order[j]
        b = _bin(0.5 * (low[i, axis] + high[i, axis]), origin, width)
        inside[b] += 1.0
        for k in range(3):
            boxes[b, k], boxes[b, 3 + k] = min(boxes[b, k], low[i, k]), max(boxes[b, 3 + k], high[i, k])
    best, plane = math.inf, ZERO
    for b in range(1, BINS):
        cost = _cost(inside, boxes, ZERO, b) + _cost(inside, boxes, b, len(inside))
        if cost < best:
            best, plane = cost, b

    cut = start
    for j in range(start, end):
        i = order[j]
        if _bin(0.5 * (low[i, axis] + high[i, axis]), origin, width) < plane:
            order[j], order[cut] = order[cut], i
            cut += 1
    return half if min(cut - start, end - cut) * LOPSIDED < end - start else cut, axis


@kernel
def _bin(middle: float, origin: float, width: float) -> int:
    return min(BINS - 1, int(BINS * ((middle - origin) / width)))


@kernel
def _cost(inside: FloatArray, boxes: FloatArray, first: int, last: int) -> float:
    """Return the surface area heuristic's cost of bins first to last - 1: triangles times half their box's area."""
    total = 0.0
    x0, y0, z0, x1, y1, z1 = math.inf, math.inf, math.inf, -math.inf, -math.inf, -math.inf
    for b in range(first, last):
        total += inside[b]
        x0, y0, z0 = min(x0, boxes[b, 0]), min(y0, boxes[b, 1]), min(z0, boxes[b, 2])
        x1, y1, z1 = max(x1, boxes[b, 3]), max(y1, boxes[b, 4]), max(z1, boxes[b, 5])
    if total == 0.0:
        return math.inf
    x, y, z = x1 - x0, y1 - y0, z1 - z0
    return total * (x * y + y * z + z * x)


@entry_kernel
def octant(w: Vec3) -> int:
    """Return the octant of a direction: which coordinates fall, as the bits of a number."""
    return int(w.x < 0.0) + 2 * int(w.y < 0.0) + 4 * int(w.z < 0.0)


@kernel
def next_leaf_on_path(nodes: RecordArray, o: int, i: int, p: Vec3, w: Vec3, reach: float) -> int:
    """Return the first leaf from node i on whose box the path p to p + w may meet within ``reach``; -1 if none.

    With ``o`` its octant the path comes to the nearer of two boxes first, so that a collision there spares the other.
    """
    half = scale(w, 0.5)
    middle = add(p, half)
    while i < len(nodes):
        node = nodes[i]
        if not is_on_path(nodes, i, middle, half, reach):
            i = ZERO + node["skips"][o]  # An int64 again, as in what follows.
        elif node["size"] > 0:
            return i
        else:
            i = node["first"] if (o >> node["axis"]) & 1 else i + 1
    return -1


@kernel
def is_on_path(nodes: RecordArray, i: int, middle: Vec3, half: Vec3, reach: float) -> bool:
    """Return whether the path from middle - half to middle + half may come within ``reach`` of the box of node i.

    Separating axes of a segment and a box (C. Ericson, Real-Time Collision Detection, 2005, section 5.3.3): the three
    axes of the box, the direction from the box to the middle of the path, and the cross products; no division.
    """
    node = nodes[i]
    box = vec3(node["half"])
    x, y, z = sub(middle, vec3(node["middle"]))
    ax, ay, az = abs(half.x), abs(half.y), abs(half.z)
    ex, ey, ez = box.x + reach, box.y + reach, box.z + reach
    if abs(x) > ex + ax or abs(y) > ey + ay or abs(z) > ez + az:
        return False
    gap = Vec3(_outside(x, box.x), _outside(y, box.y), _outside(z, box.z))
    distance2 = dot(gap, gap)
    free = distance2 - abs(dot(gap, half))
    return not (
        (free > 0.0 and free * free > reach * reach * distance2)
        or abs(y * half.z - z * half.y) > ey * az + ez * ay
        or abs(z * half.x - x * half.z) > ex * az + ez * ax
        or abs(x * half.y - y * half.x) > ex * ay + ey * ax
    )


@kernel
def _outside(x: float, half: float) -> float:
    """Return how far, and to which side, a coordinate x is outside of -half to half."""
    return x - max(-half, min(half, x))


@kernel
def next_leaf_within(nodes: RecordArray, i: int, p: Vec3, reach: float) -> int:
    """Return the first leaf from node i on whose box is within ``reach`` of the point p; -1 if none.

    ``next_leaf_on_path`` with a path of no length gives the same in 1.3 times the time.
    """
    while i < len(nodes):
        if distance_to_box(nodes, i, p) > reach:
            i = ZERO + nodes[i]["skips"][0]
        elif nodes[i]["size"] > 0:
            return i
        else:
            i += 1
    return -1


@kernel
def nearest_leaf(nodes: RecordArray, p: Vec3) -> int:
    """Return a leaf near the point p, by always going into the nearer child: a first guess, not the nearest."""
    i = ZERO
    while nodes[i]["size"] == 0:
        other = nodes[i]["first"]
        i = i + 1 if distance_to_box(nodes, i + 1, p) <= distance_to_box(nodes, other, p) else other
    return i


@kernel
def distance_to_box(nodes: RecordArray, i: int, p: Vec3) -> float:
    """Return the distance from the point p to the box of node i; 0 inside."""
    way, box = sub(p, vec3(nodes[i]["middle"])), vec3(nodes[i]["half"])
    return norm(Vec3(_outside(way.x, box.x), _outside(way.y, box.y), _outside(way.z, box.z)))
