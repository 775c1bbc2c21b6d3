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

from minigolf_env.envs.hole_params import FloatArray
from minigolf_env.envs.observations.rays import (
    MIN_DIRECTION_LENGTH,
    NUM_CUP_FEATURES,
    NUM_GROUND_FEATURES,
    ground_and_cup_features,
    raised_origins,
)
from minigolf_env.envs.observations.state import STATE_FEATURES, append_to_state
from minigolf_env.envs.task import TaskBatch

NUM_BOUNCE_RAYS = 96
"""Number of horizontal directions; the first is along x, counter-clockwise."""

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


def bounce_ray_space() -> Space[NDArray[np.float32]]:
    """Return the space of "bounce_rays" observations (2320,)."""
    num_ray_features = NUM_BOUNCE_RAYS * NUM_SEGMENTS * FEATURES_PER_SEGMENT
    size = len(STATE_FEATURES) + NUM_GROUND_FEATURES + NUM_CUP_FEATURES + num_ray_features
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (size,), np.float32))


def observe_bounce_rays(task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return observations (N, 2320) of balls at positions (N, 3), m, after a number of strokes (N,)."""
    segments = trace_bounce_rays(task, positions)
    segments[..., :2] /= MAX_BOUNCE_RAY_LENGTH
    ray_features = segments.reshape(len(positions), -1)
    features = np.concatenate([ground_and_cup_features(task, positions), ray_features], axis=1)
    return append_to_state(task, positions, strokes, features)


def trace_bounce_rays(task: TaskBatch, positions: FloatArray) -> FloatArray:
    """Return the segments (N, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT), m, of rays from balls (N, 3).

    Ends and heights are relative to the ray's origin. A segment that hits no wall has a normal of 0; so have the
    segments after it, which end where it ends.
    """
    # All rays of all balls advance together: row i of these arrays is one ray.
    n = len(positions)
    sweep = task.world.sweep_batch
    ball_radius = np.repeat(np.broadcast_to(task.params.ball_radius, n), NUM_BOUNCE_RAYS)
    cup_radius = np.repeat(np.broadcast_to(task.params.cup_radius, n), NUM_BOUNCE_RAYS)
    cup = np.repeat(np.broadcast_to(task.params.cup, (n, 3)), NUM_BOUNCE_RAYS, axis=0)
    angles = 2.0 * math.pi * np.arange(NUM_BOUNCE_RAYS) / NUM_BOUNCE_RAYS
    direction = np.tile(np.stack([np.cos(angles), np.sin(angles)], axis=-1), (n, 1))
    position = np.repeat(raised_origins(task, positions), NUM_BOUNCE_RAYS, axis=0)
    origin = position.copy()
    top = position[:, 2].copy()
    slope = np.zeros(len(position))
    segment = np.zeros(len(position), dtype=np.int64)
    segments = np.zeros((len(position), NUM_SEGMENTS, FEATURES_PER_SEGMENT))

    for _ in range(MAX_RAY_STEPS):
        # Sweep the rays that have not ended ahead, up to what they hit.
        active = segment < NUM_SEGMENTS
        step = np.where(active[:, None], RAY_STEP_LENGTH * np.column_stack([direction, slope]), 0.0)
        ahead = sweep(position, position + step)
        hit = np.asarray(ahead.hit) & active
        normal = np.asarray(ahead.normal)
        fraction = np.maximum(np.asarray(ahead.alpha) - hit * (HIT_STANDOFF / RAY_STEP_LENGTH), 0.0)
        position += fraction[:, None] * step
        top = np.maximum(top, position[:, 2])
        hits_wall = hit & (normal[:, 2] < MAX_WALL_NORMAL_Z)
        hits_slope = hit & ~hits_wall
        # Bring rays down to the ground, but not into the cup.
        probes = active & ~hits_slope
        below = sweep(position, position + probes[:, None] * np.array([0.0, 0.0, -MAX_DROP_PER_STEP]))
        drops = np.asarray(below.hit) & probes
        drops &= np.hypot(position[:, 0] - cup[:, 0], position[:, 1] - cup[:, 1]) >= cup_radius + 0.5 * ball_radius
        drop = np.maximum(MAX_DROP_PER_STEP * np.asarray(below.alpha) - ball_radius, 0.0)
        position[:, 2] -= np.where(drops, drop, 0.0)
        # Reflect rays off walls. A ceiling has no horizontal normal.
        rows = np.flatnonzero(hits_wall)
        wall_normal = normal[hits_wall, :2]
        lengths = np.hypot(wall_normal[:, 0], wall_normal[:, 1])
        wall_normal /= np.maximum(lengths, MIN_DIRECTION_LENGTH)[:, None]
        segments[rows, segment[rows]] = _segment_features(origin[rows], position[rows], wall_normal, top[rows])
        direction[rows] -= 2.0 * (direction[rows] * wall_normal).sum(-1)[:, None] * wall_normal
        segment[rows] += 1
        # Turn rays that hit a slope upwards along it.
        rise = -(direction * normal[:, :2]).sum(-1) / np.maximum(normal[:, 2], MAX_WALL_NORMAL_Z)
        slope = np.where(hits_slope, rise, 0.0)
    # End the segments that hit no wall.
    for k in range(NUM_SEGMENTS):
        rows = np.flatnonzero(segment <= k)
        segments[rows, k] = _segment_features(origin[rows], position[rows], np.zeros((len(rows), 2)), top[rows])
    return segments.reshape(n, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT)


def _segment_features(origin: FloatArray, end: FloatArray, wall_normal: FloatArray, top: FloatArray) -> FloatArray:
    """Return the features (K, FEATURES_PER_SEGMENT) of segments, m.

    Args:
        origin: (K, 3) origins of the rays.
        end: (K, 3) ends of the segments.
        wall_normal: (K, 2) horizontal normals of the walls there; 0 if there is none.
        top: (K,) greatest z of the rays so far.
    """
    offset = end - origin
    return np.column_stack([offset[:, :2], wall_normal, offset[:, 2], top - origin[:, 2]])
