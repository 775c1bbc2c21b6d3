"""The broad phase: a bounding volume hierarchy over the triangles, with up to eight boxes in each node.

A node's boxes are told apart together, in vector instructions. A walk keeps what it has yet to look into on a stack,
the nearest on top, so that a collision there spares what is behind. A query visits a superset of the triangles it
needs; which ones never changes an answer, only its cost.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.kernel import entry_kernel, kernel
from minigolf_env.physics.types import NODE, WIDTH, ZERO, FloatArray, RecordArray, Vec3
from minigolf_env.physics.vec3 import add, column, dot, norm, put, scale, sub

LEAF = 4
"""Triangles in a leaf: fewer cost more nodes, more cost more triangle tests."""

BINS = 16
"""Candidate planes of a split, as in I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007."""

LOPSIDED = 32
"""A split that leaves less than this fraction on one side is replaced by halves: building stays n log n."""

TINY = 2.0**-1022
"""The smallest half extent, m: rounding up a zero."""

STACK = 4096
"""Places on a walk's stack. A box has at most 1 - 1 / LOPSIDED of its node's triangles, so that 10^8 triangles make 540
levels at most, each of which leaves WIDTH - 1 boxes to look into."""

WALK = np.dtype(
    [
        ("stack", "i8", (STACK,)),
        ("near", "i8", (WIDTH,)),
        ("order", "f8", (WIDTH,)),
        ("waiting", "i8"),
    ]
)
"""A walk through the tree: a stack of what is to be looked into, as a node's ``inside`` names it, the nearest on top,
and how many wait there; which boxes of a node are near, and their order: the highest is looked into first."""


def new_walk() -> RecordArray:
    """Return memory (1,) for the walks of one thread."""
    return np.zeros(1, WALK)


def build_tree(corners: FloatArray) -> tuple[RecordArray, NDArray[np.int64]]:
    """Build the hierarchy over n >= 1 triangles (n, 3, 3); return its nodes and the order (n,) of its leaves."""
    n = len(corners)
    low, high, order = corners.min(axis=1), corners.max(axis=1), np.arange(n)
    # Nodes of leaves alone have at least LEAF + 1 triangles each, the others WIDTH boxes: fewer than n / 5 + n / 7.
    nodes = np.zeros(n // 2 + 1, NODE)
    todo = np.empty((len(nodes), 4), np.int64)
    count = _build(low, high, order, nodes, todo, np.empty((WIDTH, 2), np.int64), np.empty(BINS), np.empty((BINS, 6)))
    return nodes[:count].copy(), order


@entry_kernel
def _build(
    low: FloatArray,
    high: FloatArray,
    order: NDArray[np.int64],
    nodes: RecordArray,
    todo: NDArray[np.int64],
    parts: NDArray[np.int64],
    counts: FloatArray,
    boxes: FloatArray,
) -> int:
    """Fill in the nodes, sort ``order``, return the number of nodes; the other arrays are scratch."""
    todo[0, 0], todo[0, 1], todo[0, 2], todo[0, 3] = 0, len(order), 0, 0
    waiting, count = ZERO + 1, ZERO
    while waiting > 0:
        waiting -= 1
        nodes[todo[waiting, 2]]["inside"][todo[waiting, 3]] = count
        node = nodes[count]
        node["width"] = WIDTH
        for k in range(WIDTH):
            put(node["middle"], k, Vec3(math.nan, math.nan, math.nan))
        parts[0, 0], parts[0, 1] = todo[waiting, 0], todo[waiting, 1]
        _enclose(low, high, order, parts, ZERO, node)
        number, k = ZERO + 1, _largest(parts, ZERO + 1, node)
        while k >= 0:
            start, end = parts[k, 0], parts[k, 1]
            cut = _split(order, start, end, low, high, counts, boxes)
            parts[k, 1], parts[number, 0], parts[number, 1] = cut, cut, end
            _enclose(low, high, order, parts, k, node)
            _enclose(low, high, order, parts, number, node)
            number += 1
            k = _largest(parts, number, node)
        for k in range(number):
            start, size = parts[k, 0], parts[k, 1] - parts[k, 0]
            node["inside"][k] = -(WIDTH * start + size)
            if size > LEAF:
                todo[waiting, 0], todo[waiting, 1], todo[waiting, 2], todo[waiting, 3] = start, start + size, count, k
                waiting += 1
        count += 1
    return count


@kernel
def _largest(parts: NDArray[np.int64], number: int, node: np.void) -> int:
    """Return which part of a node to split next, of those that are no leaves: that of the largest box; -1 for none."""
    best, largest = -1.0, -ZERO - 1
    for k in range(number if number < WIDTH else 0):
        x, y, z = column(node["half"], k)
        area = x * y + y * z + z * x
        if parts[k, 1] - parts[k, 0] > LEAF and area > best:
            best, largest = area, ZERO + k
    return largest


@kernel
def _enclose(
    low: FloatArray, high: FloatArray, order: NDArray[np.int64], parts: NDArray[np.int64], k: int, node: np.void
) -> None:
    """Make a node's box k that of the triangles in its part k."""
    for axis in range(3):
        lowest, highest = math.inf, -math.inf
        for j in range(parts[k, 0], parts[k, 1]):
            lowest, highest = min(lowest, low[order[j], axis]), max(highest, high[order[j], axis])
        middle = 0.5 * (lowest + highest)
        node["middle"][axis, k] = middle
        # Rounding of the middle must not let a corner stick out.
        node["half"][axis, k] = max(highest - middle, middle - lowest) * (1.0 + 2.0**-52) + TINY


@kernel
def _split(
    order: NDArray[np.int64],
    start: int,
    end: int,
    low: FloatArray,
    high: FloatArray,
    counts: FloatArray,
    boxes: FloatArray,
) -> int:
    """Reorder order[start:end] around the cheapest binned plane; return where the upper part starts.

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
        return half

    for b in range(BINS):
        counts[b] = 0.0
        for k in range(3):
            boxes[b, k], boxes[b, 3 + k] = math.inf, -math.inf
    for j in range(start, end):
        i = order[j]
        b = _bin(0.5 * (low[i, axis] + high[i, axis]), origin, width)
        counts[b] += 1.0
        for k in range(3):
            boxes[b, k], boxes[b, 3 + k] = min(boxes[b, k], low[i, k]), max(boxes[b, 3 + k], high[i, k])
    best, plane = math.inf, ZERO
    for b in range(1, BINS):
        cost = _cost(counts, boxes, ZERO, b) + _cost(counts, boxes, b, len(counts))
        if cost < best:
            best, plane = cost, b

    cut = start
    for j in range(start, end):
        i = order[j]
        if _bin(0.5 * (low[i, axis] + high[i, axis]), origin, width) < plane:
            order[j], order[cut] = order[cut], i
            cut += 1
    return half if min(cut - start, end - cut) * LOPSIDED < end - start else cut


@kernel
def _bin(middle: float, origin: float, width: float) -> int:
    return min(BINS - 1, int(BINS * ((middle - origin) / width)))


@kernel
def _cost(counts: FloatArray, boxes: FloatArray, first: int, last: int) -> float:
    """Return the surface area heuristic's cost of bins first to last - 1: triangles times half their box's area."""
    total = 0.0
    x0, y0, z0, x1, y1, z1 = math.inf, math.inf, math.inf, -math.inf, -math.inf, -math.inf
    for b in range(first, last):
        total += counts[b]
        x0, y0, z0 = min(x0, boxes[b, 0]), min(y0, boxes[b, 1]), min(z0, boxes[b, 2])
        x1, y1, z1 = max(x1, boxes[b, 3]), max(y1, boxes[b, 4]), max(z1, boxes[b, 5])
    if total == 0.0:
        return math.inf
    x, y, z = x1 - x0, y1 - y0, z1 - z0
    return total * (x * y + y * z + z * x)


@kernel
def begin(walk: RecordArray) -> None:
    """Begin a walk, with nothing but the root to look into."""
    walk[0]["stack"][0], walk[0]["waiting"] = 0, 1


@kernel
def next_leaf_on_path(nodes: RecordArray, walk: RecordArray, p: Vec3, w: Vec3, reach: float) -> tuple[int, int]:
    """Return the walk's next leaf whose box the path p to p + w may meet within ``reach``: first triangle and number.

    The number is 0 when there is none. A box that was near to a longer path is still looked into, or its triangles are.
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


@entry_kernel
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
    end = first
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
    branch. A box is off only if it surely is: not for what is no number, but where there is no box.
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
