"""Many balls at once, on all threads: in one compiled world, or each in its own.

The rows of a batch are shared out evenly among the scenes, in their order: N rows and M scenes give each scene N / M
consecutive rows. Threads get runs of rows, so that they are busy whether the balls share a world or not; what a scene's
rows come to is the same bits either way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics import step as kernels
from minigolf_env.physics.candidate_cache import forget
from minigolf_env.physics.jit import announced_compilation
from minigolf_env.physics.parallel import in_parallel
from minigolf_env.physics.traversal import new_walk
from minigolf_env.physics.types import RESULT, TOLERANCE, FloatArray, RecordArray, Scene, Shot

FEW = 64
"""Distances that are found sooner than threads are started."""

NO_PATH, NO_LOG = np.empty((0, 4)), np.empty((0, 8))


def simulate_rows(
    scenes: Sequence[Scene], positions: FloatArray, velocities: FloatArray, steps: int
) -> NDArray[np.void]:
    """Run balls (N, 3) to their end, in place; return records (N,) of RESULT."""
    results: RecordArray = np.empty(len(positions), RESULT)
    balls = kernels.Balls(positions, velocities, results)

    def run(first: int, last: int) -> None:
        scratch = kernels.new_scratch()
        for a, b, scene in _spans(scenes, len(positions), first, last):
            forget(scratch.near.cylinder)
            kernels.simulate_range(a, b, scene, scratch, steps, balls, NO_PATH, NO_LOG)

    with announced_compilation("simulate"):
        in_parallel(run, len(positions))
    return results


def sweep_rows(
    scenes: Sequence[Scene], starts: FloatArray, paths: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return alphas (N,), normals (N, 3) and triangles (N,) of balls that move from starts along paths (N, 3)."""
    n = len(starts)
    alphas, normals, triangles = np.empty(n), np.empty((n, 3)), np.empty(n, np.int64)

    def run(first: int, last: int) -> None:
        walk = new_walk()
        for a, b, scene in _spans(scenes, n, first, last):
            kernels.sweep_range(a, b, scene, walk, starts, paths, alphas, normals, triangles)

    with announced_compilation("sweep_batch"):
        in_parallel(run, n)
    return alphas, normals, triangles


def clearance_rows(scenes: Sequence[Scene], positions: FloatArray) -> FloatArray:
    """Return the distances (N,) from the skin of balls at positions (N, 3) to the nearest triangle."""
    clearances = np.empty(len(positions))
    _ask(kernels.clearance_range, scenes, positions, clearances)
    return clearances


def check_clear(scenes: Sequence[Scene], p: FloatArray, scales: float | FloatArray) -> None:
    """Raise a ValueError for the first ball, of centres (3,) or (N, 3), that intersects a mesh; scales () or (N,)."""
    centres = p.reshape(-1, 3)
    doubts = np.empty(len(centres), np.bool_)
    _ask(kernels.doubt_range, scenes, centres, doubts)
    if not doubts.any():
        return
    clearances = clearance_rows(scenes, centres)
    deep = clearances < -2.0 * TOLERANCE * np.maximum(scales, np.abs(centres).max(axis=1, initial=0.0))
    if deep.any():
        i = int(deep.argmax())
        scene = next(_spans(scenes, len(centres), i, i + 1))[2]
        which = "position" if p.ndim == 1 else f"position {i}"
        raise ValueError(
            f"{which}: expected a ball in free space, received {centres[i].tolist()}, {-clearances[i]:.3g} m deep in a "
            f"surface; its centre must be at least {scene.radius:g} m from every triangle."
        )


def _ask(
    kernel: Callable[[int, int, Scene, RecordArray, FloatArray, Any], None],
    scenes: Sequence[Scene],
    positions: FloatArray,
    answers: NDArray[Any],
) -> None:
    """Let a kernel write an answer for each ball at positions (N, 3)."""

    def run(first: int, last: int) -> None:
        walk = new_walk()
        for a, b, scene in _spans(scenes, len(positions), first, last):
            kernel(a, b, scene, walk, positions, answers)

    with announced_compilation("clearance"):
        if len(positions) <= FEW:
            run(0, len(positions))
        else:
            in_parallel(run, len(positions))


def shot_of(positions: FloatArray, velocities: FloatArray, results: NDArray[np.void]) -> Shot:
    """Return how balls ended as a Shot of arrays."""
    fields = (np.ascontiguousarray(results[name]) for name in ("time", "bounces", "exhausted"))
    return Shot(positions, velocities, results["status"].astype(np.int8), *fields)  # type: ignore[arg-type]


def _spans(scenes: Sequence[Scene], n: int, first: int, last: int) -> Iterator[tuple[int, int, Scene]]:
    """Yield runs of rows from first to last - 1 that are in the same scene: the first row, one past the last, scene."""
    each, begin = n // max(1, len(scenes)), first
    while begin < last:
        scene = scenes[begin // each]
        end = begin
        while end < last and scenes[end // each] is scene:
            end = min(last, (end // each + 1) * each)
        yield begin, end, scene
        begin = end
