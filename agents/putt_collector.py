"""Simulation of candidate putts, as training data for a Q-function over putts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs.rewards import shaping_potential
from minigolf_env.envs.task import TaskBatch
from minigolf_env.players.putt_features import MAX_ROLL, NUM_FEATURES, putt_actions, putt_features
from minigolf_env.players.putt_optimizer import MIN_ROLL, TRAINING_PUTT_GRID, BestPutts, optimize_putt
from minigolf_env.players.putt_value_model import PuttValueModel

Array = NDArray[np.float32]

RANDOM_ROLL_RANGE = (0.4, MAX_ROLL)
"""Range of the roll of random candidates, m; log-uniform."""

DIRECTION_STD_RANGE = (0.003, 0.3)
"""Range of the standard deviation of the direction of candidates close to the greedy one, radians; log-uniform."""

LOG_ROLL_STD_RANGE = (0.01, 0.5)
"""Range of the standard deviation of the logarithm of their roll; log-uniform."""


class PuttCollector:
    """Plays putts in vector environments, and simulates candidate putts from each ball position.

    Args:
        envs: vector environments with observation "bounce_rays".
        rng: random generator.
        num_candidates: number of putts simulated from each ball position; one of them is played.
        greedy_prob: probability that the greedy candidate is played; otherwise it is a random one of the candidates.
        putt_noise: standard deviations of a putt's direction (degrees) and speed (fraction of it).
    """

    def __init__(
        self,
        envs: Sequence[gym.vector.VectorEnv[Any, Any, Any]],
        rng: np.random.Generator,
        *,
        num_candidates: int,
        greedy_prob: float,
        putt_noise: tuple[float, float],
    ) -> None:
        self._envs: Sequence[Any] = envs
        self._rng = rng
        self._num_candidates = num_candidates
        self._greedy_prob = greedy_prob
        self._putt_noise = putt_noise
        self._observations = [vector_env.reset(seed=int(rng.integers(2**31)))[0] for vector_env in envs]

    def collect(self, q_function: PuttValueModel) -> tuple[Array, Array]:
        """Simulate candidate putts from the ball position in each environment, and play one of them.

        Returns:
            The features (N, NUM_FEATURES) of all candidates and their targets (N, 2): 1 if the putt holes out, else 0;
            and the strokes that remain if it does not, as the potential of the shaped reward estimates them.
        """
        parts = [self._collect_from_batch(q_function, k) for k in range(len(self._envs))]
        features, targets = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        return features, targets

    def _collect_from_batch(self, q_function: PuttValueModel, k: int) -> tuple[Array, Array]:
        """Simulate candidates and play one in each environment of ``envs[k]``; return features and targets."""
        rng = self._rng
        envs = self._envs[k].unwrapped
        observations = self._observations[k]

        # Simulate the candidates.
        greedy = optimize_putt(observations, q_function.expected_strokes, TRAINING_PUTT_GRID, rng)
        directions, rolls = self._propose_candidates(greedy)
        outcome = envs.what_if(putt_actions(*self._add_putt_noise(directions, rolls)))
        tasks: TaskBatch = envs.task_batch
        remaining = -shaping_potential(tasks, outcome.position)

        # Play one candidate of each ball: the greedy one, which is the first, or a random one.
        candidates = rng.integers(self._num_candidates, size=len(observations))
        is_greedy = rng.random(len(observations)) < self._greedy_prob
        played = np.arange(len(observations)), np.where(is_greedy, 0, candidates)
        self._observations[k] = envs.step(putt_actions(directions[played], rolls[played]))[0]

        features = putt_features(observations, directions, rolls[..., None])
        targets = np.stack([outcome.holed, remaining], -1, dtype=np.float32)
        return features.reshape(-1, NUM_FEATURES), targets.reshape(-1, 2)

    def _propose_candidates(self, greedy: BestPutts) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return directions and rolls (N, num_candidates): the greedy putt, then half close to it, the rest random."""
        rng = self._rng
        shape = len(greedy.roll), self._num_candidates
        direction_noise = log_uniform(rng, DIRECTION_STD_RANGE, shape) * rng.normal(size=shape)
        log_roll_noise = log_uniform(rng, LOG_ROLL_STD_RANGE, shape) * rng.normal(size=shape)
        index = np.broadcast_to(np.arange(self._num_candidates), shape)
        is_close = index <= self._num_candidates // 2
        directions = greedy.direction[:, None] + direction_noise * (index > 0)
        rolls = np.clip(greedy.roll[:, None] * np.exp(log_roll_noise * (index > 0)), MIN_ROLL, MAX_ROLL)
        random_rolls = log_uniform(rng, RANDOM_ROLL_RANGE, shape)
        random_directions = rng.uniform(0.0, 2.0 * np.pi, shape)
        return np.where(is_close, directions, random_directions), np.where(is_close, rolls, random_rolls)

    def _add_putt_noise(self, directions: NDArray[Any], rolls: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return directions and rolls with putt noise, which ``what_if`` does not add.

        As in ``TaskBatch.launch_velocity`` the noise turns the putt and scales its speed; roll grows as speed squared.
        """
        degrees, speed_std = self._putt_noise
        direction_noise, speed_noise = self._rng.normal(size=(2, *rolls.shape))
        speed_factors = np.maximum(0.0, 1.0 + speed_std * speed_noise)
        return directions + np.radians(degrees) * direction_noise, rolls * np.square(speed_factors)


def log_uniform(rng: np.random.Generator, bounds: tuple[float, float], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return random numbers whose logarithms are uniform."""
    low, high = bounds
    return np.exp(rng.uniform(math.log(low), math.log(high), shape))
