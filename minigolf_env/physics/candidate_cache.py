"""The candidate cache: the triangles near the ball, kept from one sub-step to the next.

The cache holds a bounding cylinder and every triangle that a ball can touch while its centre is in the cylinder. A
sweep whose path starts and ends in the cylinder tests these candidates instead of traversing the BVH: none in flight,
one or two of the floor while rolling. Example: a ball rolls 1 cm a step over a flat floor::

    step 1: the cache is empty     -> collect the triangles around the next 8 steps (8 cm): 2 of the floor, sweep them
    step 2 to 8: in the cylinder   -> sweep the 2 candidates
    step 9: leaves the cylinder    -> collect the triangles around the next 8 steps

The first hit does not depend on which other triangles are tested. So the results are those of ``sweep``, bit for bit,
whatever the cache holds and whichever ball used it before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.cylinder import (
    CYLINDER_MARGIN,
    BoundingCylinder,
    bounding_cylinder,
    cylinder_contains,
    query_radius,
)
from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.sweep import Collision, no_hit, sweep, update_first_hit
from minigolf_env.physics.swept_sphere import CULLING_MARGIN, may_overlap
from minigolf_env.physics.traversal import decode_leaf, intersect_children_swept_sphere, new_traversal
from minigolf_env.physics.types import BVH_WIDTH, INT64_ONE, INT64_ZERO, CompiledScene, RecordArray, Vec3
from minigolf_env.physics.vec3 import add, column, norm, scale, store, store_column, sub, vec3

SINGLE_STEP_CAPACITY = 64
"""Maximum number of candidates in a cylinder around one path. With more, testing them in each sub-step costs more than
traversing the BVH."""

MULTI_STEP_CAPACITY = 24
"""Maximum number of candidates in a cylinder around several paths. With more, testing them all in each sub-step costs
more than collecting the fewer candidates for each path again."""

MAX_CANDIDATES = 2 * SINGLE_STEP_CAPACITY
"""Maximum number of triangles that the leaves near a path may hold before they are filtered."""

MAX_QUEUED_NODES = 2 * MAX_CANDIDATES
"""Maximum number of BVH nodes and leaves that collecting candidates may visit."""

MAX_LOOKAHEAD_STEPS = 8.0
"""Maximum length of a cylinder, in paths like the current one: longer ones collect too many triangles that the ball
never reaches."""

DROP_FACTOR = 0.52
"""Depth below the ground of the end of a rolling ball's path, divided by g dt^2: 1/2 and a margin. A path that is k
times as long ends k times as deep."""

DEFLECTION_RATIO = 1e-4
"""Sideways deflection of a path by resistance and slopes that its cylinder allows for, divided by the length."""

CACHE_STATE_DTYPE = np.dtype(
    [
        ("base", "f8", (3,)),  # the cylinder, as in BoundingCylinder; its length is negative while there is none
        ("axis", "f8", (3,)),
        ("length", "f8"),
        ("radius_sq", "f8"),
        ("lookahead_steps", "f8"),  # length of the next cylinder, in paths
        ("num_candidates", "i8"),
        ("last_hit", "i8"),  # row of the triangle that was hit last; 0 at first
    ]
)
"""Cylinder and counters of a candidate cache."""

CANDIDATE_LIST_DTYPE = np.dtype(
    [
        ("a", "f8", (3, MAX_CANDIDATES)),  # what ``may_overlap`` needs of each triangle, a column each
        ("n", "f8", (3, MAX_CANDIDATES)),
        ("dual_u", "f8", (3, MAX_CANDIDATES)),
        ("dual_v", "f8", (3, MAX_CANDIDATES)),
        ("row", "i8", (MAX_CANDIDATES,)),  # row of the triangle in the scene
        ("mask", "i8", (MAX_CANDIDATES,)),  # 1 where ``may_overlap`` is true, else 0
        ("rows_to_test", "i8", (2 * SINGLE_STEP_CAPACITY,)),  # of one sweep: for faces first, then again for edges
        ("node_queue", "i8", (MAX_QUEUED_NODES + BVH_WIDTH,)),  # of one search for candidates
    ]
)
"""Candidates of a cache, as columns for SIMD loops, and the queues of the loops over them."""


class CandidateCache(NamedTuple):
    """Candidate cache of one thread."""

    state: RecordArray
    """(1,) record of CACHE_STATE_DTYPE."""
    candidates: RecordArray
    """(1,) record of CANDIDATE_LIST_DTYPE."""
    traversal: RecordArray
    """(1,) record of TRAVERSAL_DTYPE, for sweeps through the BVH."""


def new_candidate_cache() -> CandidateCache:
    """Return an empty cache for one thread."""
    state = np.zeros(1, CACHE_STATE_DTYPE)
    invalidate(state)
    return CandidateCache(state, np.zeros(1, CANDIDATE_LIST_DTYPE), new_traversal())


def invalidate(state: RecordArray) -> None:
    """Empty a cache, as is necessary before it is used in another scene."""
    state["length"] = -1.0
    state["lookahead_steps"] = MAX_LOOKAHEAD_STEPS
    state["last_hit"] = 0


@kernel
def sweep_cached(scene: CompiledScene, cache: CandidateCache, p: Vec3, w: Vec3) -> Collision:
    """Return the same first hit as ``sweep``, from cached candidates where possible."""
    # Collect new candidates if the path leaves the cylinder; traverse the BVH if there are too many.
    state = cache.state[0]
    cylinder = BoundingCylinder(vec3(state["base"]), vec3(state["axis"]), state["length"], state["radius_sq"])
    is_cached = cylinder_contains(cylinder, p) and cylinder_contains(cylinder, add(p, w))
    if not is_cached and not _rebuild(scene, cache, p, w):
        return sweep(scene, cache.traversal, p, w)

    # Keep the candidates near this path.
    candidates = cache.candidates[0]
    rows = candidates["rows_to_test"]
    num_faces = _filter_candidates(
        candidates, state["num_candidates"], p, w, scene.radius + CULLING_MARGIN * scene.eps, rows
    )

    # Test all faces first, then the edges that the path can still reach before the first hit so far.
    best = no_hit()
    k = INT64_ZERO
    num_tests = num_faces
    while k < num_tests:
        row = rows[k]
        best, is_deferred = update_first_hit(scene.triangles, row, p, w, scene.radius, scene.eps, best, k >= num_faces)
        if is_deferred:
            rows[num_tests] = row
            num_tests += 1
        k += 1

    if best.row >= 0:
        state["last_hit"] = best.row
    return best


@device_function
def has_spare_capacity(cache: CandidateCache) -> bool:
    """Return whether the cache is valid and at most a third of the multi-step capacity is used."""
    state = cache.state[0]
    return bool(state["length"] >= 0.0 and 3 * state["num_candidates"] <= MULTI_STEP_CAPACITY)


@device_function
def _rebuild(scene: CompiledScene, cache: CandidateCache, p: Vec3, w: Vec3) -> bool:
    """Collect the candidates for the path p to p + w and the next ones like it; return whether they fit.

    The cylinder grows while few candidates are found, and shrinks when they do not fit. The path w of a rolling ball
    points g dt^2 / 2 below the ground, and k such paths in a row k times as far: the cylinder's radius covers that and
    no more, to keep the candidates few. In flight the deflection is larger, and the ball leaves the cylinder earlier.
    """
    state = cache.state[0]
    lookahead_steps = state["lookahead_steps"]
    path = scale(w, lookahead_steps)
    drop = DROP_FACTOR * lookahead_steps * scene.dt * scene.dt * norm(scene.gravity)
    radius = drop + DEFLECTION_RATIO * norm(path) + CYLINDER_MARGIN * scene.eps
    capacity = MULTI_STEP_CAPACITY if lookahead_steps > 1.0 else SINGLE_STEP_CAPACITY
    if not _collect_candidates(scene, cache, p, path, query_radius(scene, radius), capacity):
        state["length"] = -1.0
        state["lookahead_steps"] = max(1.0, 0.5 * lookahead_steps)
        return False
    cylinder = bounding_cylinder(p, path, radius)
    store(state["base"], cylinder.base)
    store(state["axis"], cylinder.axis)
    state["length"] = cylinder.length
    state["radius_sq"] = cylinder.radius_sq
    if has_spare_capacity(cache):
        state["lookahead_steps"] = min(MAX_LOOKAHEAD_STEPS, 2.0 * lookahead_steps)
    return True


@device_function
def _collect_candidates(
    scene: CompiledScene, cache: CandidateCache, p: Vec3, w: Vec3, inflated_radius: float, capacity: int
) -> bool:
    """Collect all triangles that may be within ``inflated_radius`` of the path p to p + w; return whether they fit.

    The BVH is searched breadth first: the processor can work on several nodes at a time, as none waits for another.
    """
    traversal = cache.traversal[0]
    candidates = cache.candidates[0]
    queue = candidates["node_queue"]

    # List the triangles of all leaves near the path.
    queue[0] = 0
    num_queued = INT64_ONE
    num_visited = INT64_ZERO
    count = INT64_ZERO
    while num_visited < num_queued:
        i = queue[num_visited]
        if i >= 0:
            intersect_children_swept_sphere(scene.nodes, i, cache.traversal, p, w, inflated_radius)
            for k in range(BVH_WIDTH):
                queue[num_queued] = scene.nodes[i]["child"][k]
                num_queued += traversal["hit_mask"][k]
            if num_queued > MAX_QUEUED_NODES:
                return False
        else:
            first, size = decode_leaf(i)
            if count + size > MAX_CANDIDATES:
                return False
            for row in range(first, first + size):
                candidates["row"][count] = row
                count += 1
        num_visited += 1

    # Keep those that may overlap the inflated path.
    _gather_columns(scene.triangles, candidates, count)
    count = _filter_candidates(candidates, count, p, w, inflated_radius, candidates["row"])
    if count > capacity:
        return False
    _gather_columns(scene.triangles, candidates, count)
    cache.state[0]["num_candidates"] = count
    return True


@device_function
def _gather_columns(triangles: RecordArray, candidates: np.void, count: int) -> None:
    """Copy what ``may_overlap`` needs of the first ``count`` candidates into their columns."""
    for k in range(count):
        triangle = triangles[candidates["row"][k]]
        store_column(candidates["a"], k, vec3(triangle["a"]))
        store_column(candidates["n"], k, vec3(triangle["n"]))
        store_column(candidates["dual_u"], k, vec3(triangle["dual_u"]))
        store_column(candidates["dual_v"], k, vec3(triangle["dual_v"]))


@device_function
def _filter_candidates(
    candidates: np.void, count: int, p: Vec3, w: Vec3, inflated_radius: float, rows: NDArray[np.int64]
) -> int:
    """Write the rows of the candidates that may be within ``inflated_radius`` of the path p to p + w; count them.

    The tests are branch-free, so that the loop auto-vectorises.
    """
    for k in range(count):
        a = column(candidates["a"], k)
        n = column(candidates["n"], k)
        dual_u = column(candidates["dual_u"], k)
        dual_v = column(candidates["dual_v"], k)
        candidates["mask"][k] = may_overlap(sub(a, p), n, dual_u, dual_v, w, 0.0, 1.0, inflated_radius)
    num_kept = INT64_ZERO
    for k in range(count):
        rows[num_kept] = candidates["row"][k]
        num_kept += candidates["mask"][k]
    return num_kept
