"""Which hole an episode is played on: always the same one, or a level drawn from a set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from minigolf_env.envs.task import Task

ALL = 2**31
"""Levels there are: numbers from 0 that fit anywhere."""


class OneHole:
    """Every episode is played on one hole.

    Args:
        task: the hole with its rules.
    """

    has_levels = False

    def __init__(self, task: Task) -> None:
        self._task = task

    def first(self) -> Task:
        """Return the hole."""
        return self._task

    def draw(self, rng: np.random.Generator) -> Task:
        """Return the hole; draws nothing."""
        return self._task

    def level(self, number: Any) -> Task:
        """Raise a ValueError: there are no levels."""
        name = self._task.course.name
        raise ValueError(f"level: expected none on the course {name!r}, received {number!r}; 'procedural' has.")


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

    def __post_init__(self) -> None:
        _checked(self.start, "start_level")
        _checked(self.number, "num_levels")
        if self.start + self.number > ALL:
            raise ValueError(
                f"num_levels: expected at most {ALL - self.start} from level {self.start} on, received {self.number}; "
                f"the levels end at {ALL - 1}."
            )

    def first(self) -> Task:
        """Return the first level."""
        return self.make(self.start)

    def draw(self, rng: np.random.Generator) -> Task:
        """Return a level of the set, drawn from ``rng``."""
        first, number = (self.start, self.number) if self.number else (0, ALL)
        return self.make(first + int(rng.integers(number)))

    def level(self, number: Any) -> Task:
        """Return a level by its number, within the set or not.

        Raises:
            ValueError: there is no such level.
        """
        return self.make(_checked(number, "level"))


def _checked(value: Any, what: str) -> int:
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and 0 <= value < ALL:
        return int(value)
    raise ValueError(f"{what}: expected an integer from 0 to {ALL - 1}, received {value!r}.")


Tasks = OneHole | Levels
"""What an environment draws its holes from."""
