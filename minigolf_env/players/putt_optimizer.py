"""Find the putt with the least cost by a grid over direction and roll distance, refined around the best putts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.players.putt_features import MAX_ROLL, Array, cup_position, putt_actions, putt_features


class PuttGrid(NamedTuple):
    """Resolution of the optimization."""

    directions: int
    """Number of directions in the first grid, at least 1."""
    rolls: int
    """Number of roll distances in each direction of the first grid, at least 2."""
    refinements: int
    """Number of refinements around the NUM_BEST_PUTTS best putts so far; each has a four times finer grid."""


TRAINING_PUTT_GRID = PuttGrid(24, 4, 2)
"""Resolution for collecting training data: the cost of 276 putts."""

PLAYING_PUTT_GRID = PuttGrid(48, 6, 2)
"""Resolution for playing: the cost of 468 putts."""

NUM_BEST_PUTTS = 6
"""Number of putts that a refinement starts from."""

DIRECTION_OFFSETS = np.array([-1.5, -0.5, 0.0, 0.5, 1.5])
"""Directions of a refinement, relative to the refined putt, in grid steps."""

ROLL_OFFSETS = np.array([-1.0, 0.0, 1.0])
"""Logarithms of the roll distances of a refinement, relative to the refined putt, in grid steps."""

FIRST_ROLL_RANGE = (0.5, 0.98 * MAX_ROLL)
"""Least and greatest roll distance in the first grid, m."""

MIN_ROLL = 0.2
"""Least roll distance of any putt, m."""

MAX_BALLS_PER_BLOCK = 32
"""Largest number of balls whose putts are evaluated together: their features fit into the processor's cache."""


class BestPutts(NamedTuple):
    """The best putt for each of N balls."""

    direction: NDArray[np.float64]
    """Directions, radians, shape (N,)."""
    roll: NDArray[np.float64]
    """Roll distances, m, shape (N,)."""
    cost: Array
    """Costs, shape (N,)."""

    @property
    def actions(self) -> Array:
        """Actions of the environment, shape (N, 2)."""
        return putt_actions(self.direction, self.roll)


def optimize_putt(
    observations: NDArray[Any],
    cost: Callable[[Array], Array],
    grid: PuttGrid = PLAYING_PUTT_GRID,
    rng: np.random.Generator | None = None,
) -> BestPutts:
    """Return the putt with the least cost for each ball: of a grid, then of finer grids around the best putts so far.

    Args:
        observations: observations of the kind "bounce_rays", shape (N, 2320), N >= 1.
        cost: maps the features of putts (..., NUM_FEATURES) to their costs (...).
        grid: resolution of the grids.
        rng: randomizes the first putts; None: they form a regular grid that contains the direction of the cup.
    """
    observations = np.asarray(observations, dtype=np.float32)
    blocks = [
        _optimize_block(observations[i : i + MAX_BALLS_PER_BLOCK], cost, grid, rng)
        for i in range(0, len(observations), MAX_BALLS_PER_BLOCK)
    ]
    return BestPutts(*(np.concatenate(arrays) for arrays in zip(*blocks, strict=True)))


def _optimize_block(
    observations: Array, cost: Callable[[Array], Array], grid: PuttGrid, rng: np.random.Generator | None
) -> BestPutts:
    # Lay the first grid: all around, beginning with the direction of the cup, and evenly in the logarithm of the roll.
    n = len(observations)
    low, high = (math.log(roll) for roll in FIRST_ROLL_RANGE)
    steps = np.array([2.0 * math.pi / grid.directions, (high - low) / (grid.rolls - 1)])
    cup = cup_position(observations)
    direction = np.arctan2(cup[:, 1], cup[:, 0])[:, None] + steps[0] * np.arange(grid.directions)
    log_roll = np.tile(np.linspace(low, high, grid.rolls), (n, grid.directions, 1))
    if rng is not None:
        direction = direction + steps[0] * rng.uniform(-0.5, 0.5, direction.shape)
        log_roll = rng.uniform(low, high, log_roll.shape)
    rows = np.arange(n)[:, None]
    evaluated: list[list[NDArray[Any]]] = []
    for refinement in range(grid.refinements + 1):
        # Evaluate the grid, and rank all putts so far.
        costs = cost(putt_features(observations, direction, np.exp(log_roll)))
        putts = np.broadcast_to(direction[..., None], log_roll.shape), log_roll, costs
        evaluated.append([array.reshape(n, -1) for array in putts])
        directions, log_rolls, all_costs = (np.concatenate(arrays, axis=1) for arrays in zip(*evaluated, strict=True))
        order = np.argsort(all_costs, axis=1, kind="stable")[:, :NUM_BEST_PUTTS]
        # Lay a finer grid around the best ones.
        if refinement < grid.refinements:
            steps = steps / 4.0
            direction = (directions[rows, order][..., None] + steps[0] * DIRECTION_OFFSETS).reshape(n, -1)
            best_rolls = np.repeat(log_rolls[rows, order], len(DIRECTION_OFFSETS), axis=1)
            log_roll = np.clip(best_rolls[..., None] + steps[1] * ROLL_OFFSETS, math.log(MIN_ROLL), high)
    best = rows[:, 0], order[:, 0]
    return BestPutts(directions[best], np.exp(log_rolls[best]), all_costs[best])
