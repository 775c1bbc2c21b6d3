"""A stroke: the recorded path of one putt or throw, and the predicted path of one that is being aimed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics import World

FloatArray = NDArray[np.float64]

HUMAN_NAME = "You"
"""Name of the human player in messages and on the score card."""

MAX_PREDICTION_TIME = 8.0
"""Longest time that a prediction simulates, s."""

PREDICTION_AFTER_BOUNCE = 0.3
"""Length of the predicted path after its first bounce, m."""

GROUND_NORMAL_Z = 0.7
"""Contacts whose normal has a larger z component are with the ground; they do not count as a bounce."""


class PlayedStroke(NamedTuple):
    """One ball that was putted or thrown."""

    player: str
    """Name of the player."""
    path: FloatArray
    """(T, 3) centre of the ball at ``times``, m."""
    times: FloatArray
    """(T,) times since the launch, s."""
    next_position: FloatArray
    """(3,) centre of the ball before the next stroke, m."""
    status: str
    """End of the stroke, as in the info of ``MiniGolfEnv.step``: "rest", "holed", "out_of_bounds" or "time_limit"."""


def path_to_first_bounce(world: World, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return the path (K, 3), m, of a ball up to PREDICTION_AFTER_BOUNCE after its first bounce off a wall."""
    shot = world.simulate(position, velocity, MAX_PREDICTION_TIME, record=True)
    path = np.asarray(shot.path)
    times = np.asarray(shot.times)
    contacts = shot.impacts
    if contacts is None or not len(bounces := contacts[contacts["normal"][:, 2] < GROUND_NORMAL_Z]):
        return path
    first = bounces[0]
    before = path[times < first["time"]]
    after = np.concatenate([first["position"][None], path[times > first["time"]]])
    travelled = np.cumsum(np.linalg.norm(np.diff(after, axis=0), axis=1))
    return np.concatenate([before, after[: 1 + np.searchsorted(travelled, PREDICTION_AFTER_BOUNCE)]])
