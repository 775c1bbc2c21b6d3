"""From a level's number to its lane: legs, turns, features, the green."""

from __future__ import annotations

from typing import NamedTuple

from minigolf_env.courses.procedural.features import FEATURES
from minigolf_env.courses.procedural.lane import Lane
from minigolf_env.courses.procedural.portable_rng import Draws

GENERATOR = 1
"""Version of the levels, part of their names: raised whenever any level changes."""

TEE_LENGTH = 0.8
"""From the border behind the tee to the first feature, m."""

CELL = 0.3
"""How far the flat cell around the cup reaches ahead and back, m."""

ASIDE = 0.25
"""Least distance from the cup to a border beside it, m."""


class Shape(NamedTuple):
    """What a difficulty draws a lane from; pairs are the least and the most."""

    legs: tuple[int, int]
    features: tuple[int, int]
    """A leg."""
    widths: tuple[float, float]
    """At the tee, m."""
    steps: tuple[int, int]
    """Of 15 degrees, a turn."""


SHAPES = {
    "easy": Shape(legs=(1, 2), features=(0, 1), widths=(1.0, 1.3), steps=(3, 6)),
    "medium": Shape(legs=(2, 3), features=(1, 2), widths=(0.9, 1.25), steps=(2, 6)),
    "hard": Shape(legs=(3, 5), features=(1, 2), widths=(0.85, 1.2), steps=(2, 7)),
}
"""By difficulty."""

DIFFICULTIES = tuple(SHAPES)

FURTHEST = 9.0
"""Largest coordinate in plan, m."""

ATTEMPTS = 50
"""Lanes drawn until one keeps clear of itself; most first ones do."""


class Layout(NamedTuple):
    """A finished lane."""

    lane: Lane
    cell: int
    """The cross-section before the cup's cell; the next one is after it."""
    cup: tuple[float, float, float]
    """Centre of the rim, m."""
    legs: int


def lay_out(difficulty: str, draws: Draws) -> Layout:
    """Return a lane that keeps clear of itself and within FURTHEST."""
    for _ in range(ATTEMPTS):
        layout = _attempt(difficulty, draws, draws.integer(*SHAPES[difficulty].legs))
        if layout.lane.spread() <= FURTHEST and not layout.lane.overlaps():
            return layout
    return _attempt(difficulty, draws, 1)


def _attempt(difficulty: str, draws: Draws, legs: int) -> Layout:
    shape = SHAPES[difficulty]
    # On average the lane leads away from the tee as it started: turns about as often bring it back as not.
    lane = Lane(width=draws.between(*shape.widths), heading=draws.integer(0, 23))
    lane.go(TEE_LENGTH)
    for leg in range(legs):
        if leg > 0:
            _turn(lane, draws, draws.integer(*shape.steps))
        share = draws.between(0.0, 1.0 / 16.0)
        lane.taper = -share if lane.width > 1.05 else share
        many = draws.integer(*shape.features) + (difficulty == "easy" and legs == 1)
        lane.go(0.25)
        for _ in range(many):
            draws.one_of(FEATURES[difficulty])(lane, draws)
        lane.go(draws.between(0.2, 0.6))
    return _green(lane, draws, legs)


def _turn(lane: Lane, draws: Draws, steps: int) -> None:
    side = draws.sign()
    if draws.integer(0, 2) == 0:
        lane.bend(side * steps, draws.between(0.15, 0.5))
    else:
        lane.turn(side * steps, draws.one_of(("square", "cut", "round")) if steps <= 6 else "round")
    lane.taper = 0.0
    lane.go(0.15)


def _green(lane: Lane, draws: Draws, legs: int) -> Layout:
    """Lay the flat part around the cup, and the end."""
    lane.taper = 0.0
    cell = len(lane.sections) - 1
    aside = lane.width / 2.0 - ASIDE
    left = draws.between(-aside, aside)
    cup = (*lane.at(CELL, left), lane.z)
    lane.go(2.0 * CELL)
    lane.route.append(cup[:2])
    wide = lane.width
    ending = draws.one_of(("square", "cut", "round"))
    if ending == "cut":
        lane.go(0.25, width=wide - 0.4)
    elif ending == "round":
        for k in range(1, 6):
            lane.go(0.08, width=wide * (1.0 - 0.5 * (k / 5.0) ** 2))
    return Layout(lane, cell, cup, legs)
