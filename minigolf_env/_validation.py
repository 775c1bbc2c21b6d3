"""Argument validation for the public API: each argument is converted once, or a ValueError names what is wrong.

Messages say which argument, what was expected, what was received, and what to do.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

MAX_NUMBER = 1e50
"""Largest number accepted anywhere: the product of six, more than the physics multiplies, is at most 1e300 and does not
overflow float64 (1.8e308)."""

NUMERIC_KINDS = "biufO"
"""Kinds of numpy types that are accepted. numpy would also convert texts and dates, and drop imaginary parts."""


def finite_array(
    value: ArrayLike, shape: tuple[int | None, ...], what: str, hint: str, max_number: float = MAX_NUMBER
) -> FloatArray:
    """Convert an argument to a new float64 array of finite numbers.

    Args:
        value: the argument.
        shape: expected shape; None stands for any length.
        what: name of the argument in error messages.
        hint: remedy, the end of error messages.
        max_number: largest magnitude accepted.

    Raises:
        ValueError: no real numbers, another shape, or a magnitude above ``max_number``.
    """
    try:
        given = np.asarray(value)
        if given.dtype.kind not in NUMERIC_KINDS:
            raise TypeError(f"{given.dtype} is no type of real numbers")
        array = given.astype(np.float64)
    except (OverflowError, TypeError, ValueError) as error:
        raise ValueError(
            f"{what}: expected numbers of shape {_shape_text(shape)}, received {value!r:.80}; {hint}"
        ) from error
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{what}: expected shape {_shape_text(shape)}, received {array.shape}; {hint}")
    is_valid = np.abs(array) <= max_number
    if not is_valid.all():
        index = tuple(int(i) for i in np.argwhere(~is_valid)[0])
        raise ValueError(
            f"{what}: expected finite numbers up to {max_number:g}, received {array[index]} at index {index}; {hint}"
        )
    return array


def _shape_text(shape: tuple[int | None, ...]) -> str:
    """Return a shape as text, such as "(N, 3)"."""
    return "(" + ", ".join("N" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"


def positive_number(value: float, what: str, hint: str) -> float:
    """Return a finite float > 0, or raise a ValueError."""
    number = float(finite_array(value, (), what, hint))
    if not number > 0.0:
        raise ValueError(f"{what}: expected a number > 0, received {value!r}; {hint}")
    return number


def integer(value: Any, what: str, minimum: int, maximum: int | None = None, hint: str = "") -> int:
    """Return an int in the range minimum to maximum, from a Python or numpy integer, or raise a ValueError."""
    is_integer = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not is_integer or value < minimum or (maximum is not None and value > maximum):
        expected = f">= {minimum}" if maximum is None else f"from {minimum} to {maximum}"
        hint = f"; {hint}" if hint else "."
        raise ValueError(f"{what}: expected an integer {expected}, received {value!r:.80}{hint}")
    return int(value)


def one_of(value: Any, choices: Sequence[str], what: str) -> str:
    """Return a name that is among the choices, or raise a ValueError that lists them and suggests the closest."""
    if isinstance(value, str) and value in choices:
        return value
    raise ValueError(unknown_choice_message(value, choices, what))


def unknown_choice_message(value: Any, choices: Sequence[str], what: str) -> str:
    """Return the error message for an unknown name, with the closest choice as a suggestion."""
    closest = difflib.get_close_matches(str(value), choices, n=1)
    hint = f"; did you mean {closest[0]!r}?" if closest else "."
    return f"{what}: expected one of {', '.join(map(repr, choices))}, received {str(value)!r}{hint}"
