"""The info that reset and step return: of one environment as plain values, of a batch as arrays with masks."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.task import Outcome, Result

NO_STROKE = -1
"""Sentinel for a Result: the ball is on the tee and no stroke was played."""

STATUS_NAMES = np.array([*(result.name.lower() for result in Result), "tee"], dtype=object)
"""Value of info's "status" for each Result; last, at index NO_STROKE, "tee"."""


class LastStrokes(NamedTuple):
    """The last strokes of N environments."""

    result: NDArray[np.int8]
    """(N,) the Result of each stroke, as a number, or NO_STROKE."""
    time: FloatArray
    """(N,) duration of the ball's motion, s."""
    bounces: NDArray[np.int64]
    """(N,) number of impacts."""

    @staticmethod
    def none(n: int) -> LastStrokes:
        """Return the last strokes of n environments in which no stroke was played."""
        return LastStrokes(np.full(n, NO_STROKE, np.int8), np.zeros(n), np.zeros(n, np.int64))

    def record(self, rows: NDArray[np.int64] | slice, outcome: Outcome) -> None:
        """Set the strokes of some environments."""
        self.result[rows] = outcome.result
        self.time[rows] = outcome.time
        self.bounces[rows] = outcome.bounces

    def clear(self, rows: NDArray[np.int64]) -> None:
        """Set some environments to no stroke."""
        self.result[rows] = NO_STROKE
        self.time[rows] = 0.0
        self.bounces[rows] = 0


def single_info(strokes: int, outcome: Outcome | None, course: str, index: dict[str, int]) -> dict[str, Any]:
    """Return the info of one environment.

    Args:
        strokes: strokes of the episode.
        outcome: the last stroke, N = 1; None: none was played.
        course: the course's name.
        index: the number of the level or hole by its key; empty where there is none.
    """
    result = NO_STROKE if outcome is None else int(outcome.result[0])
    return {
        "strokes": strokes,
        "is_success": result == Result.HOLED,
        "status": STATUS_NAMES[result],
        "shot_time": 0.0 if outcome is None else float(outcome.time[0]),
        "bounces": 0 if outcome is None else int(outcome.bounces[0]),
        "course": course,
        **index,
    }


def batch_info(
    strokes: NDArray[np.int64],
    last: LastStrokes,
    courses: NDArray[np.object_],
    index: dict[str, NDArray[np.int64]],
    rows: NDArray[np.int64] | slice,
) -> dict[str, Any]:
    """Return the infos of N environments as new arrays (N,), each with its mask, as Gymnasium's vector environments do.

    Args:
        strokes: strokes of the episodes.
        last: the last strokes.
        courses: the courses' names.
        index: the numbers of the levels or holes by their key; empty where there are none.
        rows: the environments that took part; the values of the others are zero or None, and masked.
    """
    info: dict[str, Any] = {
        "strokes": strokes.copy(),
        "is_success": last.result == Result.HOLED,
        "status": STATUS_NAMES[last.result],
        "shot_time": last.time.copy(),
        "bounces": last.bounces.copy(),
        "course": courses.copy(),
        **index,
    }
    mask = np.zeros(len(strokes), np.bool_)
    mask[rows] = True
    if not mask.all():
        for key, values in info.items():
            info[key] = np.where(mask, values, None if values.dtype == object else values.dtype.type(0))
    return info | {f"_{key}": mask.copy() for key in info}


def final_info(ended: NDArray[np.bool_], observations: NDArray[Any], info: dict[str, Any]) -> dict[str, Any]:
    """Return the entries that Gymnasium's autoreset mode "SameStep" adds to info: the last results of ended episodes.

    Args:
        ended: (N,) the environments whose episode ended.
        observations: (N, ...) the last observations of the episodes.
        info: the infos after the last strokes.
    """
    final_obs = np.full(len(ended), None, dtype=object)
    for i in np.flatnonzero(ended).tolist():
        final_obs[i] = observations[i]
    masked = {key: ended.copy() if key.startswith("_") else value for key, value in info.items()}
    final = {"final_obs": final_obs, "final_info": masked}
    return final | {f"_{key}": ended.copy() for key in final}
