"""Procedural levels: a hole for every number, the same on every machine.

A level is named ``procedural-v1-easy-17``: the version of the generator, the difficulty, the number.
"""

from __future__ import annotations

import functools
import re

from minigolf_env._validation import one_of, quote
from minigolf_env.courses.course import Course, CourseError, Cup
from minigolf_env.courses.procedural.layout import DIFFICULTY_NAMES, GENERATOR_VERSION
from minigolf_env.courses.procedural.level import build_level

__all__ = [
    "DIFFICULTY_NAMES",
    "GENERATOR_VERSION",
    "LEVEL_CACHE_SIZE",
    "PROCEDURAL_COURSE",
    "is_level_name",
    "level_name",
    "load_level",
]

PROCEDURAL_COURSE = "procedural"
"""Name of the course whose episodes are random levels."""

LEVEL_CACHE_SIZE = 1024
"""Number of levels, and of their worlds, that a process keeps: a usual training set of 500, and as many held-out
levels. Each takes about half a MB."""

LEVEL_NAME_PATTERN = re.compile(r"procedural-v(\d{1,9})-([^-]*)-(\d{1,18})", re.ASCII)
"""Pattern of level names: the version, the difficulty and the number."""


def level_name(difficulty: str, level: int) -> str:
    """Return the name by which ``load_course`` loads a level."""
    return f"{PROCEDURAL_COURSE}-v{GENERATOR_VERSION}-{difficulty}-{level}"


def is_level_name(name: object) -> bool:
    """Return whether a name has the prefix of level names."""
    return isinstance(name, str) and name.startswith(f"{PROCEDURAL_COURSE}-")


def load_level(name: str, cup_radius: float | None = None) -> Course:
    """Return a level by its name; the same request returns the same object while it is in the cache.

    Args:
        name: name of the level.
        cup_radius: radius of the cup, m; None: that of the rules of golf.

    Raises:
        CourseError: the level does not exist, or the radius does not suit it.
    """
    match = LEVEL_NAME_PATTERN.fullmatch(name)
    if match is None or int(match[1]) != GENERATOR_VERSION:
        raise CourseError(
            f"course: expected a level named like {quote(level_name(DIFFICULTY_NAMES[0], 17))}, received "
            f"{quote(name)}; this version makes levels v{GENERATOR_VERSION}."
        )
    try:
        difficulty = one_of(match[2], DIFFICULTY_NAMES, "difficulty")
    except ValueError as error:
        raise CourseError(str(error)) from error
    return _build_cached(difficulty, int(match[3]), Cup.radius if cup_radius is None else cup_radius)


@functools.lru_cache(maxsize=LEVEL_CACHE_SIZE)
def _build_cached(difficulty: str, level: int, cup_radius: float) -> Course:
    return build_level(difficulty, level, cup_radius)
