"""The observation "bounce_rays": rays that follow the ground and are reflected off walls, to see around corners.

Each ray is the path of the ball itself, raised by its radius. It advances in steps by exact sweeps. After a step it
comes down to the ground; at a slope it turns upwards; at a wall it is reflected as light is off a mirror, and a new
segment begins. A ray ends after four segments or 16 m.
"""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.observations.rays import (
    MIN_DIRECTION_LENGTH,
    NUM_CUP_FEATURES,
    NUM_GROUND_FEATURES,
    raised_origin,
    write_cup_features,
    write_ground_features,
)
from minigolf_env.envs.observations.state import STATE_FEATURES, append_to_state
from minigolf_env.envs.rules import clip
from minigolf_env.envs.task import TaskBatch
from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.step import Scratch
from minigolf_env.physics.sweep import sweep
from minigolf_env.physics.types import CompiledScene, RecordArray, Vec3
from minigolf_env.physics.vec3 import mul_add, scale, sub, vec3

NUM_BOUNCE_RAYS = 96
"""Number of horizontal directions; the first is along x, counter-clockwise."""

BOUNCE_RAY_ANGLES = 2.0 * math.pi * np.arange(NUM_BOUNCE_RAYS) / NUM_BOUNCE_RAYS
"""Directions (NUM_BOUNCE_RAYS,) of the rays, radians counter-clockwise from x."""

BOUNCE_RAY_DIRECTIONS = np.stack([np.cos(BOUNCE_RAY_ANGLES), np.sin(BOUNCE_RAY_ANGLES)], axis=-1)
"""Horizontal unit vectors (NUM_BOUNCE_RAYS, 2) of the rays."""

NUM_SEGMENTS = 4
"""Number of straight segments of a ray, seen from above: it is reflected off three walls."""

RAY_STEP_LENGTH = 0.8
"""Length of a step, m, after which a ray comes down to the ground; a wall or a slope ends a step early."""

MAX_RAY_STEPS = 20
"""Number of steps of a ray."""

MAX_BOUNCE_RAY_LENGTH = RAY_STEP_LENGTH * MAX_RAY_STEPS
"""Length of a whole ray, m."""

MAX_WALL_NORMAL_Z = 0.7
"""Largest upward part of a wall's normal; a surface with a greater one is ground, which a ray follows upwards."""

MAX_DROP_PER_STEP = 0.3
"""Distance by which a ray comes down to the ground after a step, at most, m."""

HIT_STANDOFF = 1e-4
"""Distance that a ray keeps from what it hits, m."""

FEATURES_PER_SEGMENT = 6
"""Number of features of a segment.

They are x and y of its end and of the wall's normal there, the height of its end, and the greatest height so far.
"""


NUM_BOUNCE_RAY_FEATURES = NUM_BOUNCE_RAYS * NUM_SEGMENTS * FEATURES_PER_SEGMENT
"""Number of features of all rays."""


def bounce_ray_space() -> Space[NDArray[np.float32]]:
    """Return the space of "bounce_rays" observations (2320,)."""
    size = len(STATE_FEATURES) + NUM_GROUND_FEATURES + NUM_CUP_FEATURES + NUM_BOUNCE_RAY_FEATURES
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (size,), np.float32))


def observe_bounce_rays(
    task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64], state: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return observations (N, 2320) of balls at positions (N, 3), m, with the features ``state`` (N, 10)."""
    observations, features = append_to_state(state, NUM_GROUND_FEATURES + NUM_CUP_FEATURES + NUM_BOUNCE_RAY_FEATURES)
    task.for_each_hole(bounce_ray_range, positions, BOUNCE_RAY_DIRECTIONS, features)
    return observations


@kernel
def bounce_ray_range(
    first: int,
    last: int,
    scene: CompiledScene,
    scratch: Scratch,
    params: RecordArray,
    rows_per_hole: int,
    positions: FloatArray,
    directions: FloatArray,
    features: NDArray[np.float32],
) -> None:
    """Write the features (N, 2310) of balls first to last - 1 at positions (N, 3), m, for directions (R, 2)."""
    traversal = scratch.cache.traversal
    features_per_ray = NUM_SEGMENTS * FEATURES_PER_SEGMENT
    first_ray = NUM_GROUND_FEATURES + NUM_CUP_FEATURES
    for i in range(first, last):
        hole = params[i // rows_per_hole]
        p = vec3(positions[i])
        write_ground_features(scene, traversal, p, features[i])
        write_cup_features(hole, p, features[i, NUM_GROUND_FEATURES:])
        origin = raised_origin(scene, traversal, p)
        for k in range(len(directions)):
            row = features[i, first_ray + k * features_per_ray : first_ray + (k + 1) * features_per_ray]
            trace_bounce_ray(scene, traversal, hole, origin, directions[k, 0], directions[k, 1], row)


@device_function
def trace_bounce_ray(
    scene: CompiledScene,
    traversal: RecordArray,
    hole: np.void,
    origin: Vec3,
    direction_x: float,
    direction_y: float,
    features: NDArray[np.float32],
) -> None:
    """Write the features of the segments of a ray (NUM_SEGMENTS * FEATURES_PER_SEGMENT,) from the origin.

    A segment that hits no wall has a normal of 0; so have the segments after it, which end where it ends.
    """
    position = origin
    slope = 0.0
    top = origin.z
    segment = 0
    min_cup_distance = hole["cup_radius"] + 0.5 * scene.radius
    for _ in range(MAX_RAY_STEPS):
        if segment == NUM_SEGMENTS:
            break
        # Sweep ahead, up to what the ray hits.
        step = scale(Vec3(direction_x, direction_y, slope), RAY_STEP_LENGTH)
        ahead = sweep(scene, traversal, position, step)
        is_hit = ahead.row >= 0
        standoff = HIT_STANDOFF / RAY_STEP_LENGTH if is_hit else 0.0
        position = mul_add(position, max(ahead.alpha - standoff, 0.0), step)
        top = max(top, position.z)
        slope = 0.0
        if is_hit and ahead.normal.z >= MAX_WALL_NORMAL_Z:
            # Turn upwards along the slope.
            slope = -(direction_x * ahead.normal.x + direction_y * ahead.normal.y) / ahead.normal.z
            continue
        # Come down to the ground, but not into the cup.
        below = sweep(scene, traversal, position, Vec3(0.0, 0.0, -MAX_DROP_PER_STEP))
        dx = position.x - hole["cup"][0]
        dy = position.y - hole["cup"][1]
        if below.row >= 0 and dx * dx + dy * dy >= min_cup_distance * min_cup_distance:
            drop = max(MAX_DROP_PER_STEP * below.alpha - scene.radius, 0.0)
            position = Vec3(position.x, position.y, position.z - drop)
        if is_hit:
            # Reflect the ray off the wall. A ceiling has no horizontal normal.
            length = math.sqrt(ahead.normal.x * ahead.normal.x + ahead.normal.y * ahead.normal.y)
            normal_x = ahead.normal.x / max(length, MIN_DIRECTION_LENGTH)
            normal_y = ahead.normal.y / max(length, MIN_DIRECTION_LENGTH)
            _write_segment(features, segment, sub(position, origin), normal_x, normal_y, top - origin.z)
            twice_approach = 2.0 * (direction_x * normal_x + direction_y * normal_y)
            direction_x -= twice_approach * normal_x
            direction_y -= twice_approach * normal_y
            segment += 1
    # End the segments that hit no wall.
    for k in range(segment, NUM_SEGMENTS):
        _write_segment(features, k, sub(position, origin), 0.0, 0.0, top - origin.z)


@device_function
def _write_segment(
    features: NDArray[np.float32], segment: int, end: Vec3, normal_x: float, normal_y: float, top: float
) -> None:
    """Write the features of a segment whose end and greatest height so far, m, are relative to the ray's origin."""
    column = segment * FEATURES_PER_SEGMENT
    features[column] = clip(end.x / MAX_BOUNCE_RAY_LENGTH)
    features[column + 1] = clip(end.y / MAX_BOUNCE_RAY_LENGTH)
    features[column + 2] = normal_x
    features[column + 3] = normal_y
    features[column + 4] = clip(end.z)
    features[column + 5] = clip(top)
