"""The broad phase: a bounding volume hierarchy over the triangles, walked without a stack.

Nodes stand in depth-first order, so a walk either goes on to the next node (into a subtree) or to ``skip`` (past it).
A query visits a superset of the triangles it needs; which ones never changes an answer, only its cost.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.kernel import allocating_kernel, kernel
from minigolf_env.physics.types import FloatArray, Tree, Vec3

LEAF = 4
"""Triangles in a leaf: fewer cost more nodes, more cost more triangle tests."""

BINS = 16
"""Candidate planes of a split, as in I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007."""

LOPSIDED = 32
"""A split that leaves less than this fraction on one side is replaced by a median: building stays n log n."""


@allocating_kernel
def build_tree(triangles: FloatArray) -> tuple[Tree, NDArray[np.int64]]:
    """Build the hierarchy over triangles (n, 3, 3), n >= 1; return it and the order (n,) its leaves hold them in."""
    n = len(triangles)
    low, high, middle = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        for k in range(3):
            low[i, k] = min(triangles[i, 0, k], triangles[i, 1, k], triangles[i, 2, k])
            high[i, k] = max(triangles[i, 0, k], triangles[i, 1, k], triangles[i, 2, k])
            middle[i, k] = 0.5 * (low[i, k] + high[i, k])
    order = np.arange(n)
    box, skip = np.empty((2 * n, 6)), np.empty(2 * n, np.int32)
    first, count = np.full(2 * n, -1, np.int32), np.zeros(2 * n, np.int32)
    todo = [(0, n)]
    nodes = 0
    while len(todo) > 0:
        start, end = todo.pop()
        for k in range(3):
            lowest, highest = np.inf, -np.inf
            for i in order[start:end]:
                lowest, highest = min(lowest, low[i, k]), max(highest, high[i, k])
            box[nodes, k] = 0.5 * (lowest + highest)
            # Rounding of the middle must not let a corner stick out.
            box[nodes, 3 + k] = np.nextafter(max(highest - box[nodes, k], box[nodes, k] - lowest), np.inf)
        if end - start <= LEAF:
            first[nodes], count[nodes] = start, end - start
        else:
            cut = _split(order, start, end, low, high, middle)
            todo.append((cut, end))
            todo.append((start, cut))
        nodes += 1
    for i in range(nodes - 1, -1, -1):
        skip[i] = i + 1 if count[i] > 0 else skip[skip[i + 1]]
    return Tree(box[:nodes].copy(), skip[:nodes].copy(), first[:nodes].copy(), count[:nodes].copy()), order


@allocating_kernel
def _split(
    order: NDArray[np.int64], start: int, end: int, low: FloatArray, high: FloatArray, middle: FloatArray
) -> int:
    """Reorder order[start:end] around the cheapest of the binned planes; return where the second half starts."""
    axis, width, origin = 0, -1.0, 0.0
    for k in range(3):
        lowest, highest = np.inf, -np.inf
        for i in order[start:end]:
            lowest, highest = min(lowest, middle[i, k]), max(highest, middle[i, k])
        if highest - lowest > width:
            axis, width, origin = k, highest - lowest, lowest
    half = (start + end) // 2
    if not width > 0.0:
        return half

    inside = np.zeros(BINS, np.int64)
    boxes = np.empty((BINS, 6))
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    for i in order[start:end]:
        b = min(BINS - 1, int(BINS * ((middle[i, axis] - origin) / width)))
        inside[b] += 1
        for k in range(3):
            boxes[b, k], boxes[b, 3 + k] = min(boxes[b, k], low[i, k]), max(boxes[b, 3 + k], high[i, k])
    best, plane = np.inf, 0
    for b in range(1, BINS):
        cost = _cost(inside[:b], boxes[:b]) + _cost(inside[b:], boxes[b:])
        if cost < best:
            best, plane = cost, b

    cut = start
    for j in range(start, end):
        i = order[j]
        if min(BINS - 1, int(BINS * ((middle[i, axis] - origin) / width))) < plane:
            order[j], order[cut] = order[cut], i
            cut += 1
    if min(cut - start, end - cut) * LOPSIDED < end - start:
        order[start:end] = order[start:end][np.argsort(middle[order[start:end], axis], kind="mergesort")]
        return half
    return cut


@allocating_kernel
def _cost(inside: NDArray[np.int64], boxes: FloatArray) -> float:
    """Return the surface area heuristic's cost of one side: triangles times the area of their box."""
    if inside.sum() == 0:
        return np.inf
    x = boxes[:, 3].max() - boxes[:, 0].min()
    y = boxes[:, 4].max() - boxes[:, 1].min()
    z = boxes[:, 5].max() - boxes[:, 2].min()
    return float(inside.sum() * (x * y + y * z + z * x))


@kernel
def next_leaf_on_path(tree: Tree, node: int, p: Vec3, w: Vec3, reach: float) -> int:
    """Return the first leaf from ``node`` on whose box, grown by ``reach``, the path p to p + w meets; -1 if none.

    A separating-axis test of a segment with a box: three box axes, three cross products; no division, no special case
    for a path along an axis (C. Ericson, Real-Time Collision Detection, 2005, section 5.3.3).
    """
    hx, hy, hz = 0.5 * w.x, 0.5 * w.y, 0.5 * w.z
    ax, ay, az = abs(hx), abs(hy), abs(hz)
    mx, my, mz = p.x + hx, p.y + hy, p.z + hz
    while node < len(tree.skip):
        x, y, z = mx - tree.box[node, 0], my - tree.box[node, 1], mz - tree.box[node, 2]
        ex, ey, ez = tree.box[node, 3] + reach, tree.box[node, 4] + reach, tree.box[node, 5] + reach
        if (
            abs(x) > ex + ax
            or abs(y) > ey + ay
            or abs(z) > ez + az
            or abs(y * hz - z * hy) > ey * az + ez * ay
            or abs(z * hx - x * hz) > ex * az + ez * ax
            or abs(x * hy - y * hx) > ex * ay + ey * ax
        ):
            node = tree.skip[node]
        elif tree.size[node] > 0:
            return node
        else:
            node += 1
    return -1


@kernel
def next_leaf_within(tree: Tree, node: int, p: Vec3, reach: float) -> int:
    """Return the first leaf from ``node`` on whose box is within ``reach`` of the point p; -1 if none."""
    while node < len(tree.skip):
        if distance_to_box(tree, node, p) > reach:
            node = tree.skip[node]
        elif tree.size[node] > 0:
            return node
        else:
            node += 1
    return -1


@kernel
def nearest_leaf(tree: Tree, p: Vec3) -> int:
    """Return a leaf near the point p, by always going into the nearer child: a first guess, not the nearest."""
    node = 0
    while tree.size[node] == 0:
        other = tree.skip[node + 1]
        node = node + 1 if distance_to_box(tree, node + 1, p) <= distance_to_box(tree, other, p) else other
    return node


@kernel
def distance_to_box(tree: Tree, node: int, p: Vec3) -> float:
    """Return the distance from the point p to a node's box; 0 inside."""
    x = max(0.0, abs(p.x - tree.box[node, 0]) - tree.box[node, 3])
    y = max(0.0, abs(p.y - tree.box[node, 1]) - tree.box[node, 4])
    z = max(0.0, abs(p.z - tree.box[node, 2]) - tree.box[node, 5])
    return math.sqrt(x * x + y * y + z * z)
