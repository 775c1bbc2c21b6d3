"""One stroke of N balls: launch, simulation, end of the episode, reward. A single environment is the case N = 1."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs.generators import restore_on_error
from minigolf_env.envs.rewards import CheckedReward, RewardFunction
from minigolf_env.envs.task import FloatArray, Outcome, TaskBatch


class Stroke(NamedTuple):
    """A stroke of N balls."""

    velocity: FloatArray
    """Launch velocities (N, 3), m/s, with the noise of the putts."""
    outcome: Outcome
    """Where the balls came to rest, and how."""
    ended: NDArray[np.bool_]
    """(N,): the episode ended with this stroke."""
    reward: FloatArray
    """(N,)."""


def play_stroke(
    task: TaskBatch,
    reward: RewardFunction,
    positions: FloatArray,
    actions: FloatArray,
    strokes: NDArray[np.int64],
    rngs: Collection[np.random.Generator],
) -> Stroke:
    """Return what the actions (N, 2) lead to, from balls at positions (N, 3) after a number of strokes (N,).

    Args:
        task: the rules and holes of the balls.
        reward: the reward function.
        positions: the balls' centres, m; they are not changed.
        actions: the putts.
        strokes: strokes of the episodes before this one.
        rngs: N generators of the putts' noise, advanced if the task has noise. An error of the reward leaves them as
            they were.
    """
    # Generators are saved only where an error can follow the draw: reading their states takes 2 us each.
    with restore_on_error(rngs if task.is_noisy and isinstance(reward, CheckedReward) else ()):
        noise = task.sample_noise(rngs) if task.is_noisy else None
        velocity = task.launch_velocity(actions, noise)
        outcome = task.simulate(positions, velocity)
        ended = outcome.holed | (strokes + 1 >= task.max_strokes)
        return Stroke(velocity, outcome, ended, np.asarray(reward(positions, outcome, ended, task)))
