"""The observation "state": ten numbers about a ball on a known hole."""

from __future__ import annotations

from typing import cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.task import TaskBatch

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


def state_space() -> Space[NDArray[np.float32]]:
    """Return the space of "state" observations (10,)."""
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (len(STATE_FEATURES),), np.float32))


def observe_state(
    task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64], state: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return a copy of the features ``state`` (N, 10), which the rules compute (``rules.write_state``)."""
    return state.copy()


def append_to_state(state: NDArray[np.float32], num_features: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return observations (N, 10 + K) that begin with ``state`` (N, 10), and a view (N, K) of the rest to fill in."""
    observations = np.empty((len(state), state.shape[1] + num_features), np.float32)
    observations[:, : state.shape[1]] = state
    return observations, observations[:, state.shape[1] :]
