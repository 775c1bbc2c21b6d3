"""Bands on the ground that help to aim: the arrow, the way foreseen, a hint's ghost. Numpy only."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import NDArray

from minigolf_env.play.aim import Aim
from minigolf_env.rendering import Line
from minigolf_env.rendering.frame import Color

FloatArray = NDArray[np.float64]

SHORTEST, LONGEST = 6.0, 34.0
"""Lengths of the arrow at no and at full power, in its unit."""

GAP, HEAD = 1.6, 4.4
"""Where the arrow begins, from the ball's centre, and the length of its head, in its unit."""

DASH, SPACE = 2.2, 1.8
"""Of a way foreseen, in the unit."""

LARGEST_UNIT = 0.045
"""The unit of bands is the ball's radius, but no more than this: a large ball needs no longer arrow, m."""

MOST_DASHES = 90

SUNK = 0.9
"""Bands lie this much of a radius below the ball's centre."""

GHOST = (0.35, 0.85, 1.0)
"""Colour of a hint."""


def tint(power: float) -> tuple[float, float, float]:
    """Return the colour of a power: green, yellow, red."""
    return colorsys.hsv_to_rgb((1.0 - power) * 0.36, 0.85, 0.95)


def reach(aim: Aim, radius: float) -> float:
    """Return how far from the ball's centre the arrow's head ends, m."""
    return _unit(radius) * (SHORTEST + (LONGEST - SHORTEST) * aim.power)


def arrow(ball: FloatArray, aim: Aim, radius: float) -> tuple[Line, ...]:
    """Return the arrow from the ball (3,) where it is to go, longer and redder with its power."""
    length, unit = reach(aim, radius), _unit(radius)
    foot = ball if aim.elevation else _ground(ball, radius)
    tail, neck, tip = (foot + aim.direction * along for along in (GAP * unit, length - HEAD * unit, length))
    color = tint(aim.power)
    shaft = Line(np.stack([tail, neck]), 1.5 * unit, (*color, 0.25), (*color, 0.95))
    return shaft, Line(np.stack([neck, tip]), 4.4 * unit, (*color, 0.95), (*color, 0.95), taper=0.0)


def dashes(way: FloatArray, radius: float, first: float) -> tuple[Line, ...]:
    """Return a way (K, 3) as dashes from ``first`` metres on, which fade with the distance."""
    points = _ground(way, radius)
    along, unit = _along(points), _unit(radius)
    starts = np.arange(first + SPACE * unit, along[-1], (DASH + SPACE) * unit)[:MOST_DASHES]
    lines = []
    for k, start in enumerate(starts):
        ends = np.array([start, min(start + DASH * unit, along[-1])])
        alpha = 0.9 - 0.65 * k / max(len(starts), 12)
        color: Color = (1.0, 1.0, 1.0, alpha)
        lines.append(Line(_at(points, along, ends), 0.75 * unit, color, color))
    return tuple(lines)


def ghost(way: FloatArray, radius: float) -> tuple[Line, ...]:
    """Return a way (K, 3) as the band of a hint."""
    points = _ground(way, radius)
    along = _along(points)
    even = _at(points, along, np.linspace(0.0, along[-1], 160))
    return (Line(even, 1.3 * _unit(radius), (*GHOST, 0.25), (*GHOST, 0.75)),)


def _unit(radius: float) -> float:
    return min(radius, LARGEST_UNIT)


def _ground(places: FloatArray, radius: float) -> FloatArray:
    return np.asarray(places - np.array([0.0, 0.0, SUNK * radius]))


def _along(points: FloatArray) -> FloatArray:
    """Return how far along the way points (K, 3) are (K,), m."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _at(points: FloatArray, along: FloatArray, distances: FloatArray) -> FloatArray:
    return np.stack([np.interp(distances, along, points[:, k]) for k in range(3)], axis=-1)
