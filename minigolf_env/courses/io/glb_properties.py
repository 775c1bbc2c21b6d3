"""Custom properties of the objects of a .glb course: which object has which, and how 3D programs store their values.

Properties of other programs are read over. A name that the table below has, or a misspelling of one, is an error on
every object where it would have no effect.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any

from minigolf_env._validation import quote

PHYSICS_KEYS = ("damping", "restitution", "tangential", "rolling", "stimp")
"""Properties of a part that describe its surface, instead of ``surface``."""

APPEARANCE_KEYS = ("material", "color")
"""Properties of a part that describe its appearance."""

PART_KEYS = (*PHYSICS_KEYS, *APPEARANCE_KEYS, "surface", "floor", "inwards")
"""Properties of a part."""

CUP_KEYS = ("position", "radius", "depth", "surface", "cut")
"""Properties of the cup."""

TEE_KEYS = ("lower", "upper", "height")
"""Properties of an empty tee."""

COURSE_KEYS = ("name", "par", "about", "top_speed", "ball_radius", "gravity", "bounds", "route", "hole_in_one")
"""Properties of the scene."""

OWNERS = {"the object of a part": PART_KEYS, "the cup": CUP_KEYS, "an empty tee": TEE_KEYS, "the scene": COURSE_KEYS}
"""Properties by what has them."""

KNOWN_KEYS = tuple(dict.fromkeys(itertools.chain(*OWNERS.values())))
"""All properties."""

FREE_KEYS = ("name",)
"""Properties of the scene that objects may have for other programs: three.js stores the name of each object again."""

BOOLEAN_KEYS = ("floor", "inwards", "cut")
"""Properties that are true or false."""

ROW_LENGTHS = {"bounds": 3, "route": 2}
"""Length of the rows of properties that 3D programs can only store as one flat array."""

MIN_MISSPELT_LENGTH = 5
"""Length of the shortest known name of which other names are misspellings: too many words are close to shorter ones."""

MAX_MISSPELT_LENGTH = 20
"""Length of the longest misspelling: a hostile file may have very long names."""


def check_properties(owner: str, keys: Iterable[str], allowed: tuple[str, ...] = ()) -> None:
    """Raise a ValueError for a property without effect on its owner that has one elsewhere, or if spelt otherwise.

    Args:
        owner: kind of the owner, such as "the cup".
        keys: names of the owner's properties.
        allowed: names of the properties that have an effect on it.
    """
    for key in keys:
        if key in allowed or key in FREE_KEYS:
            continue
        if key in KNOWN_KEYS:
            others = " or ".join(other for other, its_keys in OWNERS.items() if key in its_keys)
            raise ValueError(f"property {quote(key)} has no effect on {owner}, only on {others}; move or rename it.")
        meant = find_meant_key(key)
        if meant is not None:
            raise ValueError(f"unknown property {quote(key)}; did you mean {quote(meant)}? Rename it.")


def find_meant_key(key: str) -> str | None:
    """Return the known property of which an unknown name is a misspelling; None: it is another program's.

    It differs in case, spaces, hyphens, underscores and one letter at most. That letter is wrong, missing, added or
    swapped with the next one, and is not the first. Known names of fewer than MIN_MISSPELT_LENGTH letters allow none.
    """
    if len(key) > MAX_MISSPELT_LENGTH:
        return None
    plain = "".join(c for c in key.lower() if c not in " -_")
    return next((known for known in KNOWN_KEYS if known[0] == plain[:1] and _is_close(plain, known)), None)


def _is_close(plain: str, known: str) -> bool:
    """Return whether a name without separators differs from a known one in at most one letter."""
    a, b = plain, known.replace("_", "")
    # Compare what follows the first difference.
    start = next((k for k, pair in enumerate(zip(a, b, strict=False)) if pair[0] != pair[1]), min(len(a), len(b)))
    a, b = a[start:], b[start:]
    is_swapped = a[:2] == b[1::-1] and a[2:] == b[2:]
    is_one_letter = is_swapped or a[1:] == b[1:] or a[1:] == b or a == b[1:]
    has_letters = (a[:1] + b[:1]).isalpha() and len(known) >= MIN_MISSPELT_LENGTH
    return a == b or (is_one_letter and has_letters)


def read_property(key: str, value: Any) -> Any:
    """Return the value of a property as course files have it.

    Blender stores a whole number such as 3 as 3.0, a list of points as a flat array, and a boolean also as 0 or 1.

    Raises:
        ValueError: the property is true or false, and the value is neither.
    """
    if key == "par" and isinstance(value, float) and value.is_integer():
        return int(value)
    if key in BOOLEAN_KEYS:
        if isinstance(value, (bool, int, float)) and value in (0, 1):
            return bool(value)
        raise ValueError(f"{key}: expected true or false, or 1 or 0, received {quote(value)}; set one of them.")
    length = ROW_LENGTHS.get(key)
    if length and isinstance(value, list) and value and len(value) % length == 0 and not isinstance(value[0], list):
        return [value[k : k + length] for k in range(0, len(value), length)]
    return value
