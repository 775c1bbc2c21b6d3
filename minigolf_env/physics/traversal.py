"""Traversal of the bounding volume hierarchy: the leaves near a swept sphere, or near a point.

The child boxes of a node are tested together with SIMD instructions. Those that are hit are pushed on a stack far to
near, so that the nearest is visited first and an early hit culls the rest. Example: a sphere sweeps from p to
p + w, and w is shortened at each hit that is found. ``inflated_radius`` is the sphere's radius and a margin, by which
the boxes are inflated (Minkowski sum)::

    start_traversal(traversal)  # stack: [root]
    # Pop the root and push its children 5, 2; pop 2, a leaf of triangles 8 to 10.
    first, size = next_leaf_in_sweep(nodes, traversal, p, w, inflated_radius)
    # Pop 5, and test its children against the shorter path; and so on until size is 0.
    first, size = next_leaf_in_sweep(nodes, traversal, p, alpha * w, inflated_radius)

The leaves are a superset of those needed. Which others are visited changes the cost and no first hit. The last bit of a
distance may depend on which of two equally near triangles is found; as the order of visits depends only on the scene
and the query, distances are deterministic too.
"""

from __future__ import annotations

import numpy as np

from minigolf_env.physics.jit import device_function
from minigolf_env.physics.types import BVH_WIDTH, INT64_ZERO, RecordArray, Vec3
from minigolf_env.physics.vec3 import add, column, dot, norm, scale, sub

MAX_STACK_DEPTH = 4096
"""Capacity of the traversal stack. A child has at most 31/32 of its node's triangles (``bvh.MAX_SPLIT_RATIO``), so that
10^8 triangles make at most 540 levels, each of which leaves at most BVH_WIDTH - 1 children on the stack."""

TRAVERSAL_DTYPE = np.dtype(
    [
        ("stack", "i8", (MAX_STACK_DEPTH,)),  # children to visit, coded as in NODE_DTYPE; the next one is on top
        ("stack_size", "i8"),
        ("hit_mask", "i8", (BVH_WIDTH,)),  # 1 for each child of the current node that is hit, else 0
        ("sort_key", "f8", (BVH_WIDTH,)),  # the child with the highest key is visited first
    ]
)
"""State of one traversal."""


def new_traversal() -> RecordArray:
    """Return memory (1,) for the traversals of one thread, one at a time; it needs no initial value."""
    return np.empty(1, TRAVERSAL_DTYPE)


@device_function
def start_traversal(traversal: RecordArray) -> None:
    """Start a traversal with the root alone on the stack."""
    state = traversal[0]
    state["stack"][0] = 0
    state["stack_size"] = 1


@device_function
def next_leaf_in_sweep(
    nodes: RecordArray, traversal: RecordArray, p: Vec3, w: Vec3, inflated_radius: float
) -> tuple[int, int]:
    """Return (first triangle, triangle count) of the next leaf that may be within ``inflated_radius`` of the path.

    The path leads from p to p + w. The count is 0 at the end. Boxes already on the stack are not tested again when the
    path has become shorter.
    """
    while traversal[0]["stack_size"] > 0:
        i = _pop(traversal)
        if i < 0:
            return decode_leaf(i)
        intersect_children_swept_sphere(nodes, i, traversal, p, w, inflated_radius)
        _push_hit_children(nodes, i, traversal)
    return INT64_ZERO, INT64_ZERO


@device_function
def next_leaf_in_radius(nodes: RecordArray, traversal: RecordArray, p: Vec3, distance: float) -> tuple[int, int]:
    """Return the next leaf whose box is within ``distance`` of the point p: first triangle, triangle count or 0."""
    while traversal[0]["stack_size"] > 0:
        i = _pop(traversal)
        if i < 0:
            return decode_leaf(i)
        _intersect_children_sphere(nodes, i, traversal, p, distance)
        _push_hit_children(nodes, i, traversal)
    return INT64_ZERO, INT64_ZERO


@device_function
def decode_leaf(child: int) -> tuple[int, int]:
    """Return the first triangle and the number of triangles of a leaf, from its negative code in NODE_DTYPE."""
    return -child // BVH_WIDTH, -child % BVH_WIDTH


@device_function
def _pop(traversal: RecordArray) -> int:
    """Remove the child on top of the stack and return it."""
    state = traversal[0]
    state["stack_size"] -= 1
    child: int = state["stack"][state["stack_size"]]
    return child


@device_function
def _push_hit_children(nodes: RecordArray, i: int, traversal: RecordArray) -> None:
    """Push the children of node i that ``hit_mask`` names, in ascending order of ``sort_key``: the nearest on top."""
    node = nodes[i]
    state = traversal[0]
    stack = state["stack"]
    sort_key = state["sort_key"]

    # Push the slots of the children that are hit; branch-free.
    first = INT64_ZERO + state["stack_size"]
    end = first
    for k in range(BVH_WIDTH):
        stack[end] = k
        end += state["hit_mask"][k]

    # Sort them by insertion.
    for j in range(first + 1, end):
        k = stack[j]
        place = j
        while place > first and sort_key[stack[place - 1]] > sort_key[k]:
            stack[place] = stack[place - 1]
            place -= 1
        stack[place] = k

    # Replace the slots by the children in them.
    for j in range(first, end):
        stack[j] = node["child"][stack[j]]
    state["stack_size"] = end


@device_function
def intersect_children_swept_sphere(
    nodes: RecordArray, i: int, traversal: RecordArray, p: Vec3, w: Vec3, inflated_radius: float
) -> None:
    """Intersect the boxes of node i, inflated, with the path p to p + w: set hit mask and sort keys.

    Separating axes of a segment and a box (C. Ericson, Real-Time Collision Detection, 2005, section 5.3.3): the three
    axes of the box, the direction from the box to the middle of the path, and the cross products. There is no division
    and no branch. The centre of an empty slot is NaN, with which every comparison fails: it is not hit.
    """
    node = nodes[i]
    state = traversal[0]
    half = scale(w, 0.5)
    middle = add(p, half)
    ax, ay, az = abs(half.x), abs(half.y), abs(half.z)
    for k in range(node["num_slots"]):
        box = column(node["half_extent"], k)
        to_middle = sub(middle, column(node["center"], k))
        x, y, z = to_middle
        ex, ey, ez = box.x + inflated_radius, box.y + inflated_radius, box.z + inflated_radius

        # The axes of the box.
        overlaps = (abs(x) <= ex + ax) & (abs(y) <= ey + ay) & (abs(z) <= ez + az)

        # The direction from the box to the middle of the path, squared to avoid the division by its length.
        box_to_middle = _box_to_point(to_middle, box)
        distance_sq = dot(box_to_middle, box_to_middle)
        clearance = distance_sq - abs(dot(box_to_middle, half))
        separated = (clearance > 0.0) & (clearance * clearance > inflated_radius * inflated_radius * distance_sq)

        # The cross products of the box's axes and the path.
        separated |= abs(y * half.z - z * half.y) > ey * az + ez * ay
        separated |= abs(z * half.x - x * half.z) > ex * az + ez * ax
        separated |= abs(x * half.y - y * half.x) > ex * ay + ey * ax

        state["hit_mask"][k] = overlaps & (not separated)
        state["sort_key"][k] = dot(to_middle, w)


@device_function
def _intersect_children_sphere(nodes: RecordArray, i: int, traversal: RecordArray, p: Vec3, radius: float) -> None:
    """Intersect the children of node i with the sphere around p of radius ``radius``: set hit mask and sort keys."""
    node = nodes[i]
    state = traversal[0]
    for k in range(node["num_slots"]):
        distance = norm(_box_to_point(sub(p, column(node["center"], k)), column(node["half_extent"], k)))
        state["hit_mask"][k] = distance <= radius
        state["sort_key"][k] = -distance


@device_function
def _box_to_point(point: Vec3, half_extent: Vec3) -> Vec3:
    """Return the vector from the closest point of a box to a point that is given relative to the box's centre."""
    return Vec3(
        _clamp_residual(point.x, half_extent.x),
        _clamp_residual(point.y, half_extent.y),
        _clamp_residual(point.z, half_extent.z),
    )


@device_function
def _clamp_residual(x: float, limit: float) -> float:
    """Return x minus x clamped to [-limit, limit]."""
    return x - max(-limit, min(limit, x))
