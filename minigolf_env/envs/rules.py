"""The rules of the game, compiled: functions of one ball, and the kernel that plays N balls from action to observation.

The rules have no state, and there is no other copy of them. Balls share one hole, or each hole has ``rows_per_hole``
consecutive rows. ``task.py`` calls the kernels.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs.holes import FloatArray
from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.step import STATUS_REST, RunBatch, Scratch, simulate_range
from minigolf_env.physics.types import CompiledScene, RecordArray, Vec3
from minigolf_env.physics.vec3 import store, vec3

RESULT_HOLED = 3
"""Result of a stroke that holes out; other results are the values of ``Status``."""

MIN_CUP_DISTANCE = 1e-9
"""Smallest horizontal distance to the cup that the direction to it is divided by, m."""

NUM_STATE_FEATURES = 10
"""Number of features of the observation "state"."""


@device_function
def launch_velocity(hole: np.void, putts: FloatArray, noise: FloatArray, i: int) -> Vec3:
    """Return the launch velocity, m/s, of row i of the actions ``putts`` (N, 2).

    The direction of an action is that of the putt; its length, clipped to 1, is the fraction of the top speed. Noise
    (N, 3) has the cosine and the sine of each putt's turn, and a factor of its speed; (0, 3): no noise.
    """
    x = putts[i, 0]
    y = putts[i, 1]
    scale = hole["top_speed"] / max(math.sqrt(x * x + y * y), 1.0)
    x *= scale
    y *= scale
    if len(noise) == 0:
        return Vec3(x, y, 0.0)
    cos = noise[i, 0]
    sin = noise[i, 1]
    speed_factor = noise[i, 2]
    return Vec3((cos * x - sin * y) * speed_factor, (sin * x + cos * y) * speed_factor, 0.0)


@device_function
def is_holed(hole: np.void, p: Vec3, v: Vec3) -> bool:
    """Return whether a ball cannot leave the cup: it is below the rim, without the energy to come out.

    To leave the cup, a ball must pass over the edge of the rim with its centre one radius above it.
    """
    dx = p.x - hole["cup"][0]
    dy = p.y - hole["cup"][1]
    rim = hole["cup"][2]
    is_inside = dx * dx + dy * dy < hole["cup_radius"] * hole["cup_radius"]
    climb = (v.x * v.x + v.y * v.y + v.z * v.z) / (2.0 * hole["gravity"])
    return bool(is_inside and p.z < rim and p.z + climb < rim + hole["ball_radius"])


@device_function
def distance_to_cup(hole: np.void, route: RecordArray, x: float, y: float) -> float:
    """Return the distance along the course from a place to the cup, m.

    It is the straight distance to the end of the nearest segment of the course's route, plus the rest of the route.
    """
    smallest_sq = np.inf
    distance = 0.0
    for k in range(hole["num_segments"]):
        segment = route[hole["first_segment"] + k]
        # Find the nearest point of the segment.
        dx = x - segment["start"][0]
        dy = y - segment["start"][1]
        fraction = (dx * segment["vector"][0] + dy * segment["vector"][1]) / segment["length_sq"]
        fraction = min(max(fraction, 0.0), 1.0)
        dx -= fraction * segment["vector"][0]
        dy -= fraction * segment["vector"][1]
        offset_sq = dx * dx + dy * dy
        # Keep the distance along the nearest segment.
        if offset_sq < smallest_sq:
            smallest_sq = offset_sq
            to_end_x = segment["end"][0] - x
            to_end_y = segment["end"][1] - y
            distance = math.sqrt(to_end_x * to_end_x + to_end_y * to_end_y) + segment["remaining"]
    return distance


@device_function
def write_state(hole: np.void, p: Vec3, strokes: float, row: NDArray[np.float32]) -> None:
    """Write the observation "state" (NUM_STATE_FEATURES,) of a ball after a number of strokes."""
    lower = vec3(hole["bounds"][0])
    upper = vec3(hole["bounds"][1])
    # Scale the ball's position within the bounds to -1 to 1.
    width = upper.x - lower.x
    depth = upper.y - lower.y
    row[0] = clip(2.0 * (p.x - lower.x) / width - 1.0)
    row[1] = clip(2.0 * (p.y - lower.y) / depth - 1.0)
    row[2] = clip(2.0 * (p.z - lower.z) / (upper.z - lower.z) - 1.0)
    # Compute the vector to the cup in units of the bounds' horizontal diagonal, and the straight putt.
    diagonal = math.sqrt(width * width + depth * depth)
    x = hole["cup"][0] - p.x
    y = hole["cup"][1] - p.y
    distance = math.sqrt(x * x + y * y)
    root = math.sqrt(distance / diagonal)
    row[3] = clip(x / diagonal)
    row[4] = clip(y / diagonal)
    row[5] = clip((hole["cup"][2] - p.z) / diagonal)
    row[6] = clip(root * x / max(distance, MIN_CUP_DISTANCE))
    row[7] = clip(root * y / max(distance, MIN_CUP_DISTANCE))
    row[8] = clip(root)
    # Compute the fraction of the strokes that is left.
    row[9] = clip(1.0 - strokes / hole["max_strokes"])


@device_function
def clip(value: float) -> float:
    """Return the value, clipped to [-1, 1]."""
    return min(max(value, -1.0), 1.0)


@kernel
def play_range(
    first: int,
    last: int,
    scene: CompiledScene,
    scratch: Scratch,
    params: RecordArray,
    rows_per_hole: int,
    putts: FloatArray,
    noise: FloatArray,
    starts: FloatArray,
    strokes: NDArray[np.int64],
    runs: RunBatch,
    path: FloatArray,
    log: FloatArray,
    launches: FloatArray,
    state: NDArray[np.float32],
) -> None:
    """Play one putt with each of the balls first to last - 1, which share a scene, from action to observation.

    Args:
        first: first row.
        last: one past the last row.
        scene: the compiled scene.
        scratch: working memory of the thread.
        params: (M,) records of HOLE_DTYPE.
        rows_per_hole: number of rows of each hole, N / M.
        putts: (N, 2) actions.
        noise: see ``launch_velocity``.
        starts: (N, 3) centres of the balls, m.
        strokes: (N,) number of strokes of the episodes before this one.
        runs: positions equal to ``starts``, and results that are zero. Afterwards: where the balls are for the next
            stroke, and results whose status may be RESULT_HOLED.
        path: without rows: no path is recorded.
        log: without rows: no bounce is recorded.
        launches: (N, 3) receives the launch velocities, m/s.
        state: (N, NUM_STATE_FEATURES) receives the observations "state".
    """
    # Launch the balls.
    for i in range(first, last):
        v = launch_velocity(params[i // rows_per_hole], putts, noise, i)
        store(launches[i], v)
        store(runs.velocities[i], v)

    # Run them to rest.
    max_steps = params[first // rows_per_hole]["max_steps"]
    simulate_range(first, last, scene, scratch, max_steps, runs, path, log)

    for i in range(first, last):
        # A ball that left the course, or did not come to rest, is put back where it was struck; the stroke counts.
        hole = params[i // rows_per_hole]
        result = runs.results[i]
        if is_holed(hole, vec3(runs.positions[i]), vec3(runs.velocities[i])):
            result["status"] = RESULT_HOLED
        elif result["status"] != STATUS_REST:
            store(runs.positions[i], vec3(starts[i]))

        # Observe the ball where it is now.
        write_state(hole, vec3(runs.positions[i]), strokes[i] + 1.0, state[i])


@kernel
def launch_rows(
    params: RecordArray, rows_per_hole: int, putts: FloatArray, noise: FloatArray, launches: FloatArray
) -> None:
    """Write the launch velocities (N, 3), m/s, of actions (N, 2) with noise; see ``launch_velocity``."""
    for i in range(len(putts)):
        store(launches[i], launch_velocity(params[i // rows_per_hole], putts, noise, i))


@kernel
def holed_rows(params: RecordArray, rows_per_hole: int, p: FloatArray, v: FloatArray, holed: NDArray[np.bool_]) -> None:
    """Write whether balls at positions (N, 3), m, with velocities (N, 3), m/s, cannot leave the cup."""
    for i in range(len(p)):
        holed[i] = is_holed(params[i // rows_per_hole], vec3(p[i]), vec3(v[i]))


@kernel
def distance_rows(
    params: RecordArray, rows_per_hole: int, route: RecordArray, positions: FloatArray, distances: FloatArray
) -> None:
    """Write the distances (N,) along the course from positions (N, 3) to the cup, m."""
    for i in range(len(positions)):
        distances[i] = distance_to_cup(params[i // rows_per_hole], route, positions[i, 0], positions[i, 1])


@kernel
def state_rows(
    params: RecordArray,
    rows_per_hole: int,
    positions: FloatArray,
    strokes: NDArray[np.int64],
    state: NDArray[np.float32],
) -> None:
    """Write the observations "state" (N, NUM_STATE_FEATURES) of balls at positions (N, 3), m, after (N,) strokes."""
    for i in range(len(positions)):
        write_state(params[i // rows_per_hole], vec3(positions[i]), float(strokes[i]), state[i])
