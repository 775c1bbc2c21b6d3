"""Random numbers that are the same on every machine and with every version of numpy, and directions without libm.

numpy promises the raw bits of PCG64 and of SeedSequence for good, and what Generator makes of them for one version.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Choice = TypeVar("Choice")

GRID = 2.0**-10
"""Drawn lengths are multiples of this, m."""

TURN = 24
"""Directions in a full turn: 15 degrees each."""

FINE = 2.0**30
"""Cosines are rounded to multiples of 1 / FINE: the last bits of libm, which differ between systems, cannot show."""


def circle(sides: int) -> list[tuple[float, float]]:
    """Return the corners (cosine, sine) of the regular polygon in the unit circle, counter-clockwise from (1, 0)."""
    turns = [2.0 * math.pi * k / sides for k in range(sides)]
    return [(round(math.cos(turn) * FINE) / FINE, round(math.sin(turn) * FINE) / FINE) for turn in turns]


DIRECTIONS = circle(TURN)


def direction(heading: int) -> tuple[float, float]:
    """Return the unit vector of a heading, counted in steps of 15 degrees counter-clockwise from x."""
    return DIRECTIONS[heading % TURN]


class Draws:
    """A stream of random choices.

    Args:
        key: whole numbers >= 0 that name the stream.
    """

    def __init__(self, *key: int) -> None:
        self._bits = np.random.PCG64(np.random.SeedSequence(key))

    def integer(self, low: int, high: int) -> int:
        """Return one of low, ..., high."""
        return low + int(self._bits.random_raw()) % (high - low + 1)

    def between(self, low: float, high: float) -> float:
        """Return a length from low to high, m, on the grid."""
        share = (int(self._bits.random_raw()) >> 11) * 2.0**-53
        return round((low + (high - low) * share) / GRID) * GRID

    def one_of(self, choices: Sequence[Choice]) -> Choice:
        """Return one of the choices."""
        return choices[self.integer(0, len(choices) - 1)]

    def sign(self) -> int:
        """Return -1 or 1."""
        return self.one_of((-1, 1))
