"""Search for the best putt by simulating many putts from the ball's position.

Search looks for a putt that holes out without noise. If there is none, it looks for two putts that hole out. If there
is one and putts are noisy, it looks for the putt with the fewest expected strokes under the noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import quote
from minigolf_env.envs import MiniGolfEnv, Task
from minigolf_env.envs.config import check_noise
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.rewards import shaping_potential

IntArray = NDArray[np.int64]


class SearchBudget(NamedTuple):
    """Resolution of a search."""

    directions: int
    """Number of directions in the first grid, at least 1."""
    speeds: int
    """Number of speeds in the first grid, up to the top speed, at least 1."""
    refinements: int
    """Number of refinements of the grid, at least 0; each has a three times finer grid."""


QUICK_SEARCH = SearchBudget(48, 8, 1)
"""Resolution that finds a holing putt from most positions."""

THOROUGH_SEARCH = SearchBudget(120, 32, 4)
"""Resolution whose last grid has steps of 0.04 degrees and 0.04 % of the top speed."""

NUM_PUTTS_TO_REFINE = 40
"""Number of putts that a refinement starts from."""

MAX_SECOND_PUTT_STARTS = 16
"""Largest number of resting places of the first putt from which second putts are searched."""

MIN_START_SPACING = 0.25
"""Smallest distance between two resting places from which second putts are searched, m."""

MAX_NOISE_CANDIDATES = 96
"""Largest number of candidates whose expected strokes under noise are compared in the first stage."""

MIN_CANDIDATE_SPACING = 0.02
"""Smallest distance between two candidates of the first stage, as putt vectors."""

NOISE_STAGES = ((16, 6), (32, 3), (64, 1))
"""Stages of the search under noise: number of noise samples, and number of candidates kept.

This is successive halving with common random numbers: each stage compares fewer candidates by more samples, the same
for every candidate. Neighbors of the candidates that a stage keeps are added to the next one.
"""


class Plan(NamedTuple):
    """The result of a search."""

    action: NDArray[np.float32]
    """The putt to play, shape (2,)."""
    holed: bool
    """True if the putt holes out without noise."""
    distance: float
    """Distance along the course from the cup to where the putt leaves the ball without noise, m; 0 if it holes out."""
    strokes: float
    """Number of strokes to hole out, including this one.

    Without noise it is 1 or 2 if search found putts that hole out. Every other number is an estimate: the expected
    strokes under noise, or the distance that remains, converted to strokes as by reward shaping.
    """
    num_simulated: int
    """Number of putts that were simulated."""


def search(
    env: gym.Env[Any, Any],
    budgets: Sequence[SearchBudget] = (QUICK_SEARCH, THOROUGH_SEARCH),
    *,
    look_ahead: bool = True,
    noise: tuple[float, float] | None = None,
) -> Plan:
    """Return the best putt found from the environment's current state. The state does not change.

    Search simulates a grid over direction and speed, then finer grids around the putts that ended closest to the cup.
    If a putt holes out and there is noise, putts are compared by their expected strokes under the noise. If none holes
    out, second putts are simulated from resting places of the first, without noise. The result is deterministic.

    Args:
        env: a MiniGolfEnv, wrapped or not.
        budgets: resolutions, tried in order until one finds a putt that holes out.
        look_ahead: search for a second putt if none holes out. If False, the plan is then the putt that ends closest to
            the cup along the course, or, with noise, the one with the fewest expected strokes.
        noise: standard deviations of direction (degrees) and speed (fraction of it) to plan for; None: the
            environment's ``putt_noise``. The same fixed noise samples are used for every putt, never the environment's.

    Raises:
        ValueError: a budget without directions or speeds, or with refinements below 0; no budgets; a negative noise.
        ResetNeeded: the environment was not reset.
    """
    for budget in budgets:
        if budget.directions < 1 or budget.speeds < 1 or budget.refinements < 0:
            raise ValueError(
                f"budgets: expected directions and speeds >= 1 and refinements >= 0, received {quote(budget)}."
            )
    if not budgets:
        raise ValueError("budgets: expected at least one, received none.")
    golf = cast(MiniGolfEnv, env.unwrapped)
    task = golf.task if noise is None else replace(golf.task, putt_noise=check_noise(noise))
    start = np.array(golf.get_state()["position"])[None]
    num_simulated = 0
    # Search for a putt that holes out.
    for budget in budgets:
        putts = _grid_search(task, start, budget)
        num_simulated += len(putts.holed)
        if putts.holed.any():
            break
    # If there is none, search for two putts.
    if look_ahead and not putts.holed.any():
        best, strokes, num_second = _two_putt_search(task, putts, budgets[0])
        return _plan(putts, best, strokes, num_simulated + num_second)
    # Choose the putt with the fewest expected strokes.
    if task.is_noisy:
        return _plan_under_noise(task, start, putts, num_simulated)
    best = int(np.argmin(putts.distance))
    strokes = float(_strokes_left(task, putts.end[best], putts.holed[best])) + 1.0
    return _plan(putts, best, strokes, num_simulated)


class _SimulatedPutts(NamedTuple):
    """Simulated putts and their ends."""

    start: IntArray
    """Row of the position that a putt starts from, shape (N,)."""
    polar: FloatArray
    """Direction, radians, and fraction of the top speed, shape (N, 2)."""
    end: FloatArray
    """Position where a putt leaves the ball, m, shape (N, 3)."""
    holed: NDArray[np.bool_]
    """True if the putt holes out, shape (N,)."""
    distance: FloatArray
    """Distance along the course from that position to the cup, m; 0 if the putt holes out; shape (N,)."""


def _plan(putts: _SimulatedPutts, best: int, strokes: float, num_simulated: int) -> Plan:
    return Plan(
        action=_actions(putts.polar[best]),
        holed=bool(putts.holed[best]),
        distance=float(putts.distance[best]),
        strokes=strokes,
        num_simulated=num_simulated,
    )


def _grid_search(task: Task, starts: FloatArray, budget: SearchBudget) -> _SimulatedPutts:
    """Simulate a grid of putts from each of the positions (S, 3), m, then refine it until a putt holes out."""
    step = np.array([2.0 * np.pi / budget.directions, 1.0 / budget.speeds])
    grid = _grid(np.arange(budget.directions) * step[0], np.arange(1, budget.speeds + 1) * step[1])
    start = np.repeat(np.arange(len(starts)), len(grid))
    putts = _simulate(task, starts, start, np.tile(grid, (len(starts), 1)))
    for _ in range(budget.refinements):
        if putts.holed.any():
            break
        # Simulate a finer grid around the putts that ended closest to the cup.
        step = step / 3.0
        closest = np.argsort(putts.distance, kind="stable")[:NUM_PUTTS_TO_REFINE]
        neighbors = _neighbors(putts.polar[closest], step)
        refined = _simulate(task, starts, np.repeat(putts.start[closest], len(NEIGHBOR_OFFSETS)), neighbors)
        putts = _SimulatedPutts(*(np.concatenate(pair) for pair in zip(putts, refined, strict=True)))
    return putts


def _simulate(task: Task, starts: FloatArray, start: IntArray, polar: FloatArray) -> _SimulatedPutts:
    """Simulate putts (N, 2), rounded to float32 as actions are, from the rows ``start`` (N,) of positions (S, 3)."""
    outcome = task.play(starts[start], _actions(polar).astype(np.float64)).outcome
    distance = np.where(outcome.holed, 0.0, task.distance_to_cup(outcome.position))
    return _SimulatedPutts(start, polar, outcome.position, outcome.holed, distance)


def _two_putt_search(task: Task, putts: _SimulatedPutts, budget: SearchBudget) -> tuple[int, float, int]:
    """Find the first putt after which most second putts of a grid hole out.

    If no second putt holes out, find the first putt after which one ends closest to the cup.

    Returns:
        The row of the first putt, the number of strokes, and the number of putts simulated.
    """
    # Choose first putts whose resting places are close to the cup and apart from each other.
    order = np.argsort(putts.distance, kind="stable")
    first_rows = _spread_out(putts.end, order, MAX_SECOND_PUTT_STARTS, MIN_START_SPACING)
    # Search for second putts from their resting places.
    second_putts = _grid_search(task, putts.end[first_rows], budget)
    num_holed = np.bincount(second_putts.start[second_putts.holed], minlength=len(first_rows))
    closest = int(np.argmin(second_putts.distance))
    best = int(np.argmax(num_holed)) if num_holed.any() else int(second_putts.start[closest])
    strokes = 2.0 + float(_strokes_left(task, second_putts.end[closest], second_putts.holed[closest]))
    return int(first_rows[best]), strokes, len(second_putts.holed)


def _plan_under_noise(task: Task, start: FloatArray, putts: _SimulatedPutts, num_simulated: int) -> Plan:
    """Return the plan with the fewest expected strokes under the task's noise."""
    # Choose candidates that end close to the cup and differ from each other.
    vectors = _actions(putts.polar).astype(np.float64)
    order = np.argsort(putts.distance, kind="stable")
    polar = putts.polar[_spread_out(vectors, order, MAX_NOISE_CANDIDATES, MIN_CANDIDATE_SPACING)]
    # Compare fewer candidates by more samples in each stage, and add neighbors of the candidates that are kept.
    step = np.array([math.radians(task.putt_noise[0]), task.putt_noise[1]])
    for num_samples, num_kept in NOISE_STAGES:
        expected = _expected_strokes(task, start, polar, NOISE_SAMPLES[:num_samples])
        num_simulated += expected.size * num_samples
        kept = np.argsort(expected, kind="stable")[:num_kept]
        polar = polar[kept]
        strokes = float(expected[kept[0]])
        if num_kept > 1:
            polar = np.concatenate([polar, _neighbors(polar, step)])
            step = step / 2.0
    best = _simulate(task, start, np.zeros(1, np.int64), polar)
    return _plan(best, 0, strokes, num_simulated)


def _expected_strokes(task: Task, start: FloatArray, polar: FloatArray, samples: FloatArray) -> FloatArray:
    """Return the expected strokes (N,) of putts (N, 2), each disturbed by the same noise samples (K, 2)."""
    actions = np.repeat(_actions(polar).astype(np.float64), len(samples), axis=0)
    noise = np.tile(samples, (len(polar), 1))
    outcome = task.play(np.repeat(start, len(actions), axis=0), actions, noise=noise).outcome
    strokes_left = _strokes_left(task, outcome.position, outcome.holed)
    return np.asarray(1.0 + strokes_left.reshape(len(polar), -1).mean(axis=1))


def _strokes_left(task: Task, positions: FloatArray, holed: NDArray[np.bool_]) -> FloatArray:
    """Return the strokes left (...) from positions (..., 3), as reward shaping estimates them; 0 if holed (...)."""
    return np.where(holed, 0.0, -shaping_potential(task, positions))


def _grid(directions: FloatArray, speeds: FloatArray) -> FloatArray:
    """Return all pairs (N, 2) of direction and speed."""
    return np.stack(np.meshgrid(directions, speeds, indexing="ij"), axis=-1).reshape(-1, 2)


NEIGHBOR_OFFSETS = np.delete(_grid(np.array([-1.0, 0.0, 1.0]), np.array([-1.0, 0.0, 1.0])), 4, axis=0)
"""Offsets of the eight neighbors of a putt in a grid, in steps."""


def _neighbors(polar: FloatArray, step: FloatArray) -> FloatArray:
    """Return the neighbors (8 N, 2) of putts (N, 2) in a grid with steps (2,)."""
    neighbors = (polar[:, None] + NEIGHBOR_OFFSETS * step).reshape(-1, 2)
    neighbors[:, 1] = np.clip(neighbors[:, 1], 0.0, 1.0)
    return neighbors


def _spread_out(points: FloatArray, order: IntArray, max_count: int, min_distance: float) -> IntArray:
    """Return the first rows of ``order`` whose points (N, D) are at least a distance apart from those before."""
    chosen: list[int] = []
    while len(order) and len(chosen) < max_count:
        chosen.append(int(order[0]))
        order = order[np.linalg.norm(points[order] - points[order[0]], axis=1) >= min_distance]
    return np.array(chosen)


def _actions(polar: FloatArray) -> NDArray[np.float32]:
    """Return the actions (..., 2) of putts with directions (radians) and speeds (fraction of the top speed)."""
    putts = polar[..., 1:] * np.stack([np.cos(polar[..., 0]), np.sin(polar[..., 0])], axis=-1)
    return np.asarray(putts, dtype=np.float32)


def _noise_samples(n: int) -> FloatArray:
    """Return n evenly spread pairs (n, 2) of standard normal numbers: M. Roberts' R2 sequence and Box-Muller."""
    plastic = 1.32471795724474602596
    u, v = ((0.5 + np.arange(1, n + 1)[:, None] / [plastic, plastic**2]) % 1.0).T
    return np.asarray(np.sqrt(-2.0 * np.log1p(-u)) * [np.cos(2.0 * np.pi * v), np.sin(2.0 * np.pi * v)]).T


NOISE_SAMPLES = _noise_samples(64)
"""Noise samples that disturb every putt that is planned under noise, shape (64, 2)."""
