"""Checks at the doors: what came in is cast once, or refused with what, expected, received and remedy."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


LARGEST = 1e50
"""Largest number taken anywhere: the product of six, more than the physics multiplies, stays within float64."""

NUMBERS = "biufO"
"""Kinds of numpy's types that are taken: numpy would read texts and dates as numbers, too, and drop imaginary parts."""


def finite_array(
    value: ArrayLike, shape: tuple[int | None, ...], what: str, hint: str, largest: float = LARGEST
) -> FloatArray:
    """Return a new float64 array of the given shape (None: any length), or raise a ValueError that says all."""
    wanted = "(" + ", ".join("N" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
    try:
        given = np.asarray(value)
        if given.dtype.kind not in NUMBERS:
            raise TypeError(f"{given.dtype} is no type of real numbers")
        array = given.astype(np.float64)
    except (OverflowError, TypeError, ValueError) as error:
        raise ValueError(f"{what}: expected numbers of shape {wanted}, received {value!r:.80}; {hint}") from error
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{what}: expected shape {wanted}, received {array.shape}; {hint}")
    sane = np.abs(array) <= largest
    if not sane.all():
        where = tuple(int(i) for i in np.argwhere(~sane)[0])
        raise ValueError(
            f"{what}: expected finite numbers up to {largest:g}, received {array[where]} at index {where}; {hint}"
        )
    return array


def positive_number(value: float, what: str, hint: str) -> float:
    """Return a finite float > 0, or raise a ValueError that says what was received."""
    number = float(finite_array(value, (), what, hint))
    if not number > 0.0:
        raise ValueError(f"{what}: expected a number > 0, received {value!r}; {hint}")
    return number


def integer(value: Any, what: str, least: int, most: int | None = None, hint: str = "") -> int:
    """Return an int, from Python's integers or numpy's, or raise a ValueError that says what was received."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or value < least or (most is not None and value > most):
        wanted = f">= {least}" if most is None else f"from {least} to {most}"
        hint = f"; {hint}" if hint else "."
        raise ValueError(f"{what}: expected an integer {wanted}, received {value!r:.80}{hint}")
    return int(value)


def one_of(value: Any, known: Sequence[str], what: str) -> str:
    """Return a name that is known, or raise a ValueError that lists the names and guesses which was meant."""
    if isinstance(value, str) and value in known:
        return value
    raise ValueError(unknown_choice_message(value, known, what))


def unknown_choice_message(value: Any, known: Sequence[str], what: str) -> str:
    """Return the message about an unknown name, with a guess which was meant."""
    close = difflib.get_close_matches(str(value), known, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else "."
    return f"{what}: expected one of {', '.join(map(repr, known))}, received {str(value)!r}{hint}"
