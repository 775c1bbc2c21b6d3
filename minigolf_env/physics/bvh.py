"""Construction of the bounding volume hierarchy (BVH), 8 children wide, by the surface area heuristic (SAH).

Each split divides one child in two. A node begins with one child that holds all its triangles; the child with the
largest box is split until there are 8, which takes 7 splits, or until all are small enough to be leaves. traversal.py
visits the nodes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.types import BVH_WIDTH, INT64_ONE, INT64_ZERO, NODE_DTYPE, FloatArray, RecordArray, Vec3
from minigolf_env.physics.vec3 import column, store_column

MAX_LEAF_SIZE = 4
"""Maximum number of triangles in a leaf; below BVH_WIDTH, see NODE_DTYPE. Smaller leaves cost more nodes, larger ones
more triangle tests."""

NUM_SAH_BINS = 16
"""Number of bins of a split, as in I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007."""

MAX_SPLIT_RATIO = 32
"""Maximum ratio of a range's triangles to those of its smaller part. A more uneven split is replaced by halves:
building stays O(n log n), and no child has more than 31/32 of its node's triangles, which bounds the depth."""

MIN_HALF_EXTENT = 2.0**-1022
"""Smallest normal float64, added to a half extent, m: the extent of a flat box stays positive when it is rounded up."""


def build_bvh(triangles: FloatArray) -> tuple[RecordArray, NDArray[np.int64]]:
    """Build the hierarchy over n >= 1 triangles (n, 3, 3); return its nodes and the order (n,) of its leaves."""
    n = len(triangles)
    low = triangles.min(axis=1)
    high = triangles.max(axis=1)
    order = np.arange(n)
    # A node of leaves alone has more than MAX_LEAF_SIZE triangles, unless it is the root; the others have BVH_WIDTH
    # children: at most 8 n / 35 nodes in all.
    nodes = np.zeros(n // 4 + 1, NODE_DTYPE)
    build_stack = np.empty((len(nodes), 4), np.int64)
    child_ranges = np.empty((BVH_WIDTH, 2), np.int64)
    count = _build(
        low, high, order, nodes, build_stack, child_ranges, np.empty(NUM_SAH_BINS), np.empty((NUM_SAH_BINS, 6))
    )
    return nodes[:count].copy(), order


@kernel
def _build(
    low: FloatArray,
    high: FloatArray,
    order: NDArray[np.int64],
    nodes: RecordArray,
    build_stack: NDArray[np.int64],
    child_ranges: NDArray[np.int64],
    bin_counts: FloatArray,
    bin_boxes: FloatArray,
) -> int:
    """Fill in the nodes, sort ``order``, return the number of nodes; the other arrays are scratch.

    A row of ``build_stack`` (N, 4) is a node to build: its first triangle, one past its last, and the slot that refers
    to it, as the parent's row and the slot's number. ``child_ranges`` (BVH_WIDTH, 2) are the triangles of the children
    of the current node so far.
    """
    build_stack[0, 0] = 0
    build_stack[0, 1] = len(order)
    build_stack[0, 2] = 0
    build_stack[0, 3] = 0
    stack_size = INT64_ONE
    count = INT64_ZERO
    while stack_size > 0:
        # Pop a range of triangles, and begin a node with one child that holds it all.
        stack_size -= 1
        nodes[build_stack[stack_size, 2]]["child"][build_stack[stack_size, 3]] = count
        node = nodes[count]
        node["num_slots"] = BVH_WIDTH
        for k in range(BVH_WIDTH):
            store_column(node["center"], k, Vec3(math.nan, math.nan, math.nan))
        child_ranges[0, 0] = build_stack[stack_size, 0]
        child_ranges[0, 1] = build_stack[stack_size, 1]
        _compute_child_bounds(low, high, order, child_ranges, INT64_ZERO, node)

        # Split the child with the largest box in two until the node is full or all children are leaves.
        num_children = INT64_ONE
        k = _choose_child_to_split(child_ranges, num_children, node)
        while k >= 0:
            start = child_ranges[k, 0]
            end = child_ranges[k, 1]
            cut = _split(order, start, end, low, high, bin_counts, bin_boxes)
            child_ranges[k, 1] = cut
            child_ranges[num_children, 0] = cut
            child_ranges[num_children, 1] = end
            _compute_child_bounds(low, high, order, child_ranges, k, node)
            _compute_child_bounds(low, high, order, child_ranges, num_children, node)
            num_children += 1
            k = _choose_child_to_split(child_ranges, num_children, node)

        # Enter each child as a leaf; push those that are too large, which become nodes when they are popped.
        for k in range(num_children):
            start = child_ranges[k, 0]
            size = child_ranges[k, 1] - start
            node["child"][k] = -(BVH_WIDTH * start + size)
            if size > MAX_LEAF_SIZE:
                build_stack[stack_size, 0] = start
                build_stack[stack_size, 1] = start + size
                build_stack[stack_size, 2] = count
                build_stack[stack_size, 3] = k
                stack_size += 1
        count += 1
    return count


@device_function
def _choose_child_to_split(child_ranges: NDArray[np.int64], num_children: int, node: np.void) -> int:
    """Return the child with the largest box among those too large for a leaf; -1 if there is none or no free slot."""
    best_area = -1.0
    best = -INT64_ONE
    for k in range(num_children if num_children < BVH_WIDTH else 0):
        area = _half_area(column(node["half_extent"], k))
        if child_ranges[k, 1] - child_ranges[k, 0] > MAX_LEAF_SIZE and area > best_area:
            best_area = area
            best = INT64_ZERO + k
    return best


@device_function
def _compute_child_bounds(
    low: FloatArray, high: FloatArray, order: NDArray[np.int64], child_ranges: NDArray[np.int64], k: int, node: np.void
) -> None:
    """Set the box of a node's child k to the bounds of its triangles."""
    for axis in range(3):
        lowest, highest = math.inf, -math.inf
        for j in range(child_ranges[k, 0], child_ranges[k, 1]):
            lowest = min(lowest, low[order[j], axis])
            highest = max(highest, high[order[j], axis])
        center = 0.5 * (lowest + highest)
        node["center"][axis, k] = center
        # Grown by the rounding error of the centre: no vertex may stick out.
        node["half_extent"][axis, k] = max(highest - center, center - lowest) * (1.0 + 2.0**-52) + MIN_HALF_EXTENT


@device_function
def _split(
    order: NDArray[np.int64],
    start: int,
    end: int,
    low: FloatArray,
    high: FloatArray,
    bin_counts: FloatArray,
    bin_boxes: FloatArray,
) -> int:
    """Partition order[start:end] at the cheapest binned plane; return where the upper part starts.

    Triangles whose boxes have the same centre cannot be partitioned by a plane: they are halved.
    """
    # Choose the axis along which the boxes' centres are spread most.
    axis = INT64_ZERO
    spread = -1.0
    origin = 0.0
    for k in range(3):
        lowest, highest = math.inf, -math.inf
        for j in range(start, end):
            center = 0.5 * (low[order[j], k] + high[order[j], k])
            lowest = min(lowest, center)
            highest = max(highest, center)
        if highest - lowest > spread:
            axis = k
            spread = highest - lowest
            origin = lowest
    half = (start + end) // 2
    if not spread > 0.0:
        return half

    # Put the triangles into bins along it.
    for b in range(NUM_SAH_BINS):
        bin_counts[b] = 0.0
        for k in range(3):
            bin_boxes[b, k] = math.inf
            bin_boxes[b, 3 + k] = -math.inf
    for j in range(start, end):
        i = order[j]
        b = _bin_index(0.5 * (low[i, axis] + high[i, axis]), origin, spread)
        bin_counts[b] += 1.0
        for k in range(3):
            bin_boxes[b, k] = min(bin_boxes[b, k], low[i, k])
            bin_boxes[b, 3 + k] = max(bin_boxes[b, 3 + k], high[i, k])

    # Choose the plane between two bins that costs least.
    best_cost = math.inf
    plane = INT64_ZERO
    for b in range(1, NUM_SAH_BINS):
        cost = _sah_cost(bin_counts, bin_boxes, INT64_ZERO, b) + _sah_cost(bin_counts, bin_boxes, b, len(bin_counts))
        if cost < best_cost:
            best_cost = cost
            plane = b

    # Partition the triangles at the plane, or halve them if that is too uneven.
    cut = start
    for j in range(start, end):
        i = order[j]
        if _bin_index(0.5 * (low[i, axis] + high[i, axis]), origin, spread) < plane:
            order[j] = order[cut]
            order[cut] = i
            cut += 1
    return half if min(cut - start, end - cut) * MAX_SPLIT_RATIO < end - start else cut


@device_function
def _bin_index(center: float, origin: float, spread: float) -> int:
    """Return the bin of a coordinate in origin to origin + spread."""
    return min(NUM_SAH_BINS - 1, int(NUM_SAH_BINS * ((center - origin) / spread)))


@device_function
def _sah_cost(bin_counts: FloatArray, bin_boxes: FloatArray, first: int, last: int) -> float:
    """Return the SAH cost of bins first to last - 1: the triangles times half the area of their box; inf if empty."""
    total = 0.0
    x0, y0, z0 = math.inf, math.inf, math.inf
    x1, y1, z1 = -math.inf, -math.inf, -math.inf
    for b in range(first, last):
        total += bin_counts[b]
        x0, y0, z0 = min(x0, bin_boxes[b, 0]), min(y0, bin_boxes[b, 1]), min(z0, bin_boxes[b, 2])
        x1, y1, z1 = max(x1, bin_boxes[b, 3]), max(y1, bin_boxes[b, 4]), max(z1, bin_boxes[b, 5])
    if total == 0.0:
        return math.inf
    return total * _half_area(Vec3(x1 - x0, y1 - y0, z1 - z0))


@device_function
def _half_area(extents: Vec3) -> float:
    """Return half the surface area of a box, given its extents along the axes."""
    return extents.x * extents.y + extents.y * extents.z + extents.z * extents.x
