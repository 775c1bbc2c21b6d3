"""The broad phase: how a bounding volume hierarchy over the triangles is built, with up to eight boxes in each node.

It is binary splits by the surface area heuristic, of which a node takes seven at once: ``walk.py`` looks into it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.jit import entry_kernel, kernel
from minigolf_env.physics.types import NODE, WIDTH, ZERO, FloatArray, RecordArray, Vec3
from minigolf_env.physics.vec3 import column, put

LEAF = 4
"""Triangles in a leaf: fewer cost more nodes, more cost more triangle tests. Less than WIDTH, see NODE."""

BINS = 16
"""Candidate planes of a split, as in I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007."""

LOPSIDED = 32
"""A split that leaves less than this fraction on one side is replaced by halves: building stays n log n, and no box has
more than the rest of its node's triangles, so that the tree is not deep."""

TINY = 2.0**-1022
"""The smallest half extent, m: rounding up a zero."""


def build_tree(corners: FloatArray) -> tuple[RecordArray, NDArray[np.int64]]:
    """Build the hierarchy over n >= 1 triangles (n, 3, 3); return its nodes and the order (n,) of its leaves."""
    n = len(corners)
    low, high, order = corners.min(axis=1), corners.max(axis=1), np.arange(n)
    # Nodes of leaves alone, if not the root, have LEAF + 1 triangles, the others WIDTH boxes: at most 8 n / 35 in all.
    nodes = np.zeros(n // 4 + 1, NODE)
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
    """Fill in the nodes, sort ``order``, return the number of nodes; the other arrays are scratch.

    Of each node ``todo`` (N, 4) holds the first of its triangles, one past the last, and in whose box it is: the node's
    row and the box. ``parts`` (WIDTH, 2) are the triangles of the boxes so far. Every box begins as a leaf.
    """
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
                todo[waiting, 0], todo[waiting, 1], todo[waiting, 2], todo[waiting, 3] = start, parts[k, 1], count, k
                waiting += 1
        count += 1
    return count


@kernel
def _largest(parts: NDArray[np.int64], number: int, node: np.void) -> int:
    """Return which part of a node to split next, of those that are no leaves: that of the largest box; -1 for none."""
    best, largest = -1.0, -ZERO - 1
    for k in range(number if number < WIDTH else 0):
        area = _half_area(column(node["half"], k))
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
    return total * _half_area(Vec3(x1 - x0, y1 - y0, z1 - z0))


@kernel
def _half_area(box: Vec3) -> float:
    """Return half the area of a box, given its extents."""
    return box.x * box.y + box.y * box.z + box.z * box.x
