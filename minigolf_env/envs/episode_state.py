"""The state of an episode as plain values, the same for a single environment and for one environment of a batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from minigolf_env._validation import finite_array, integer, quote, quote_error
from minigolf_env.envs.config import POSITION_HINT, check_positions
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.samplers import TaskSampler
from minigolf_env.envs.task import Task


class EpisodeState(NamedTuple):
    """The decoded state of an episode."""

    task: Task
    """The task it plays."""
    position: FloatArray
    """(3,) the ball's centre, m."""
    strokes: int
    """Number of strokes played."""
    over: bool
    """True if the episode has ended."""
    np_random: dict[str, Any] | None
    """State of its random number generator; None: the generator stays as it is."""


def task_index_info(sampler: TaskSampler, task: Task) -> dict[str, int]:
    """Return the number of a level or of a hole of a round by its key; an empty dict for a task without a number."""
    return {} if task.index is None else {sampler.index_name: task.index}


def encode_state(
    sampler: TaskSampler, task: Task, position: FloatArray, strokes: int, over: bool, rng: np.random.Generator
) -> dict[str, Any]:
    """Return the state of an episode: a copy in plain values, all that is needed to resume it."""
    return {
        "position": tuple(position.tolist()),
        "strokes": strokes,
        "over": over,
        **task_index_info(sampler, task),
        "np_random": rng.bit_generator.state,
    }


def decode_state(state: Any, sampler: TaskSampler, task: Task) -> EpisodeState:
    """Return the decoded state of an episode, which plays ``task`` if the state has no "level" or "hole".

    ``check_episode_positions`` checks that the ball is in free space.

    Raises:
        ValueError: a key is unknown, or a value is wrong.
    """
    known = {"position", "strokes", "over", "np_random", sampler.index_name}
    if not isinstance(state, dict) or "position" not in state or not known.issuperset(state):
        received = list(state) if isinstance(state, dict) else state
        raise ValueError(f"state: expected 'position' and what get_state() returns, received {quote(received)}.")
    over = state.get("over", False)
    if not isinstance(over, (bool, np.bool_)):
        raise ValueError(f"over: expected True or False, received {quote(over)}.")
    task = sampler.get(state[sampler.index_name]) if sampler.index_name in state else task
    position = finite_array(state["position"], (3,), "position", POSITION_HINT)
    max_strokes = task.max_strokes if over else task.max_strokes - 1
    hint = "" if over else f"after {task.max_strokes} an episode is over."
    strokes = integer(state.get("strokes", 0), "strokes", 0, max_strokes, hint)
    generator: Any = state.get("np_random")
    if "np_random" in state:
        try:
            probe = np.random.PCG64(0)
            probe.state = generator
            if probe.state != generator:
                raise ValueError(f"received {quote(generator)}")
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise ValueError(f"np_random: expected a state of numpy's PCG64 generator; {quote_error(error)}") from error
    return EpisodeState(task, position, strokes, bool(over), generator)


def check_episode_positions(episodes: Sequence[EpisodeState]) -> None:
    """Raise a ValueError unless the balls of all episodes that have not ended are in free space within the bounds."""
    playing = [i for i, episode in enumerate(episodes) if not episode.over]
    tasks = {episodes[i].task.world: episodes[i].task for i in playing}
    try:
        for world, task in tasks.items():  # Checking all balls of a world at once takes a fraction of the time.
            check_positions(task, np.array([episodes[i].position for i in playing if episodes[i].task.world is world]))
    except ValueError:
        # Find the first state with an error, to name it.
        for i in playing:
            with error_context(i):
                check_positions(episodes[i].task, episodes[i].position)
        raise


@contextmanager
def error_context(i: int) -> Iterator[None]:
    """Prefix a ValueError with the number of the state that it is about."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"state {i}: {error}") from error
