"""Endless levels: a hole for every number, the same on every machine.

A level is named ``procedural-v1-easy-17``: the generator's version, the difficulty, the number.
"""

from __future__ import annotations

import functools
import re

from minigolf_env._validation import one_of
from minigolf_env.courses.course import Course, CourseError, Cup
from minigolf_env.courses.procedural.build import build_level
from minigolf_env.courses.procedural.layout import DIFFICULTIES, GENERATOR

__all__ = ["DIFFICULTIES", "GENERATOR", "LEVELS_KEPT", "PROCEDURAL", "is_level_name", "level_name", "load_level"]

PROCEDURAL = "procedural"
"""The course whose levels are drawn."""

LEVELS_KEPT = 1024
"""Levels, and worlds of them, that a process keeps: a usual training set of 500, and as many to check on. Each takes up
about half a MB."""

NAME = re.compile(r"procedural-v(\d{1,9})-([^-]*)-(\d{1,18})", re.ASCII)


def level_name(difficulty: str, level: int) -> str:
    """Return the name that ``load_course`` knows a level by."""
    return f"{PROCEDURAL}-v{GENERATOR}-{difficulty}-{level}"


def is_level_name(name: object) -> bool:
    """Return whether a name is meant to be that of a level."""
    return isinstance(name, str) and name.startswith(f"{PROCEDURAL}-")


def load_level(name: str, cup_radius: float | None = None) -> Course:
    """Return a level by its name; the same request gives the same Course for as long as it is kept.

    Args:
        name: of the level.
        cup_radius: m; None: the rules of golf's.

    Raises:
        CourseError: there is no such level, or a cup that it does not take.
    """
    match = NAME.fullmatch(name)
    if match is None or int(match[1]) != GENERATOR:
        raise CourseError(
            f"course: expected a level named like {level_name(DIFFICULTIES[0], 17)!r}, received {name!r}; "
            f"this version makes levels v{GENERATOR}."
        )
    try:
        difficulty = one_of(match[2], DIFFICULTIES, "difficulty")
    except ValueError as error:
        raise CourseError(str(error)) from error
    return _build(difficulty, int(match[3]), Cup.radius if cup_radius is None else cup_radius)


@functools.lru_cache(maxsize=LEVELS_KEPT)
def _build(difficulty: str, level: int, cup_radius: float) -> Course:
    return build_level(difficulty, level, cup_radius)
