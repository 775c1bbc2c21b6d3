"""The observation "state": ten numbers about a ball on a known hole."""

from __future__ import annotations

from typing import cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.envs.hole_params import FloatArray
from minigolf_env.envs.task import TaskBatch, components

STATE_FEATURES = (
    "ball x",
    "ball y",
    "ball z",
    "to cup x",
    "to cup y",
    "to cup z",
    "straight putt x",
    "straight putt y",
    "root of cup distance",
    "strokes left",
)
"""Names of the numbers of a "state" observation; MiniGolfEnv's docstring gives their scales."""

MIN_CUP_DISTANCE = 1e-9
"""Smallest horizontal distance to the cup that the direction to it is divided by, m."""


def state_space() -> Space[NDArray[np.float32]]:
    """Return the space of "state" observations (10,)."""
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (len(STATE_FEATURES),), np.float32))


def observe_state(task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return observations (..., 10) of balls at positions (..., 3), m, after a number of strokes (...)."""
    ball = components(positions)
    lower = components(task.params.bounds[..., 0, :])
    upper = components(task.params.bounds[..., 1, :])
    # Scale the ball's position within the bounds to -1 to 1.
    sides = [high - low for high, low in zip(upper, lower, strict=True)]
    scaled_ball = [2.0 * (p - low) / side - 1.0 for p, low, side in zip(ball, lower, sides, strict=True)]
    # Compute the vector to the cup in units of the bounds' horizontal diagonal, and the straight putt.
    diagonal = np.sqrt(sides[0] * sides[0] + sides[1] * sides[1])
    to_cup = [c - p for c, p in zip(components(task.params.cup), ball, strict=True)]
    distance = np.hypot(to_cup[0], to_cup[1])
    root = np.sqrt(distance / diagonal)
    straight_putt = [root * component / np.maximum(distance, MIN_CUP_DISTANCE) for component in to_cup[:2]]
    scaled_to_cup = (component / diagonal for component in to_cup)
    # Compute the fraction of the strokes that is left.
    strokes_left = np.asarray(1.0 - np.asarray(strokes) / task.max_strokes)
    features = np.stack([*scaled_ball, *scaled_to_cup, *straight_putt, root, strokes_left], axis=-1)
    return np.clip(features, -1.0, 1.0, out=features).astype(np.float32)


def append_to_state(
    task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64], features: FloatArray
) -> NDArray[np.float32]:
    """Return observations (N, 10 + K): the numbers of "state", then the features (N, K), clipped to [-1, 1]."""
    clipped = np.clip(features, -1.0, 1.0).astype(np.float32)
    return np.concatenate([observe_state(task, positions, strokes), clipped], axis=1)
