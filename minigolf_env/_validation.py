"""Argument validation for the public API: each argument is converted once, or a ValueError names what is wrong.

Messages say which argument, what was expected, what was received, and what to do. A value in a message goes through
``quote``, so that messages are short and without control characters whatever a file or a caller holds.
"""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

MAX_NUMBER = 1e50
"""Largest number accepted anywhere: the product of six, more than the physics multiplies, is at most 1e300 and does not
overflow float64 (1.8e308)."""

NUMERIC_KINDS = "biufO"
"""Kinds of numpy types that are accepted. numpy would also convert texts and dates, and drop imaginary parts."""


MAX_QUOTED_LENGTH = 120
"""Largest number of characters of a value that a message shows."""

MAX_REASON_LENGTH = 300
"""Largest number of characters of another library's message that one of ours shows."""

MAX_PLAIN_NAME_LENGTH = 64
"""Length of the longest name that a message shows without quotation marks."""

PLAIN_NAME = re.compile(r"[\w .-]+")
"""Names that messages show without quotation marks; others may hold any characters, also codes of a terminal."""

_BOUNDED_REPR = reprlib.Repr()
_BOUNDED_REPR.maxlevel = 3
_BOUNDED_REPR.maxstring = _BOUNDED_REPR.maxother = _BOUNDED_REPR.maxlong = MAX_QUOTED_LENGTH


def quote(value: Any) -> str:
    """Return a value for an error message: its repr, of which the middle of long ones is left out."""
    try:
        return shorten(_BOUNDED_REPR.repr(value))
    except ValueError:  # Python refuses to print an integer of more than 4300 digits.
        return f"a value of type {type(value).__name__}"


def quote_unless_plain(name: str) -> str:
    """Return a name for an error message, without quotation marks if it is short and plain: letters, digits, " _.-"."""
    return name if len(name) <= MAX_PLAIN_NAME_LENGTH and PLAIN_NAME.fullmatch(name) else quote(name)


def quote_error(error: Exception) -> str:
    """Return another library's message for one of ours, shortened in the middle: its end often names the place."""
    return shorten(str(error), MAX_REASON_LENGTH)


def shorten(text: str, max_length: int = MAX_QUOTED_LENGTH) -> str:
    """Return a text, with dots in place of its middle if it is longer than a message shows."""
    if len(text) <= max_length:
        return text
    num_kept = max_length - len("...")
    return f"{text[: num_kept // 2]}...{text[len(text) - (num_kept + 1) // 2 :]}"


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
        if isinstance(value, (list, tuple)) and _holds_texts(value):
            raise TypeError("a text is no real number")
        given = np.asarray(value)
        if given.dtype.kind not in NUMERIC_KINDS:
            raise TypeError(f"{given.dtype} is no type of real numbers")
        array = given.astype(np.float64)
    except (OverflowError, TypeError, ValueError) as error:
        raise ValueError(
            f"{what}: expected numbers of shape {_shape_text(shape)}, received {quote(value)}; {hint}"
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


def count_axes(value: Any) -> int:
    """Return the number of axes of an array or of nested lists; rows of different lengths are no axis."""
    return np.ndim(value if hasattr(value, "ndim") else np.asarray(value, dtype=object))


def _holds_texts(value: Sequence[Any]) -> bool:
    """Return whether there are texts in a list: numpy would make each as wide as the longest, whatever that takes."""
    types = set(map(type, np.asarray(value, dtype=object).ravel()))
    return any(issubclass(found, (str, bytes)) for found in types)


def _shape_text(shape: tuple[int | None, ...]) -> str:
    """Return a shape as text, such as "(N, 3)"."""
    return "(" + ", ".join("N" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"


def positive_number(value: float, what: str, hint: str) -> float:
    """Return a finite float > 0, or raise a ValueError."""
    number = float(finite_array(value, (), what, hint))
    if not number > 0.0:
        raise ValueError(f"{what}: expected a number > 0, received {quote(value)}; {hint}")
    return number


def integer(value: Any, what: str, minimum: int, maximum: int | None = None, hint: str = "") -> int:
    """Return an int in the range minimum to maximum, from a Python or numpy integer, or raise a ValueError."""
    is_integer = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not is_integer or value < minimum or (maximum is not None and value > maximum):
        expected = f">= {minimum}" if maximum is None else f"from {minimum} to {maximum}"
        hint = f"; {hint}" if hint else "."
        raise ValueError(f"{what}: expected an integer {expected}, received {quote(value)}{hint}")
    return int(value)


def one_of(value: Any, choices: Sequence[str], what: str) -> str:
    """Return a name that is among the choices, or raise a ValueError that lists them and suggests the closest."""
    if isinstance(value, str) and value in choices:
        return value
    raise ValueError(unknown_choice_message(value, choices, what))


def unknown_choice_message(value: Any, choices: Sequence[str], what: str) -> str:
    """Return the error message for an unknown name, with the closest choice as a suggestion."""
    closest = closest_choice(value, choices)
    hint = f"; did you mean {quote(closest)}?" if closest else "."
    return f"{what}: expected one of {', '.join(map(repr, choices))}, received {quote(value)}{hint}"


def closest_choice(value: Any, choices: Iterable[str]) -> str | None:
    """Return the choice that a misspelt name probably means; None: there is none."""
    # difflib takes time and memory in proportion to the name; no choice is as long as this.
    if not isinstance(value, str) or len(value) > MAX_QUOTED_LENGTH:
        return None
    return next(iter(difflib.get_close_matches(value, list(choices), n=1)), None)
