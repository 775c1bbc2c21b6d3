"""Messages about faults in course files: the line and key, what was expected, and what was received."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from pydantic import ValidationError

from minigolf_env._validation import quote, shorten, unknown_choice_message

BARE_KEY = re.compile(r"[\w-]+")
"""Keys that messages show unquoted; other keys may hold any characters, also control codes of a terminal."""

MAX_SHOWN_KEY_LENGTH = 60
"""Length of the longest key that a message shows whole."""

MAX_REPORTED_FAULTS = 5
"""Largest number of faults that one error message lists."""

UNION_TAGS = {"point", "arc", "radial", "along", "waves"}
"""Tags that pydantic adds to the location of a fault, and that are not keys of the file."""


def format_faults(error: ValidationError, format_fault: Callable[[Any], str]) -> str:
    """Return a line for each of the first faults that pydantic found, and the number of the others."""
    found = error.errors(include_url=False, include_context=True)
    # Pydantic reports a list with a faulty item twice: keep the item, and drop the list.
    above = {fault["loc"][:depth] for fault in found for depth in range(len(fault["loc"]))}
    faults = [fault for fault in found if fault["loc"] not in above]
    lines = [format_fault(fault) for fault in faults[:MAX_REPORTED_FAULTS]]
    num_hidden = len(faults) - MAX_REPORTED_FAULTS
    return "\n".join(lines) + (f"\nand {num_hidden} more" if num_hidden > 0 else "")


def format_validation_error(fault: Any, text: str) -> str:
    """Return one line about a fault that pydantic found: line and key, what was expected and what was received.

    Args:
        fault: an item of ``ValidationError.errors()``.
        text: text of the TOML file; empty: there is none, and the message names no line.
    """
    path, line = _locate(fault["loc"], text, fault["type"] == "missing")
    message = f"{fault['msg'][:1].lower()}{fault['msg'][1:]}".replace("input should be", "expected")
    message = message.replace("field required", "expected this key, received none; add it")
    if fault["type"] == "union_tag_invalid":
        known = re.findall(r"'(\w+)'", fault["ctx"]["expected_tags"])
        message = unknown_choice_message(fault["input"]["kind"], known, "kind")
    elif fault["type"] not in ("missing", "unknown_key"):
        message += f", received {quote(fault['input'])}"
    return f"{f'line {line}: ' if line else ''}{f'{path}: ' if path else ''}{message}"


def find_line(location: tuple[int | str, ...], text: str) -> int | None:
    """Return the number of the line in a TOML text at which a location's key, or part, is; None if it is not found."""
    is_part = location[:1] == ("parts",) and len(location) == 2
    return _locate((*location, "kind") if is_part else location, text, is_missing=is_part)[1]


def _locate(location: tuple[int | str, ...], text: str, is_missing: bool) -> tuple[str, int | None]:
    """Return a fault's location as a path of keys, and the line that sets the last of these keys that is found."""
    path, keys = _format_path(location)
    keys = keys[:-1] if is_missing and isinstance(location[-1], str) else keys
    lines = [line.lstrip() for line in text.splitlines()]
    found = None
    # Start the search for a part's keys at the header of the part.
    if location[:1] == ("parts",) and len(location) > 1 and isinstance(location[1], int):
        headers = [k for k, line in enumerate(lines) if re.match(r"\[\[\s*parts\s*\]\]", line)]
        if location[1] >= len(headers):
            return path, None
        found = headers[location[1]]
        keys = keys[1:]
    # Search each key from the line of the key before it.
    for key in keys:
        pattern = re.compile(rf"(\[*\s*|.*[\s{{.]){re.escape(key)}\s*[=\].]")
        following = next((k for k in range(found or 0, len(lines)) if pattern.match(lines[k])), None)
        if following is None:
            break
        found = following
    return path, None if found is None else found + 1


def _format_path(location: tuple[int | str, ...]) -> tuple[str, list[str]]:
    """Return a fault's location as a path such as "parts[0].border", and the keys in it."""
    path = ""
    keys = []
    for number, step in enumerate(location):
        if isinstance(step, int):
            path += f"[{step}]"
        elif step in UNION_TAGS or (number == 2 and location[0] == "parts"):  # The kind of a part follows its index.
            continue
        else:
            is_plain = len(step) <= MAX_SHOWN_KEY_LENGTH and BARE_KEY.fullmatch(step)
            name = step if is_plain else shorten(quote(step), MAX_SHOWN_KEY_LENGTH)
            path += f".{name}" if path else name
            keys.append(step)
    return path, keys
