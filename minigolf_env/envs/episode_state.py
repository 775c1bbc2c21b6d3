"""The state of an episode as plain values, the same for an environment alone and for one of a batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from minigolf_env._validation import finite_array, integer
from minigolf_env.envs.config import POSITION_HINT, check_positions
from minigolf_env.envs.samplers import TaskSampler
from minigolf_env.envs.task import FloatArray, Task


class EpisodeState(NamedTuple):
    """Where an episode stands."""

    task: Task
    """The hole it is played on."""
    position: FloatArray
    """(3,) the ball's centre, m."""
    strokes: int
    over: bool
    np_random: dict[str, Any] | None
    """The state of its random numbers; None: they go on as they are."""


def task_index_info(tasks: TaskSampler, task: Task) -> dict[str, int]:
    """Return the number of a level, or of a round's hole, by its key; nothing on a hole without."""
    return {} if task.index is None else {tasks.index_name: task.index}


def encode_state(
    tasks: TaskSampler, task: Task, position: FloatArray, strokes: int, over: bool, rng: np.random.Generator
) -> dict[str, Any]:
    """Return the state of an episode, all that it takes to go on from there: plain values, a copy."""
    return {
        "position": tuple(position.tolist()),
        "strokes": strokes,
        "over": over,
        **task_index_info(tasks, task),
        "np_random": rng.bit_generator.state,
    }


def decode_state(state: Any, tasks: TaskSampler, task: Task) -> EpisodeState:
    """Return the episode of a state, played on ``task`` if the state has no "level" or "hole".

    The ball's position is not checked here but by ``check_episode_positions``.

    Raises:
        ValueError: a value is not what it should be.
    """
    known = {"position", "strokes", "over", "np_random", tasks.index_name}
    if not isinstance(state, dict) or "position" not in state or not known.issuperset(state):
        received = sorted(map(str, state)) if isinstance(state, dict) else f"{state!r:.80}"
        raise ValueError(f"state: expected 'position' and what get_state() returns, received {received}.")
    over = state.get("over", False)
    if not isinstance(over, (bool, np.bool_)):
        raise ValueError(f"over: expected True or False, received {over!r:.80}.")
    task = tasks.get(state[tasks.index_name]) if tasks.index_name in state else task
    position = finite_array(state["position"], (3,), "position", POSITION_HINT)
    most = task.max_strokes if over else task.max_strokes - 1
    hint = "" if over else f"after {task.max_strokes} an episode is over."
    strokes = integer(state.get("strokes", 0), "strokes", 0, most, hint)
    generator: Any = state.get("np_random")
    if "np_random" in state:
        try:
            probe = np.random.PCG64(0)
            probe.state = generator
            if probe.state != generator:
                raise ValueError(f"received {generator!r:.200}")
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise ValueError(f"np_random: expected a state of numpy's PCG64 generator; {error}") from error
    return EpisodeState(task, position, strokes, bool(over), generator)


def check_episode_positions(episodes: Sequence[EpisodeState]) -> None:
    """Raise a ValueError unless the balls of all episodes that are not over lie in free space within the bounds."""
    playing = [i for i, episode in enumerate(episodes) if not episode.over]
    holes = {episodes[i].task.world: episodes[i].task for i in playing}
    try:
        for world, task in holes.items():  # All balls of a world at once take a fraction of the time.
            check_positions(task, np.array([episodes[i].position for i in playing if episodes[i].task.world is world]))
    except ValueError:
        for i in playing:
            with error_context(i):
                check_positions(episodes[i].task, episodes[i].position)
        raise


@contextmanager
def error_context(i: int) -> Iterator[None]:
    """Let a ValueError say which of several states it is about."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"state {i}: {error}") from error
