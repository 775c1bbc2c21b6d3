"""The optimizer of putts finds the least cost, independently of the batch."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfVectorEnv
from minigolf_env.players.putt_features import CUP_INDEX, MAX_ROLL, NUM_FEATURES, NUM_SEGMENTS
from minigolf_env.players.putt_optimizer import PuttGrid, optimize_putt
from minigolf_env.players.putt_value_model import PuttValueModel
from tests.players.samples import random_mlp, random_observations


def random_value_model() -> PuttValueModel:
    """Return a value model with random weights."""
    return PuttValueModel(random_mlp(NUM_FEATURES, 16, 2, activation="relu"))


def test_finds_minimum_of_cost() -> None:
    """The minimum is found to the last grid step, with a regular first grid and with a random one."""
    observations = random_observations(3)
    observations[:, CUP_INDEX : CUP_INDEX + 2] = [0.5, 0.0]  # 2 m along x.

    def cost(features: NDArray[Any]) -> NDArray[np.float32]:
        """Return a cost with its minimum at a direction of 0.4 and a roll distance of 3 m."""
        cup_along = features[..., 8] * 4.0
        roll = features[..., 14 + 11 * NUM_SEGMENTS] * MAX_ROLL
        direction_cost = np.square(4.0 * cup_along - 8.0 * np.cos(0.4))
        return np.asarray(direction_cost + np.square(np.log(roll / 3.0)), dtype=np.float32)

    for rng in (None, np.random.default_rng(0)):
        putts = optimize_putt(observations, cost, PuttGrid(48, 6, 3), rng)
        np.testing.assert_allclose(np.abs((putts.direction + np.pi) % (2.0 * np.pi) - np.pi), 0.4, atol=0.03)
        np.testing.assert_allclose(putts.roll, 3.0, rtol=0.1)
        np.testing.assert_allclose(np.square(np.hypot(*putts.actions.T)) * MAX_ROLL, putts.roll, rtol=1e-5)


@pytest.mark.parametrize("n", [1, 2, 33, 70])
def test_putt_has_same_bits_in_any_batch(n: int) -> None:
    """The number of balls that are optimized together does not change a putt."""
    observations, cost = random_observations(70), random_value_model().expected_strokes
    whole = optimize_putt(observations, cost)
    for first in (0, 70 - n):
        part = optimize_putt(observations[first : first + n], cost)
        for part_array, whole_array in zip(part, whole, strict=True):
            assert part_array.tobytes() == whole_array[first : first + n].tobytes()


def test_costs_and_actions_are_finite_on_levels() -> None:
    """Costs and actions are finite for balls on the tees and where putts have led."""
    envs = MiniGolfVectorEnv(32, "procedural", difficulty="hard", num_levels=8, observation="bounce_rays")
    observations, _ = envs.reset(seed=0)
    for _ in range(3):
        putts = optimize_putt(observations, random_value_model().expected_strokes, PuttGrid(8, 3, 1))
        assert np.isfinite(putts.cost).all() and np.isfinite(putts.actions).all()
        observations, *_ = envs.step(putts.actions)
