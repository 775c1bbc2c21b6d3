"""Search: the putt that a perfect player would choose, by trying many from where the ball lies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.task import FloatArray

DIRECTIONS, SPEEDS = 120, 32
"""The first putts: every 3 degrees, at 32 shares of the top speed."""

ROUNDS = 4
"""Refinements; each looks three times closer than the one before, the last at 0.04 degrees and 0.04 % of the speed."""

BEST = 40
"""Putts that a refinement starts from."""


class Plan(NamedTuple):
    """What search found."""

    action: NDArray[np.float32]
    """(2,) the putt to play."""
    holed: bool
    """Whether it holes out (without putt noise)."""
    distance: float
    """How far from the cup, along the course, it leaves the ball, m; 0 when holed."""
    tried: int
    """Putts simulated."""


def search(env: MiniGolfEnv, directions: int = DIRECTIONS, speeds: int = SPEEDS, rounds: int = ROUNDS) -> Plan:
    """Return the best putt found from the environment's present state, which stays as it is.

    A grid over direction and speed, then ever finer grids around the putts that ended closest to the cup, until one
    holes out. Deterministic; blind to ``putt_noise``.

    Raises:
        ValueError: directions or speeds below 1, or rounds below 0.
        ResetNeeded: the environment was not reset.
    """
    if directions < 1 or speeds < 1 or rounds < 0:
        received = directions, speeds, rounds
        raise ValueError(f"search: expected directions and speeds >= 1 and rounds >= 0, received {received}.")
    step = np.array([2.0 * np.pi / directions, 1.0 / speeds])
    polar = _grid(np.arange(directions) * step[0], np.arange(1, speeds + 1) * step[1])
    scores = _scores(env, polar)
    tried = len(polar)
    for _ in range(rounds):
        if scores.min() <= 0.0:
            break
        step = step / 3.0
        around = _grid(np.array([-1.0, 0.0, 1.0]) * step[0], np.array([-1.0, 0.0, 1.0]) * step[1])
        around = np.delete(around, 4, axis=0)  # The middle is already known.
        closest = np.argsort(scores, kind="stable")[:BEST]
        finer = (polar[closest, None] + around).reshape(-1, 2)
        finer[:, 1] = np.clip(finer[:, 1], 0.0, 1.0)
        polar, scores = np.concatenate([polar, finer]), np.concatenate([scores, _scores(env, finer)])
        tried += len(finer)
    best = int(np.argmin(scores))
    return Plan(_actions(polar[best]).astype(np.float32), bool(scores[best] <= 0.0), float(scores[best]), tried)


def _grid(directions: FloatArray, speeds: FloatArray) -> FloatArray:
    """Return all pairs (N, 2) of direction and speed."""
    return np.stack(np.meshgrid(directions, speeds, indexing="ij"), axis=-1).reshape(-1, 2)


def _actions(polar: FloatArray) -> FloatArray:
    """Return putt vectors (..., 2) of directions (radians) and speeds (share of the top speed)."""
    return np.asarray(polar[..., 1:] * np.stack([np.cos(polar[..., 0]), np.sin(polar[..., 0])], axis=-1))


def _scores(env: MiniGolfEnv, polar: FloatArray) -> FloatArray:
    """Return what putts leave: the distance to the cup along the course, and no more than zero for a holed one.

    The putt to be played is rounded to float32, as actions are.
    """
    outcome = env.what_if(_actions(polar).astype(np.float32))
    return np.asarray(np.where(outcome.holed, 0.0, env.task.distance(outcome.position)))
