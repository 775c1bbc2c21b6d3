"""Which hole an episode is played on: always the same one, the next of a round, or a level drawn from a set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from minigolf_env._validation import integer
from minigolf_env.courses import NINE, ROUND, Course
from minigolf_env.envs.task import Task

ALL = 2**31
"""Levels there are: numbers from 0 that fit anywhere."""


class OneHole:
    """Every episode is played on one hole.

    Args:
        task: the hole with its rules.
    """

    has_levels = False
    key = "level"

    def __init__(self, task: Task) -> None:
        self._task = task

    def first(self) -> Task:
        """Return the hole."""
        return self._task

    def draw(self, rng: np.random.Generator, last: Task | None) -> Task:
        """Return the hole; draws nothing."""
        return self._task

    def level(self, number: Any) -> Task:
        """Raise a ValueError: there are no levels."""
        name = self._task.course.name
        raise ValueError(f"level: expected none on the course {name!r}, received {number!r}; 'procedural' has.")


@dataclass(frozen=True)
class Round:
    """Holes played in turn: each episode on the next one, after the last on the first again."""

    make: Callable[[int], Task]
    """From a hole's number, 1 to ``number``, to the hole."""
    number: int

    has_levels = True
    key = "hole"

    def first(self) -> Task:
        """Return the first hole."""
        return self.make(1)

    def draw(self, rng: np.random.Generator, last: Task | None) -> Task:
        """Return the hole after ``last``, the first if there was none; draws nothing."""
        return self.make(1 if last is None or last.level is None else last.level % self.number + 1)

    def level(self, number: Any) -> Task:
        """Return a hole by its number.

        Raises:
            ValueError: there is no such hole.
        """
        return self.make(integer(number, self.key, 1, self.number))


@dataclass(frozen=True)
class Levels:
    """Each episode is played on a level drawn uniformly from a set: ``number`` of them from ``start`` on.

    Raises:
        ValueError: the set is not among the levels 0, ..., ALL - 1.
    """

    make: Callable[[int], Task]
    """From a level's number to its hole."""
    start: int
    number: int
    """0: all levels there are, wherever ``start`` is."""

    has_levels = True
    key = "level"

    def __post_init__(self) -> None:
        integer(self.start, "start_level", 0, ALL - 1)
        integer(self.number, "num_levels", 0, ALL - 1)
        if self.start + self.number > ALL:
            raise ValueError(
                f"num_levels: expected at most {ALL - self.start} from level {self.start} on, received {self.number}; "
                f"the levels end at {ALL - 1}."
            )

    def first(self) -> Task:
        """Return the first level."""
        return self.make(self.start)

    def draw(self, rng: np.random.Generator, last: Task | None) -> Task:
        """Return a level of the set, drawn from ``rng``."""
        first, number = (self.start, self.number) if self.number else (0, ALL)
        return self.make(first + int(rng.integers(number)))

    def level(self, number: Any) -> Task:
        """Return a level by its number, within the set or not.

        Raises:
            ValueError: there is no such level.
        """
        return self.make(integer(number, "level", 0, ALL - 1))


def in_turn(course: str | Course, episode: int) -> dict[str, int]:
    """Return options for the reset of an episode, counted from 0, that play the holes of a round in turn.

    For those who seed every episode, which would begin the round anew each time. Empty on other courses.
    """
    return {Round.key: 1 + episode % len(NINE)} if course == ROUND else {}


Tasks = OneHole | Round | Levels
"""What an environment draws its holes from. Each has a ``key``: what the number of a hole is called in info, states and
reset's options; and ``has_levels``: whether holes have numbers."""
