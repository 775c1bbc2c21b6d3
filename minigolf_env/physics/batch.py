"""Batches of balls on all threads: in one compiled scene, or each in its own.

The rows of a batch are divided evenly among the scenes, in order: with N rows and M scenes, each scene has N / M
consecutive rows. Threads get chunks of rows, so that all are busy whether the balls share a scene or not; the results
are the same bits either way. Arguments have been validated by the public API.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics import step as kernels
from minigolf_env.physics.candidate_cache import invalidate
from minigolf_env.physics.jit import notify_if_compiling
from minigolf_env.physics.sweep import clearance_range, possible_overlap_range, sweep_range
from minigolf_env.physics.thread_pool import parallel_for
from minigolf_env.physics.types import (
    IMPACT_DTYPE,
    RELATIVE_TOLERANCE,
    RESULT_DTYPE,
    CompiledScene,
    FloatArray,
    RecordArray,
    Shot,
    Status,
)

MAX_SERIAL_QUERIES = 64
"""Maximum number of distance queries that take less time than starting threads."""

INITIAL_RECORDING_ROWS = 512
"""Initial number of rows of a recording: of the run's path (4 s at 1/120 s) and of its log of bounces."""

NO_PATH = np.empty((0, 4))
"""A path without rows: ``simulate_range`` does not record the run."""

NO_LOG = np.empty((0, 8))
"""A log without rows: bounces are not recorded."""

T = TypeVar("T")

_thread_memory = threading.local()
"""Holds the scratch of each thread."""


def simulate_rows(
    scenes: Sequence[CompiledScene], positions: FloatArray, velocities: FloatArray, max_steps: int
) -> NDArray[np.void]:
    """Run balls (N, 3) to their end, in place; return records (N,) of RESULT_DTYPE."""
    results: RecordArray = np.zeros(len(positions), RESULT_DTYPE)
    runs = kernels.RunBatch(positions, velocities, results)

    def simulate_scene_rows(first: int, last: int, scene: CompiledScene) -> None:
        kernels.simulate_range(first, last, scene, thread_scratch(), max_steps, runs, NO_PATH, NO_LOG)

    with notify_if_compiling("simulate"):
        for_each_range(scenes, len(positions), simulate_scene_rows)
    return results


def simulate_recorded(scene: CompiledScene, position: FloatArray, velocity: FloatArray, max_steps: int) -> Shot:
    """Run one ball from position (3,) with velocity (3,) to its end; return a Shot with the recording.

    The run is simulated once. It is suspended when the recording is full, and resumes with twice as many rows.
    """
    runs = kernels.RunBatch(position[None].copy(), velocity[None].copy(), np.zeros(1, RESULT_DTYPE))
    scratch = kernels.new_scratch()
    path = np.empty((INITIAL_RECORDING_ROWS, 4))
    log = np.empty((INITIAL_RECORDING_ROWS, 8))
    path[0, :3] = position
    is_complete = False
    with notify_if_compiling("simulate"):
        while not is_complete:
            kernels.simulate_range(0, 1, scene, scratch, max_steps, runs, path, log)
            time, status, steps, bounces, exhausted = runs.results[0].tolist()
            is_complete = status != Status.TIME_LIMIT or steps == max_steps
            if not is_complete:
                path = np.concatenate([path, np.empty_like(path)])
                log = np.concatenate([log, np.empty_like(log)])

    impacts = np.empty(bounces, IMPACT_DTYPE)
    impacts["time"] = log[:bounces, 0]
    impacts["position"] = log[:bounces, 1:4]
    impacts["normal"] = log[:bounces, 4:7]
    impacts["triangle"] = log[:bounces, 7]
    return Shot(
        runs.positions[0],
        runs.velocities[0],
        Status(status),
        time,
        bounces,
        exhausted,
        path=path[: steps + 1, :3].copy(),
        times=np.append(np.arange(steps) * scene.dt, time),
        impacts=impacts,
        num_substeps=path[1 : steps + 1, 3].astype(np.int64),
    )


def sweep_rows(
    scenes: Sequence[CompiledScene], starts: FloatArray, paths: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return alphas (N,), normals (N, 3) and triangles (N,) of balls that move from starts along paths (N, 3)."""
    n = len(starts)
    alphas = np.empty(n)
    normals = np.empty((n, 3))
    triangles = np.empty(n, np.int64)

    def sweep_scene_rows(first: int, last: int, scene: CompiledScene) -> None:
        traversal = thread_scratch().cache.traversal
        sweep_range(first, last, scene, traversal, starts, paths, alphas, normals, triangles)

    with notify_if_compiling("sweep_batch"):
        for_each_range(scenes, n, sweep_scene_rows)
    return alphas, normals, triangles


def clearance_rows(scenes: Sequence[CompiledScene], positions: FloatArray) -> FloatArray:
    """Return the distances (N,) from the surface of balls at positions (N, 3) to the nearest triangle, m."""
    clearances = np.empty(len(positions))
    _query(clearance_range, scenes, positions, clearances)
    return clearances


def check_no_overlap(scenes: Sequence[CompiledScene], p: FloatArray, scales: float | FloatArray) -> None:
    """Raise a ValueError for the first ball that intersects a mesh.

    Centres are (3,) or (N, 3), coordinate scales () or (N,). A cheap conservative test avoids the
    computation of most distances. The tolerance grows with a centre outside the scene, as its rounding does.
    """
    centres = p.reshape(-1, 3)
    may_overlap = np.empty(len(centres), np.bool_)
    _query(possible_overlap_range, scenes, centres, may_overlap)
    if not may_overlap.any():
        return
    clearances = clearance_rows(scenes, centres)
    is_deep = clearances < -2.0 * RELATIVE_TOLERANCE * np.maximum(scales, np.abs(centres).max(axis=1, initial=0.0))
    if is_deep.any():
        i = int(is_deep.argmax())
        scene = next(_ranges_per_group(scenes, len(centres), i, i + 1))[2]
        which = "position" if p.ndim == 1 else f"position {i}"
        raise ValueError(
            f"{which}: expected a ball in free space, received {centres[i].tolist()}, {-clearances[i]:.3g} m deep in a "
            f"surface; its centre must be at least {scene.radius:g} m from every triangle."
        )


def _query(
    kernel: Callable[[int, int, CompiledScene, RecordArray, FloatArray, Any], None],
    scenes: Sequence[CompiledScene],
    positions: FloatArray,
    results: NDArray[Any],
) -> None:
    """Run a kernel that writes one result for each ball at positions (N, 3)."""

    def query_rows(first: int, last: int, scene: CompiledScene) -> None:
        kernel(first, last, scene, thread_scratch().cache.traversal, positions, results)

    with notify_if_compiling("clearance"):
        for_each_range(scenes, len(positions), query_rows, serial=len(positions) <= MAX_SERIAL_QUERIES)


def make_shot(positions: FloatArray, velocities: FloatArray, results: NDArray[np.void]) -> Shot:
    """Return the results of runs as a Shot of arrays."""
    fields = (np.ascontiguousarray(results[name]) for name in ("time", "bounces", "exhausted"))
    return Shot(positions, velocities, results["status"].astype(np.int8), *fields)  # type: ignore[arg-type]


def thread_scratch() -> kernels.Scratch:
    """Return the working memory of this thread, with an empty candidate cache.

    Allocating it in each call would take 6 us, half of the time of a putt in a batch.
    """
    scratch: kernels.Scratch | None = getattr(_thread_memory, "scratch", None)
    if scratch is None:
        scratch = _thread_memory.scratch = kernels.new_scratch()
    invalidate(scratch.cache.state)
    return scratch


def for_each_range(
    groups: Sequence[T], n: int, process_rows: Callable[[int, int, T], None], serial: bool = False
) -> None:
    """Call process_rows(first, last, group) for ranges of the n rows that share a group, on all threads.

    Args:
        groups: M groups, such as scenes, of which each has n / M consecutive rows.
        n: number of rows, a multiple of M.
        process_rows: receives the first row, one past the last row, and the group.
        serial: use the calling thread alone.
    """

    def process_chunk(first: int, last: int) -> None:
        for begin, end, group in _ranges_per_group(groups, n, first, last):
            process_rows(begin, end, group)

    if serial:
        process_chunk(0, n)
    else:
        parallel_for(process_chunk, n)


def _ranges_per_group(groups: Sequence[T], n: int, first: int, last: int) -> Iterator[tuple[int, int, T]]:
    """Yield the ranges of rows in first to last - 1 that share a group: first row, one past the last row, group."""
    rows_per_group = n // max(1, len(groups))
    begin = first
    while begin < last:
        group = groups[begin // rows_per_group]
        end = begin
        while end < last and groups[end // rows_per_group] is group:
            end = min(last, (end // rows_per_group + 1) * rows_per_group)
        yield begin, end, group
        begin = end
