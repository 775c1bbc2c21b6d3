"""The observation "rays": distances to walls around the ball, the ground below it and the direction to the cup.

It describes a hole that the agent has never seen.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.observations.state import STATE_FEATURES, append_to_state
from minigolf_env.envs.rules import clip
from minigolf_env.envs.task import TaskBatch
from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.step import Scratch
from minigolf_env.physics.sweep import sweep
from minigolf_env.physics.types import CompiledScene, RecordArray, Vec3
from minigolf_env.physics.vec3 import add, sub, vec3

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


def observe_rays(
    task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64], state: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return observations (N, 48) of balls at positions (N, 3), m, with the features ``state`` (N, 10).

    A ray is an exact sweep of the ball itself. A ball without room above it, under a low roof, is swept from its own
    position.
    """
    observations, features = append_to_state(state, NUM_RAYS + NUM_GROUND_FEATURES + NUM_CUP_FEATURES)
    task.for_each_hole(ray_range, positions, RAY_VECTORS, features)
    return observations


@kernel
def ray_range(
    first: int,
    last: int,
    scene: CompiledScene,
    scratch: Scratch,
    params: RecordArray,
    rows_per_hole: int,
    positions: FloatArray,
    rays: FloatArray,
    features: NDArray[np.float32],
) -> None:
    """Write the features (N, 38) of balls first to last - 1 at positions (N, 3), m, for the ``rays`` (R, 3), m."""
    traversal = scratch.cache.traversal
    num_rays = len(rays)
    for i in range(first, last):
        p = vec3(positions[i])
        origin = raised_origin(scene, traversal, p)
        for k in range(num_rays):
            features[i, k] = sweep(scene, traversal, origin, vec3(rays[k])).alpha
        write_ground_features(scene, traversal, p, features[i, num_rays:])
        write_cup_features(params[i // rows_per_hole], p, features[i, num_rays + NUM_GROUND_FEATURES :])


@device_function
def raised_origin(scene: CompiledScene, traversal: RecordArray, p: Vec3) -> Vec3:
    """Return the origin of rays from a ball at p, m: raised where there is room above."""
    up = Vec3(0.0, 0.0, ORIGIN_LIFT_RADII * scene.radius)
    return p if sweep(scene, traversal, p, up).row >= 0 else add(p, up)


@device_function
def write_ground_features(scene: CompiledScene, traversal: RecordArray, p: Vec3, features: NDArray[np.float32]) -> None:
    """Write the depth of the ground below a ball at p, and its slopes along x and y (NUM_GROUND_FEATURES,)."""
    ground = sweep(scene, traversal, p, Vec3(0.0, 0.0, -GROUND_PROBE_DEPTH))
    steepness = max(ground.normal.z, MIN_SLOPE_NORMAL_Z)  # The normal is zero without a hit.
    features[0] = ground.alpha
    features[1] = clip(0.0 - ground.normal.x / steepness)
    features[2] = clip(0.0 - ground.normal.y / steepness)


@device_function
def write_cup_features(hole: np.void, p: Vec3, features: NDArray[np.float32]) -> None:
    """Write the straight putt to the cup along x and y, and the cup's height (NUM_CUP_FEATURES,) for a ball at p.

    The straight putt is as long as the square root of the distance, and 1 from CUP_DISTANCE_SCALE on.
    """
    to_cup = sub(vec3(hole["cup"]), p)
    distance = math.sqrt(to_cup.x * to_cup.x + to_cup.y * to_cup.y)
    scale = max(max(math.sqrt(CUP_DISTANCE_SCALE * distance), distance), MIN_DIRECTION_LENGTH)
    features[0] = clip(to_cup.x / scale)
    features[1] = clip(to_cup.y / scale)
    features[2] = clip(to_cup.z / CUP_HEIGHT_SCALE)
