"""The observation "rays": distances to walls around the ball, the ground below it and the direction to the cup.

It describes a hole that the agent has never seen.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.envs.hole_params import FloatArray
from minigolf_env.envs.observations.state import STATE_FEATURES, append_to_state
from minigolf_env.envs.task import TaskBatch, components

NUM_RAYS = 32
"""Number of horizontal directions; the first is along x, counter-clockwise."""

MAX_RAY_LENGTH = 4.0
"""Length of a ray that hits nothing, m: 99 % of the rays from balls on levels hit something nearer."""

ORIGIN_LIFT_RADII = 1.0
"""Height by which the ball is raised before it is swept along a ray, in radii.

The raised ball clears unevenness of the ground and still hits every border.
"""

GROUND_PROBE_DEPTH = 0.5
"""Distance below the ball within which the ground is looked for, m."""

MIN_DIRECTION_LENGTH = 1e-9
"""Smallest length that a direction is divided by, m."""

MIN_SLOPE_NORMAL_Z = 0.1
"""Smallest upward part of a normal that a slope is computed with."""

RAY_ANGLES = 2.0 * math.pi * np.arange(NUM_RAYS) / NUM_RAYS
"""Directions (NUM_RAYS,) of the rays, radians counter-clockwise from x."""

RAY_VECTORS = MAX_RAY_LENGTH * np.stack([np.cos(RAY_ANGLES), np.sin(RAY_ANGLES), np.zeros(NUM_RAYS)], axis=-1)
"""Rays (NUM_RAYS, 3) at their greatest length, m."""

NUM_GROUND_FEATURES = 3
"""Number of features of the ground: its depth below the ball, and its slope along x and y."""

NUM_CUP_FEATURES = 3
"""Number of features of the cup, in the same scale on every hole: a straight putt along x and y, and the height."""

CUP_DISTANCE_SCALE = 8.0
"""Horizontal distance to the cup at which the straight putt has length 1, m."""

CUP_HEIGHT_SCALE = 1.0
"""Height of the cup above the ball that counts as 1, m."""


def ray_space() -> Space[NDArray[np.float32]]:
    """Return the space of "rays" observations (48,)."""
    size = len(STATE_FEATURES) + NUM_RAYS + NUM_GROUND_FEATURES + NUM_CUP_FEATURES
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (size,), np.float32))


def observe_rays(task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return observations (N, 48) of balls at positions (N, 3), m, after a number of strokes (N,).

    A ray is an exact sweep of the ball itself. A ball without room above it, under a low roof, is swept from its own
    position.
    """
    origins = raised_origins(task, positions)
    ends = (origins[:, None] + RAY_VECTORS).reshape(-1, 3)
    rays = task.world.sweep_batch(np.repeat(origins, NUM_RAYS, axis=0), ends)
    distances = np.asarray(rays.alpha).reshape(-1, NUM_RAYS)
    features = np.concatenate([distances, ground_and_cup_features(task, positions)], axis=1)
    return append_to_state(task, positions, strokes, features)


def raised_origins(task: TaskBatch, positions: FloatArray) -> FloatArray:
    """Return the origins (N, 3), m, of rays from balls at positions (N, 3): raised where there is room above."""
    up = ORIGIN_LIFT_RADII * task.params.ball_radius[..., None] * np.array([0.0, 0.0, 1.0])
    has_room = ~np.asarray(task.world.sweep_batch(positions, positions + up).hit)
    return np.asarray(positions + has_room[:, None] * up)


def ground_and_cup_features(task: TaskBatch, positions: FloatArray) -> FloatArray:
    """Return the features (N, 6) of the ground and the cup for balls at positions (N, 3), m; they are not clipped."""
    # Depth and slope of the ground.
    ground = task.world.sweep_batch(positions, positions + np.array([0.0, 0.0, -GROUND_PROBE_DEPTH]))
    normals = np.asarray(ground.normal)
    slopes = -normals[:, :2] / np.maximum(normals[:, 2:], MIN_SLOPE_NORMAL_Z)
    slopes[~np.asarray(ground.hit)] = 0.0
    # The straight putt is as long as the square root of the distance, and 1 from CUP_DISTANCE_SCALE on.
    x, y, height = components(task.params.cup - positions)
    distance = np.hypot(x, y)
    scale = np.maximum(np.maximum(np.sqrt(CUP_DISTANCE_SCALE * distance), distance), MIN_DIRECTION_LENGTH)
    cup = np.stack([x / scale, y / scale, height / CUP_HEIGHT_SCALE], axis=-1)
    return np.concatenate([np.asarray(ground.alpha)[:, None], slopes, cup], axis=1)
