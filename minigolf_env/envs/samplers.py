"""Task samplers, which choose the task of an episode: always the same, the next of a round, or a level of a set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from minigolf_env._validation import integer, quote
from minigolf_env.courses import ROUND_COURSE, ROUND_HOLES, Course
from minigolf_env.envs.task import Task

MAX_NUM_LEVELS = 2**31
"""Number of levels of each difficulty, numbered from 0: a set has at most as many."""


class SingleTask:
    """Every episode plays the same task.

    Args:
        task: the hole with its rules.
    """

    is_indexed = False
    index_name = "level"

    def __init__(self, task: Task) -> None:
        self._task = task

    def default(self) -> Task:
        """Return the task."""
        return self._task

    def sample(self, rng: np.random.Generator, previous: Task | None) -> Task:
        """Return the task; no random number is drawn."""
        return self._task

    def get(self, index: Any) -> Task:
        """Raise a ValueError: the course has no levels."""
        name = self._task.course.name
        raise ValueError(
            f"level: expected none on the course {quote(name)}, received {quote(index)}; only "
            "course='procedural' has levels."
        )


@dataclass(frozen=True)
class SequentialTasks:
    """Each episode plays the next task of a round; the first follows the last."""

    make: Callable[[int], Task]
    """Make the task of a hole's number, from 1 to ``count``."""
    count: int
    """Number of holes."""

    is_indexed = True
    index_name = "hole"

    def default(self) -> Task:
        """Return the first task."""
        return self.make(1)

    def sample(self, rng: np.random.Generator, previous: Task | None) -> Task:
        """Return the task after the previous one, the first if there was none; no random number is drawn."""
        if previous is None or previous.index is None:
            return self.make(1)
        return self.make(previous.index % self.count + 1)

    def get(self, index: Any) -> Task:
        """Return the task of a hole's number.

        Raises:
            ValueError: no hole has this number.
        """
        return self.make(integer(index, self.index_name, 1, self.count))


@dataclass(frozen=True)
class LevelSampler:
    """Each episode plays a level drawn uniformly from a set of consecutive levels.

    Raises:
        ValueError: the set is not among the levels 0, ..., MAX_NUM_LEVELS - 1.
    """

    make: Callable[[int], Task]
    """Make the task of a level's number."""
    start: int
    """First level of the set."""
    count: int
    """Number of levels in the set; 0: all MAX_NUM_LEVELS levels, also those before ``start``."""

    is_indexed = True
    index_name = "level"

    def __post_init__(self) -> None:
        integer(self.start, "start_level", 0, MAX_NUM_LEVELS - 1)
        integer(self.count, "num_levels", 0, MAX_NUM_LEVELS - 1)
        if self.start + self.count > MAX_NUM_LEVELS:
            raise ValueError(
                f"num_levels: expected at most {MAX_NUM_LEVELS - self.start} from level {self.start} on, "
                f"received {self.count}; the levels end at {MAX_NUM_LEVELS - 1}."
            )

    def default(self) -> Task:
        """Return the first level of the set."""
        return self.make(self.start)

    def sample(self, rng: np.random.Generator, previous: Task | None) -> Task:
        """Return a level of the set, drawn from ``rng``."""
        first, count = (self.start, self.count) if self.count else (0, MAX_NUM_LEVELS)
        return self.make(first + int(rng.integers(count)))

    def get(self, index: Any) -> Task:
        """Return a level by its number, also one outside the set.

        Raises:
            ValueError: no level has this number.
        """
        return self.make(integer(index, self.index_name, 0, MAX_NUM_LEVELS - 1))


TaskSampler = SingleTask | SequentialTasks | LevelSampler
"""The source of an environment's tasks.

``index_name`` is the key of a task's number in info, states and reset's options; ``is_indexed`` is true if tasks have
numbers.
"""


def round_reset_options(course: str | Course, episode: int) -> dict[str, int]:
    """Return reset options that play the holes of a round in turn, for an episode counted from 0.

    Use it where every episode has its own seed: a reset with a seed starts the round again. On other courses the
    options are empty.
    """
    return {SequentialTasks.index_name: 1 + episode % len(ROUND_HOLES)} if course == ROUND_COURSE else {}
