"""Which hole an episode is played on: always the same one, the next of a round, or a level drawn from a set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from minigolf_env._validation import integer
from minigolf_env.courses import ROUND_COURSE, ROUND_HOLES, Course
from minigolf_env.envs.task import Task

ALL = 2**31
"""Levels there are: numbers from 0 that fit anywhere."""


class SingleTask:
    """Every episode is played on one hole.

    Args:
        task: the hole with its rules.
    """

    is_indexed = False
    index_name = "level"

    def __init__(self, task: Task) -> None:
        self._task = task

    def default(self) -> Task:
        """Return the hole."""
        return self._task

    def sample(self, rng: np.random.Generator, last: Task | None) -> Task:
        """Return the hole; draws nothing."""
        return self._task

    def get(self, number: Any) -> Task:
        """Raise a ValueError: there are no levels."""
        name = self._task.course.name
        raise ValueError(f"level: expected none on the course {name!r}, received {number!r}; 'procedural' has.")


@dataclass(frozen=True)
class SequentialTasks:
    """Holes played in turn: each episode on the next one, after the last on the first again."""

    make: Callable[[int], Task]
    """From a hole's number, 1 to ``number``, to the hole."""
    number: int

    is_indexed = True
    index_name = "hole"

    def default(self) -> Task:
        """Return the first hole."""
        return self.make(1)

    def sample(self, rng: np.random.Generator, last: Task | None) -> Task:
        """Return the hole after ``last``, the first if there was none; draws nothing."""
        return self.make(1 if last is None or last.index is None else last.index % self.number + 1)

    def get(self, number: Any) -> Task:
        """Return a hole by its number.

        Raises:
            ValueError: there is no such hole.
        """
        return self.make(integer(number, self.index_name, 1, self.number))


@dataclass(frozen=True)
class LevelSampler:
    """Each episode is played on a level drawn uniformly from a set: ``number`` of them from ``start`` on.

    Raises:
        ValueError: the set is not among the levels 0, ..., ALL - 1.
    """

    make: Callable[[int], Task]
    """From a level's number to its hole."""
    start: int
    number: int
    """0: all levels there are, wherever ``start`` is."""

    is_indexed = True
    index_name = "level"

    def __post_init__(self) -> None:
        integer(self.start, "start_level", 0, ALL - 1)
        integer(self.number, "num_levels", 0, ALL - 1)
        if self.start + self.number > ALL:
            raise ValueError(
                f"num_levels: expected at most {ALL - self.start} from level {self.start} on, received {self.number}; "
                f"the levels end at {ALL - 1}."
            )

    def default(self) -> Task:
        """Return the first level."""
        return self.make(self.start)

    def sample(self, rng: np.random.Generator, last: Task | None) -> Task:
        """Return a level of the set, drawn from ``rng``."""
        first, number = (self.start, self.number) if self.number else (0, ALL)
        return self.make(first + int(rng.integers(number)))

    def get(self, number: Any) -> Task:
        """Return a level by its number, within the set or not.

        Raises:
            ValueError: there is no such level.
        """
        return self.make(integer(number, "level", 0, ALL - 1))


def round_reset_options(course: str | Course, episode: int) -> dict[str, int]:
    """Return options for the reset of an episode, counted from 0, that play the holes of a round in turn.

    For those who seed every episode, which would begin the round anew each time. Empty on other courses.
    """
    return {SequentialTasks.index_name: 1 + episode % len(ROUND_HOLES)} if course == ROUND_COURSE else {}


TaskSampler = SingleTask | SequentialTasks | LevelSampler
"""The source of an environment's tasks.

``index_name`` is the key of a task's number in info, states and reset's options; ``is_indexed`` is true if tasks have
numbers.
"""
