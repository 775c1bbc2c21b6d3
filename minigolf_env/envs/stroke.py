"""One stroke of N balls: launch, simulation, end of the episode, reward. A single environment is the case N = 1."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs.generators import restore_on_error
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.rewards import CheckedReward, RewardFunction
from minigolf_env.envs.task import Outcome, TaskBatch


class StrokeResult(NamedTuple):
    """Result of a stroke of N balls."""

    velocity: FloatArray
    """Launch velocities (N, 3), m/s, with the noise of the putts."""
    outcome: Outcome
    """Outcome of the stroke."""
    state: NDArray[np.float32]
    """(N, 10) observations "state" after the stroke."""
    ended: NDArray[np.bool_]
    """(N,) bool: the episode ended with this stroke."""
    reward: FloatArray
    """(N,) rewards of the stroke."""


def play_stroke(
    task: TaskBatch,
    reward: RewardFunction,
    positions: FloatArray,
    actions: FloatArray,
    strokes: NDArray[np.int64],
    rngs: Collection[np.random.Generator],
) -> StrokeResult:
    """Play one stroke of N balls and return its result. Only the generators change.

    Args:
        task: the rules and holes of the balls.
        reward: the reward function.
        positions: (N, 3) the balls' centres, m.
        actions: (N, 2) the putts.
        strokes: (N,) number of strokes of the episodes before this one.
        rngs: N generators of the putts' noise, advanced if the task has noise. An error of the reward leaves them as
            they were.
    """
    # Generators are saved only where an error can follow the draw: reading their states takes 2 us each.
    with restore_on_error(rngs if task.is_noisy and isinstance(reward, CheckedReward) else ()):
        noise = task.sample_noise(rngs) if task.is_noisy else None
        velocity, outcome, state = task.play(positions, actions, strokes, noise)
        ended = outcome.holed | (strokes + 1 >= task.max_strokes)
        return StrokeResult(velocity, outcome, state, ended, np.asarray(reward(positions, outcome, ended, task)))
