"""What a ball that sees "bounce_rays" can foresee of a putt, and which putt looks best.

A putt's line is followed off the walls that the ray beside it met as light is off mirrors, which is how balls come off
wooden borders. Each leg of the line tells how far it passes the cup, how it climbs, and what roll the putt has left
there. These numbers, its sight, stay the same when a hole is moved or turned.

Lengths are metres. A putt is its direction, radians counter-clockwise from x, and its roll: how far it would go on flat
ground without walls, a measure of its energy. Arrays are of N balls, D directions each, and S rolls in each direction.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses.procedural.build import TOP_SPEED, WOOD
from minigolf_env.courses.procedural.features import ROLLING
from minigolf_env.envs.observations.bounce_rays import (
    FEATURES_PER_SEGMENT,
    MAX_BOUNCE_RAY_LENGTH,
    NUM_BOUNCE_RAYS,
    NUM_SEGMENTS,
)
from minigolf_env.envs.observations.rays import CUP_DISTANCE_SCALE, NUM_CUP_FEATURES, NUM_GROUND_FEATURES
from minigolf_env.envs.task import STATE_FEATURES

Array = NDArray[np.float32]

TOP_ROLL = TOP_SPEED**2 / (2.0 * ROLLING * 9.81)
"""Of a full putt, m."""

SHARE = WOOD.damping**2
"""What a bounce leaves of the roll."""

PARALLEL, LEVEL = 0.97, 0.04
"""Two walls are one if the cosine between their normals is greater and one's end is nearer to the other, m."""

FURTHEST = 12.0
"""How long a leg may be, m: a line that all but misses a wall of the ray beside it does not meet it."""

NUMBERS = 20 + 14 * NUM_SEGMENTS
"""Of a sight."""

MIRROR = np.ones(NUMBERS, np.float32)
"""What a sight is times, where left and right are exchanged: -1 for the numbers that say how far to the left."""
MIRROR[[1, 5, *range(9, 13), *(13 + 11 * leg + k for leg in range(NUM_SEGMENTS) for k in (0, 1, 2, 8))]] = -1.0

ASTRAY = 8.0
"""How far along a leg whose wall is not sure the cup is looked for, m."""

UNITS = np.array([MAX_BOUNCE_RAY_LENGTH, MAX_BOUNCE_RAY_LENGTH, 1.0, 1.0, 1.0, 1.0], np.float32)
"""Of an echo's numbers, m."""

STROKES = STATE_FEATURES.index("strokes left")
DEPTH = len(STATE_FEATURES)
SLOPE = DEPTH + 1
STRAIGHT = DEPTH + NUM_GROUND_FEATURES
HEIGHT = STRAIGHT + 2
ECHOED = STRAIGHT + NUM_CUP_FEATURES


class Leg(NamedTuple):
    """A straight part of putts' lines."""

    start: Array
    """(N, D, 2) from the ball."""
    way: Array
    """(N, D, 2) unit vector."""
    length: Array
    """(N, D) up to a wall."""
    sure: NDArray[np.bool_]
    """(N, D) whether the ray on the line's other side met the same walls up to there."""
    alike: NDArray[np.bool_]
    """(N, D) whether the next ray on its near side did."""
    height: Array
    """(N, D) of its end above the ball."""
    top: Array
    """(N, D) the greatest so far."""


def cup(observations: Array) -> Array:
    """Return where the cup is, (N, 2), from the ball."""
    straight = observations[:, STRAIGHT : STRAIGHT + 2]
    return np.asarray(CUP_DISTANCE_SCALE * np.hypot(straight[:, 0], straight[:, 1])[:, None] * straight)


def lines(echoes: Array, directions: Array) -> list[Leg]:
    """Return the NUM_SEGMENTS legs of lines in directions (N, D), off the walls that bounce rays met.

    The rays have the shape (N, R, NUM_SEGMENTS, FEATURES_PER_SEGMENT).

    A line is followed off the walls of the ray beside it: where it meets the same ones it is exact.
    """
    turns = directions * (echoes.shape[1] / (2.0 * math.pi))
    beside = np.rint(turns).astype(np.int64)
    side = np.where(turns >= beside, 1, -1)
    rows = np.arange(len(echoes))[:, None]
    near, over, back = (echoes[rows, (beside + step) % echoes.shape[1]] for step in (0, side, -side))
    way = np.stack([np.cos(directions), np.sin(directions)], axis=-1)
    start, sure, alike, legs = (
        np.zeros_like(way),
        np.ones(way.shape[:2], np.bool_),
        np.ones(way.shape[:2], np.bool_),
        [],
    )
    for ray, *others in zip(*(np.moveaxis(rays, 2, 0) for rays in (near, over, back)), strict=True):
        end, wall = ray[..., :2], ray[..., 2:4]
        towards = (way * wall).sum(-1)
        meets = towards < -1e-3
        length = ((end - start) * wall).sum(-1) / np.where(meets, towards, np.float32(-1.0))
        meets &= (length >= 0.0) & (length < FURTHEST)
        length = np.where(meets, length, np.hypot(*np.moveaxis(end - start, -1, 0)))
        same = [
            ((other[..., 2:4] * wall).sum(-1) > PARALLEL) & (np.abs(((other[..., :2] - end) * wall).sum(-1)) < LEVEL)
            for other in others
        ]
        sure, alike = sure & meets & same[0], alike & meets & same[1]
        legs.append(Leg(start, way, length, sure, alike, ray[..., 4], ray[..., 5]))
        start = start + length[..., None] * way
        way = way - 2.0 * np.where(meets, towards, np.float32(0.0))[..., None] * wall
    return legs


def foresee(observations: NDArray[Any], directions: NDArray[Any], rolls: NDArray[Any]) -> Array:
    """Return the sights (N, D, S, NUMBERS), of about [-1, 1], of putts.

    Args:
        observations: "bounce_rays", (N, 2320).
        directions: (N, D).
        rolls: (N, D, S).
    """
    seen, directions = np.asarray(observations, dtype=np.float32), np.asarray(directions, dtype=np.float32)
    roll = np.asarray(rolls, dtype=np.float32)
    echoes = seen[:, ECHOED:].reshape(len(seen), NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT) * UNITS
    legs, height = lines(echoes, directions), np.zeros(directions.shape, np.float32)
    first, goal = legs[0].way, cup(seen)[:, None]
    away = np.hypot(goal[..., 0], goal[..., 1])
    short = _rests(legs, roll) - goal[:, :, None]
    lined = _surroundings(seen, first)
    rolled = [np.sqrt(roll / TOP_ROLL), roll / TOP_ROLL, *_scales(roll - away[..., None], 1.0, 6.0, 36.0)]
    for leg in legs:
        miss, until = _passes(leg, goal)
        lined += [*_scales(miss, 0.05, 0.3, 2.0), leg.length / 4.0, until / 4.0]
        lined += [leg.sure, leg.alike, (leg.way * first).sum(-1), _cross(first, leg.way)]
        lined += [*_scales(leg.height - height, 0.1), *_scales(leg.top - height, 0.1)]
        there = roll - until[..., None]
        # Whether it drops, as one number: over the cup, and not too fast.
        slow = np.where(there > 0.0, np.exp(-np.maximum(there, 0.0) / 3.0), 0.0)
        rolled += [*_scales(there, 1.0, 8.0), np.exp(-np.square(miss / 0.04))[..., None] * slow]
        roll = (roll - (leg.length + (leg.height - height) / ROLLING)[..., None]) * SHARE
        height = leg.height
    rolled += _scales(np.hypot(short[..., 0], short[..., 1]), 4.0, 0.5)
    sights = np.empty((*roll.shape, len(lined) + len(rolled)), np.float32)
    for k, numbers in enumerate([*(number[..., None] for number in lined), *rolled]):
        sights[..., k] = numbers
    return sights


def _surroundings(seen: Array, ahead: Array) -> list[NDArray[Any]]:
    """Return numbers (N, D) of what balls (N, 2320) see that is no wall, along unit vectors (N, D, 2) and left."""
    goal = cup(seen)[:, None]

    def same(number: int) -> Array:
        return np.broadcast_to(seen[:, number, None], ahead.shape[:2])

    def turned(way: Array) -> list[Array]:
        return [(ahead * way).sum(-1), _cross(ahead, way)]

    until, left = turned(goal)
    # The tee is in the middle of a level's bounds: what is ahead, where the cup is out of sight, is away from it. And a
    # ball that has taken many strokes lies where putts are not what they seem.
    place = 2.5 * seen[:, None, :2]
    known = [*turned(seen[:, None, SLOPE : SLOPE + 2]), same(DEPTH), same(HEIGHT), *turned(place), same(STROKES)]
    return [*known, np.hypot(until, left) / 4.0, until / 4.0, *_scales(left, 0.05, 0.2, 1.0, 4.0)]


def _passes(leg: Leg, goal: Array) -> tuple[Array, Array]:
    """Return by how much legs miss the cup (N, D), which is positive on the left, and how far along they are there."""
    to_cup = goal - leg.start
    # A wall that is not sure is looked past: the cup may be behind.
    until = np.clip((to_cup * leg.way).sum(-1), 0.0, np.where(leg.sure, leg.length, ASTRAY))
    missed = to_cup - until[..., None] * leg.way
    return np.copysign(np.hypot(missed[..., 0], missed[..., 1]), _cross(leg.way, to_cup)), until


def _rests(legs: list[Leg], roll: Array) -> Array:
    """Return where putts of rolls (N, D, S) come to rest, (N, D, S, 2), from the ball."""
    rest, rolls_on = np.zeros((*roll.shape, 2), np.float32), np.ones(roll.shape, np.bool_)
    for leg in legs:
        length = leg.length[..., None]
        gone = roll if leg is legs[-1] else np.minimum(roll, length)
        rest = np.where(rolls_on[..., None], leg.start[:, :, None] + gone[..., None] * leg.way[:, :, None], rest)
        rolls_on &= roll > length
        roll = (roll - length) * SHARE
    return rest


class Effort(NamedTuple):
    """How closely to look for the best putt."""

    directions: int
    """Of the first putts."""
    rolls: int
    """Of the first putts, in each direction, at least 2."""
    rounds: int
    """Refinements around the BEST putts so far, each four times closer."""


QUICK, THOROUGH = Effort(24, 4, 2), Effort(48, 6, 2)
"""To collect putts to learn from, and to play: 276 and 468 putts are judged."""

BEST = 6

ASIDE, FURTHER = np.array([-1.5, -0.5, 0.0, 0.5, 1.5]), np.array([-1.0, 0.0, 1.0])
"""The directions and rolls of a refinement, in steps."""

ROLLS = (0.5, 0.98 * TOP_ROLL)
"""Least and largest roll of the first putts, m."""

BLOCK = 32
"""Balls looked at together: so few that their numbers stay in the cache."""

SHORTEST = 0.2
"""Least roll of any putt, m."""


class Putts(NamedTuple):
    """A putt for each of N balls."""

    direction: NDArray[np.float64]
    roll: NDArray[np.float64]
    cost: Array
    """What it was judged by."""

    @property
    def actions(self) -> Array:
        """The actions (N, 2) of the environment."""
        return actions(self.direction, self.roll)


def best(
    observations: NDArray[Any],
    cost: Callable[[Array], Array],
    effort: Effort = THOROUGH,
    rng: np.random.Generator | None = None,
) -> Putts:
    """Return the putts of the least cost: of a grid, then of ever finer grids around the best of all so far.

    Args:
        observations: "bounce_rays", (N, 2320), N >= 1.
        cost: of sights (..., NUMBERS), returned as (...).
        effort: how closely to look.
        rng: draws the first putts; None: they are a regular grid, which has the direction of the cup.
    """
    seen = np.asarray(observations, dtype=np.float32)
    few = [_best(seen[i : i + BLOCK], cost, effort, rng) for i in range(0, len(seen), BLOCK)]
    return Putts(*(np.concatenate(arrays) for arrays in zip(*few, strict=True)))


def _best(seen: Array, cost: Callable[[Array], Array], effort: Effort, rng: np.random.Generator | None) -> Putts:
    many, speeds, rounds = effort
    n, low, high = len(seen), math.log(ROLLS[0]), math.log(ROLLS[1])
    steps = np.array([2.0 * math.pi / many, (high - low) / (speeds - 1)])
    goal = cup(seen)
    direction = np.arctan2(goal[:, 1], goal[:, 0])[:, None] + steps[0] * np.arange(many)
    log_roll = np.tile(np.linspace(low, high, speeds), (n, many, 1))
    if rng is not None:
        direction = direction + steps[0] * rng.uniform(-0.5, 0.5, direction.shape)
        log_roll = rng.uniform(low, high, log_roll.shape)
    rows, tried = np.arange(n)[:, None], []
    for finer in range(rounds + 1):
        costs = cost(foresee(seen, direction, np.exp(log_roll)))
        found = np.broadcast_to(direction[..., None], log_roll.shape), log_roll, costs
        tried.append([array.reshape(n, -1) for array in found])
        directions, log_rolls, all_costs = (np.concatenate(arrays, axis=1) for arrays in zip(*tried, strict=True))
        order = np.argsort(all_costs, axis=1, kind="stable")[:, :BEST]
        if finer < rounds:
            steps = steps / 4.0
            direction = (directions[rows, order][..., None] + steps[0] * ASIDE).reshape(n, -1)
            log_roll = np.repeat(log_rolls[rows, order], len(ASIDE), axis=1)[..., None] + steps[1] * FURTHER
            log_roll = np.clip(log_roll, math.log(SHORTEST), high)
    first = rows[:, 0], order[:, 0]
    return Putts(directions[first], np.exp(log_rolls[first]), all_costs[first])


def actions(directions: NDArray[Any], rolls: NDArray[Any]) -> Array:
    """Return actions (..., 2) of putts (...)."""
    share = np.sqrt(np.minimum(rolls / TOP_ROLL, 1.0))
    return np.stack([share * np.cos(directions), share * np.sin(directions)], axis=-1).astype(np.float32)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _scales(lengths: Array, *scales: float) -> list[Array]:
    """Return lengths in several scales, each clipped to [-1, 1]: sharp near 0, and yet seen from afar."""
    return [np.clip(lengths / scale, -1.0, 1.0) for scale in scales]
