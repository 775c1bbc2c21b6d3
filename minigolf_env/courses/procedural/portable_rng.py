"""Random numbers and directions that are the same on every machine and with every version of numpy.

numpy guarantees that the raw bits of PCG64 and of SeedSequence never change, but the methods of Generator may change
with its version.
Directions are computed without the last bits of the C library's cosine, which differ between systems.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Choice = TypeVar("Choice")

LENGTH_GRID = 2.0**-10
"""Grid that random lengths are rounded to, m."""

HEADINGS_PER_REVOLUTION = 24
"""Number of headings in 360 degrees: they are 15 degrees apart."""

COSINE_RESOLUTION = 2.0**30
"""Number of grid steps per unit that cosines are rounded to, which removes the bits that differ between systems."""


def unit_circle(sides: int) -> list[tuple[float, float]]:
    """Return the corners (cosine, sine) of the regular polygon in the unit circle, counter-clockwise from (1, 0)."""
    angles = [2.0 * math.pi * k / sides for k in range(sides)]
    return [(_round_cosine(math.cos(angle)), _round_cosine(math.sin(angle))) for angle in angles]


def _round_cosine(value: float) -> float:
    return round(value * COSINE_RESOLUTION) / COSINE_RESOLUTION


HEADING_VECTORS = unit_circle(HEADINGS_PER_REVOLUTION)
"""Unit vector of each heading."""


def heading_vector(heading: int) -> tuple[float, float]:
    """Return the unit vector of a heading, counted in steps of 15 degrees counter-clockwise from x."""
    return HEADING_VECTORS[heading % HEADINGS_PER_REVOLUTION]


class PortableRng:
    """Random number generator whose numbers do not depend on the machine or on numpy's version.

    Args:
        key: integers >= 0 that identify the stream.
    """

    def __init__(self, *key: int) -> None:
        self._bits = np.random.PCG64(np.random.SeedSequence(key))

    def integer(self, low: int, high: int) -> int:
        """Return a random integer from low to high, both included."""
        return low + int(self._bits.random_raw()) % (high - low + 1)

    def uniform(self, low: float, high: float) -> float:
        """Return a random length from low to high, m, rounded to the grid."""
        fraction = (int(self._bits.random_raw()) >> 11) * 2.0**-53
        return round((low + (high - low) * fraction) / LENGTH_GRID) * LENGTH_GRID

    def choice(self, choices: Sequence[Choice]) -> Choice:
        """Return a random element of a sequence."""
        return choices[self.integer(0, len(choices) - 1)]

    def sign(self) -> int:
        """Return -1 or 1 at random."""
        return self.choice((-1, 1))
