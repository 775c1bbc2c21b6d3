"""Search: the putt that a perfect player would choose, by trying many from where the ball lies.

Without noise it looks for a hole-in-one, and where it finds none for two putts that hole out. With noise it looks for
the putt with the best expected score.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv, Task
from minigolf_env.envs.config import check_noise
from minigolf_env.envs.task import MIN_STROKES_TO_FINISH, STROKES_PER_METRE, FloatArray

IntArray = NDArray[np.int64]


class Effort(NamedTuple):
    """How closely to look."""

    directions: int
    """Of the first putts, at least 1."""
    speeds: int
    """Shares of the top speed that they have, at least 1."""
    rounds: int
    """Refinements, at least 0; each looks three times closer than the one before."""


QUICK, THOROUGH = Effort(48, 8, 1), Effort(120, 32, 4)
"""A hole-in-one is found by the quick one in most places; the thorough one ends at 0.04 degrees and 0.04 % of speed."""

BEST = 40
"""Putts that a refinement starts from."""

PLACES, PLACES_APART = 16, 0.25
"""Resting places of the first putt that a second one is looked for from, and how far apart they are at least, m."""

CANDIDATES, PUTTS_APART = 96, 0.02
"""Putts whose expected score is compared at first, and how far apart they are at least, shares of the top speed."""

STAGES = ((16, 6), (32, 3), (64, 1))
"""With so many draws of noise, so many putts are chosen; around each the next stage looks closer."""


class Plan(NamedTuple):
    """What search found."""

    action: NDArray[np.float32]
    """(2,) the putt to play."""
    holed: bool
    """Whether it holes out, without noise."""
    distance: float
    """How far from the cup, along the course, it leaves the ball without noise, m; 0 when holed."""
    strokes: float
    """Strokes to hole out, this one included: 1 and 2 were found, other numbers are expected, with a guess in them."""
    tried: int
    """Putts simulated."""


def search(
    env: gym.Env[Any, Any],
    efforts: Sequence[Effort] = (QUICK, THOROUGH),
    *,
    look_ahead: bool = True,
    noise: tuple[float, float] | None = None,
) -> Plan:
    """Return the best putt found from the environment's present state, which stays as it is; deterministic.

    A grid over direction and speed, then ever finer grids around the putts that ended closest to the cup. Where one
    holes out and there is noise, putts are compared by their expected score under it. Where none does, second putts are
    tried from resting places of the first, without noise.

    Args:
        env: a MiniGolfEnv, wrapped or not: where the ball lies.
        efforts: tried one after the other until one finds a hole-in-one.
        look_ahead: whether to look for a second putt where there is no hole-in-one; otherwise the plan is the putt that
            comes closest along the course.
        noise: standard deviations of direction (degrees) and speed (share of it) to plan for; None: the environment's
            ``putt_noise``. The same fixed draws disturb every putt, never the environment's.

    Raises:
        ValueError: an effort without directions or speeds, or with rounds below 0; no efforts; a negative noise.
        ResetNeeded: the environment was not reset.
    """
    for effort in efforts:
        if effort.directions < 1 or effort.speeds < 1 or effort.rounds < 0:
            raise ValueError(f"efforts: expected directions and speeds >= 1 and rounds >= 0, received {effort}.")
    if not efforts:
        raise ValueError("efforts: expected at least one, received none.")
    golf = cast(MiniGolfEnv, env.unwrapped)
    task = golf.task if noise is None else replace(golf.task, putt_noise=check_noise(noise))
    start = np.array(golf.get_state()["position"])[None]
    tried = 0
    for effort in efforts:
        putts = _try(task, start, effort)
        tried += len(putts.left)
        if (putts.left <= 0.0).any():
            break
    else:
        if look_ahead:
            best, strokes, more = _look_ahead(task, putts, efforts[0])
            return _plan(putts, best, strokes, tried + more)
    if any(task.putt_noise):
        return _steady(task, start, putts, tried)
    best = int(np.argmin(putts.left))
    return _plan(putts, best, float(_strokes_left(putts.left)[best]) + 1.0, tried)


class _Putts(NamedTuple):
    """Putts that were tried."""

    start: IntArray
    """(N,) the row of the place they start from."""
    polar: FloatArray
    """(N, 2) direction, radians, and share of the top speed."""
    rest: FloatArray
    """(N, 3) where they leave the ball, m."""
    left: FloatArray
    """(N,) how far that is from the cup along the course, m; 0 when holed."""


def _plan(putts: _Putts, best: int, strokes: float, tried: int) -> Plan:
    left = float(putts.left[best])
    return Plan(_actions(putts.polar[best]), left <= 0.0, left, strokes, tried)


def _try(task: Task, places: FloatArray, effort: Effort) -> _Putts:
    """Try putts from places (S, 3), m: a grid from each, then finer ones around the closest, until one holes out."""
    step = np.array([2.0 * np.pi / effort.directions, 1.0 / effort.speeds])
    grid = _grid(np.arange(effort.directions) * step[0], np.arange(1, effort.speeds + 1) * step[1])
    putts = _play(task, places, np.repeat(np.arange(len(places)), len(grid)), np.tile(grid, (len(places), 1)))
    for _ in range(effort.rounds):
        if (putts.left <= 0.0).any():
            break
        step = step / 3.0
        closest = np.argsort(putts.left, kind="stable")[:BEST]
        finer = _around(putts.polar[closest], step)
        more = _play(task, places, np.repeat(putts.start[closest], len(AROUND)), finer)
        putts = _Putts(*(np.concatenate(pair) for pair in zip(putts, more, strict=True)))
    return putts


def _play(task: Task, places: FloatArray, start: IntArray, polar: FloatArray) -> _Putts:
    """Play putts (N, 2), rounded to float32 as actions are, from the rows ``start`` (N,) of places (S, 3)."""
    outcome = task.simulate(places[start], task.launch_velocity(_actions(polar).astype(np.float64)))
    left = np.where(outcome.holed, 0.0, task.distance_to_cup(outcome.position))
    return _Putts(start, polar, outcome.position, left)


def _look_ahead(task: Task, putts: _Putts, effort: Effort) -> tuple[int, float, int]:
    """Return which putt to play so that the next one holes out, or comes closest; the strokes; the putts simulated.

    Of several places that can be holed out from, it is the one where most putts of a grid do.
    """
    firsts = _apart(putts.rest, np.argsort(putts.left, kind="stable"), PLACES, PLACES_APART)
    seconds = _try(task, putts.rest[firsts], effort)
    holes = np.bincount(seconds.start[seconds.left <= 0.0], minlength=len(firsts))
    closest = int(np.argmin(seconds.left))
    best = int(np.argmax(holes)) if holes.any() else int(seconds.start[closest])
    strokes = 2.0 + float(_strokes_left(seconds.left)[closest])
    return int(firsts[best]), strokes, len(seconds.left)


def _steady(task: Task, start: FloatArray, putts: _Putts, tried: int) -> Plan:
    """Return the plan with the best expected score under the task's noise."""
    chosen = _apart(
        _actions(putts.polar).astype(np.float64), np.argsort(putts.left, kind="stable"), CANDIDATES, PUTTS_APART
    )
    polar, step = putts.polar[chosen], np.array([math.radians(task.putt_noise[0]), task.putt_noise[1]])
    for draws, keep in STAGES:
        expected = _expected(task, start, polar, DRAWS[:draws])
        tried += expected.size * draws
        order = np.argsort(expected, kind="stable")[:keep]
        polar, strokes = polar[order], float(expected[order[0]])
        if keep > 1:
            polar = np.concatenate([polar, _around(polar, step)])
            step = step / 2.0
    best = _play(task, start, np.zeros(1, np.int64), polar)
    return _plan(best, 0, strokes, tried)


def _expected(task: Task, start: FloatArray, polar: FloatArray, draws: FloatArray) -> FloatArray:
    """Return the expected scores (N,) of putts (N, 2), each disturbed by the same draws (K, 2)."""
    actions = np.repeat(_actions(polar).astype(np.float64), len(draws), axis=0)
    velocities = task.launch_velocity(actions, np.tile(draws, (len(polar), 1)))
    outcome = task.simulate(np.repeat(start, len(actions), axis=0), velocities)
    left = np.where(outcome.holed, 0.0, task.distance_to_cup(outcome.position))
    return np.asarray(1.0 + _strokes_left(left).reshape(len(polar), -1).mean(axis=1))


def _strokes_left(left: FloatArray) -> FloatArray:
    """Return the strokes that it takes from distances along the course, m, as shaping guesses them; none from 0."""
    return np.where(left <= 0.0, 0.0, MIN_STROKES_TO_FINISH + STROKES_PER_METRE * left)


def _grid(directions: FloatArray, speeds: FloatArray) -> FloatArray:
    """Return all pairs (N, 2) of direction and speed."""
    return np.stack(np.meshgrid(directions, speeds, indexing="ij"), axis=-1).reshape(-1, 2)


AROUND = np.delete(_grid(np.array([-1.0, 0.0, 1.0]), np.array([-1.0, 0.0, 1.0])), 4, axis=0)
"""The neighbours of a putt, in steps; without the middle, which is known."""


def _around(polar: FloatArray, step: FloatArray) -> FloatArray:
    """Return the neighbours (8 N, 2) of putts (N, 2) on a grid of such steps (2,)."""
    finer = (polar[:, None] + AROUND * step).reshape(-1, 2)
    finer[:, 1] = np.clip(finer[:, 1], 0.0, 1.0)
    return finer


def _apart(points: FloatArray, order: IntArray, count: int, gap: float) -> IntArray:
    """Return the first ``count`` rows of ``order`` whose points (N, D) are at least ``gap`` from those before."""
    chosen: list[int] = []
    while len(order) and len(chosen) < count:
        chosen.append(int(order[0]))
        order = order[np.linalg.norm(points[order] - points[order[0]], axis=1) >= gap]
    return np.array(chosen)


def _actions(polar: FloatArray) -> NDArray[np.float32]:
    """Return putt vectors (..., 2) of directions (radians) and speeds (share of the top speed)."""
    putts = polar[..., 1:] * np.stack([np.cos(polar[..., 0]), np.sin(polar[..., 0])], axis=-1)
    return np.asarray(putts, dtype=np.float32)


def _draws(n: int) -> FloatArray:
    """Return n pairs (n, 2) of standard normal numbers, spread evenly: M. Roberts' R2 sequence and Box-Muller."""
    plastic = 1.32471795724474602596
    u, v = ((0.5 + np.arange(1, n + 1)[:, None] / [plastic, plastic**2]) % 1.0).T
    return np.asarray(np.sqrt(-2.0 * np.log1p(-u)) * [np.cos(2.0 * np.pi * v), np.sin(2.0 * np.pi * v)]).T


DRAWS = _draws(64)
"""What disturbs every putt that is planned with noise."""
