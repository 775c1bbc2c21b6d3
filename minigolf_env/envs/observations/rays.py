"""The observation "rays": what a ball can feel of a hole it has never seen."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.envs.task import STATE_FEATURES, FloatArray, TaskBatch, components

NUM_RAYS = 32
"""Horizontal directions, the first along x, counter-clockwise."""

MAX_RAY_LENGTH = 4.0
"""How far a ray goes, m: most of a lane."""

RAY_ORIGIN_LIFT = 1.0
"""How far above its lie the ball is moved along a ray, in radii: over the grain of the ground, into any border."""

GROUND_PROBE_DEPTH = 0.5
"""How far below the ball the ground is looked for, m."""

MIN_DIRECTION_LENGTH = 1e-9
"""The least length that a direction is computed with, m."""

MIN_SLOPE_NORMAL_Z = 0.1
"""The least upward part of a normal that a slope is computed with."""

RAY_ANGLES = 2.0 * math.pi * np.arange(NUM_RAYS) / NUM_RAYS
RAY_VECTORS = MAX_RAY_LENGTH * np.stack([np.cos(RAY_ANGLES), np.sin(RAY_ANGLES), np.zeros(NUM_RAYS)], axis=-1)
NUM_GROUND_FEATURES = 3
"""Numbers about the ground: how far below the ball, and the slope along x and y."""

NUM_CUP_FEATURES = 3
"""Numbers about the cup in a scale that is the same on every hole: the straight putt along x and y, and the height."""

CUP_DISTANCE_SCALE, CUP_HEIGHT_SCALE = 8.0, 1.0
"""How far the cup is at most, horizontally and vertically, m."""


def ray_space() -> Space[NDArray[np.float32]]:
    """Return the space of "rays" observations: "state"'s 10 numbers, RAYS distances, GROUND and CUP numbers."""
    numbers = len(STATE_FEATURES) + NUM_RAYS + NUM_GROUND_FEATURES + NUM_CUP_FEATURES
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (numbers,), np.float32))


def observe_rays(game: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return observations (N, 48) of balls at positions (N, 3), m, after a number of strokes (N,).

    A ray is the way that the ball itself has free in its direction, by the exact sweep. Where it has no room to be
    lifted (under a low roof) it is swept from where it lies.
    """
    starts = raised_origins(game, positions)
    rays = game.world.sweep_batch(np.repeat(starts, NUM_RAYS, axis=0), (starts[:, None] + RAY_VECTORS).reshape(-1, 3))
    distances = np.asarray(rays.alpha).reshape(-1, NUM_RAYS)
    felt = np.concatenate([distances, ground_and_cup_features(game, positions)], axis=1)
    return append_to_state(game, positions, strokes, felt)


def append_to_state(
    game: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64], felt: FloatArray
) -> NDArray[np.float32]:
    """Return observations (N, 10 + K): "state"'s numbers, then those that are felt (N, K), clipped to [-1, 1]."""
    return np.concatenate([game.observe(positions, strokes), np.clip(felt, -1.0, 1.0).astype(np.float32)], axis=1)


def raised_origins(game: TaskBatch, positions: FloatArray) -> FloatArray:
    """Return where rays of balls at positions (N, 3) begin, (N, 3), m."""
    up = RAY_ORIGIN_LIFT * game.params.ball_radius[..., None] * np.array([0.0, 0.0, 1.0])
    has_room = ~np.asarray(game.world.sweep_batch(positions, positions + up).hit)
    return np.asarray(positions + has_room[:, None] * up)


def ground_and_cup_features(game: TaskBatch, positions: FloatArray) -> FloatArray:
    """Return GROUND and CUP numbers (N, 6) of balls at positions (N, 3), m; they may be beyond -1 and 1."""
    ground = game.world.sweep_batch(positions, positions + np.array([0.0, 0.0, -GROUND_PROBE_DEPTH]))
    normals = np.asarray(ground.normal)
    slopes = -normals[:, :2] / np.maximum(normals[:, 2:], MIN_SLOPE_NORMAL_Z)
    slopes[~np.asarray(ground.hit)] = 0.0
    x, y, height = components(game.params.cup - positions)
    away = np.hypot(x, y)
    # As long as the root of the distance, and 1 from AWAY on.
    scale = np.maximum(np.maximum(np.sqrt(CUP_DISTANCE_SCALE * away), away), MIN_DIRECTION_LENGTH)
    cup = np.stack([x / scale, y / scale, height / CUP_HEIGHT_SCALE], axis=-1)
    return np.concatenate([np.asarray(ground.alpha)[:, None], slopes, cup], axis=1)
