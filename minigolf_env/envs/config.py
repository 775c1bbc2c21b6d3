"""Arguments of the environments: they are validated here once, and become an ``EnvConfig``.

The arguments of reset, step and set_state are validated by the functions at the end.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from minigolf_env._validation import closest_choice, count_axes, finite_array, integer, one_of, positive_number, quote
from minigolf_env.courses import ROUND_COURSE, ROUND_HOLES, Course, list_courses, load_course
from minigolf_env.courses.library import ROOM_NAMES
from minigolf_env.courses.procedural import (
    DIFFICULTY_NAMES,
    LEVEL_CACHE_SIZE,
    PROCEDURAL_COURSE,
    is_level_name,
    level_name,
)
from minigolf_env.envs.holes import FloatArray, compile_hole
from minigolf_env.envs.observations import OBSERVATIONS, ObservationType
from minigolf_env.envs.rewards import RewardFunction, build_reward
from minigolf_env.envs.samplers import LevelSampler, SequentialTasks, SingleTask, TaskSampler
from minigolf_env.envs.task import MAX_PUTT_TIME, Task
from minigolf_env.physics import World
from minigolf_env.physics.world import IMPACT_MODELS
from minigolf_env.rendering import CAMERA_NAMES, RENDER_PROFILES, RenderSettings, check_size

VECTOR_HINT = "gymnasium.make_vec makes a vector environment, with num_envs and autoreset_mode."
"""Advice about arguments that only a vector environment has."""

ARGUMENT_HINTS = {
    "num_envs": VECTOR_HINT,
    "n_envs": VECTOR_HINT,
    "autoreset_mode": VECTOR_HINT,
    "max_episode_steps": "max_strokes ends an episode.",
    "seed": "reset(seed=...) seeds the environment.",
    "size": "render_size=(width, height) is the size of the images.",
    "width": "render_size=(width, height) is the size of the images.",
    "height": "render_size=(width, height) is the size of the images.",
    "obs_type": "observation is the kind of observation.",
    "render_fps": "render_speed is the speed of the putts in the window.",
    "level": 'reset(options={"level": 17}) plays a level.',
    "hole": 'course="round" plays nine holes, reset(options={"hole": 3}) one of them.',
}
"""Advice about arguments that environments of other packages have."""

MAX_STROKES = 2**63 - 1
"""Largest value of the argument "max_strokes": int64 counts strokes."""

TEE_CHOICES = ("random", "fixed")
"""Values of the argument "tee": where an episode starts."""

NOISE_HINT = "give the standard deviations of direction (degrees) and speed (fraction of it)."
"""End of error messages about the argument "putt_noise"."""

POSITION_HINT = "give the ball's centre, m."
"""End of error messages about a ball's position."""

ACTION_HINT = "a putt is a vector x, y; its length, up to 1, is the fraction of the top speed."
"""End of error messages about actions."""


UNSEEN_LEVEL_MESSAGE = (
    "course='procedural' with observation='state' hides the level from an agent: it sees the ball and the cup, but no "
    "wall. observation='rays' and 'bounce_rays' show the walls, 'pixels' the course from above."
)
"""Text of the warning about levels that an agent cannot see."""


class UnseenLevelWarning(UserWarning):
    """Warning that an agent cannot see which level it plays; search and random players need not."""


@contextmanager
def ignore_unseen_levels() -> Iterator[None]:
    """Make environments without an UnseenLevelWarning, for players such as search that are not trained."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnseenLevelWarning)
        yield


class EnvOptions(TypedDict, total=False):
    """Keyword arguments of an environment; the docstring of MiniGolfEnv gives their meaning."""

    observation: str
    render_size: tuple[int, int]
    camera: str
    render_profile: str
    render_speed: float
    difficulty: str | None
    start_level: int | None
    num_levels: int | None
    reward: str | RewardFunction
    max_strokes: int
    tee: str
    top_speed: float | None
    cup_radius: float | None
    putt_noise: tuple[float, float]
    dt: float
    impact: str


class EnvConfig(NamedTuple):
    """The validated arguments of an environment."""

    sampler: TaskSampler
    """Source of the tasks that episodes play."""
    observation: ObservationType
    """Space and function of the observations."""
    reward: RewardFunction
    """Reward function."""
    render_settings: RenderSettings
    """Settings of the images or the window."""


def build_env_config(
    course: str | Course,
    render_modes: Sequence[str],
    render_mode: str | None,
    /,
    *,
    observation: str = "state",
    reward: str | RewardFunction = "shaped",
    render_size: tuple[int, int] = (640, 480),
    camera: str = "follow",
    render_profile: str = "auto",
    render_speed: float = 1.0,
    **task_options: Any,
) -> EnvConfig:
    """Validate an environment's arguments; the docstring of MiniGolfEnv gives their meaning.

    ``task_options`` are those of ``build_task_sampler``: the set of levels and the rules.

    Raises:
        TypeError: an argument is unknown.
        ValueError: an argument has a wrong value.
    """
    unknown = [name for name in task_options if name not in EnvOptions.__annotations__]
    if unknown:
        raise TypeError(_unknown_argument_message(unknown[0]))
    if render_mode is not None:
        one_of(render_mode, render_modes, "render_mode")
    settings = RenderSettings(
        mode=render_mode,
        size=check_size(render_size, "render_size"),
        camera=one_of(camera, CAMERA_NAMES, "camera"),
        profile=one_of(render_profile, RENDER_PROFILES, "render_profile"),
        speed=positive_number(render_speed, "render_speed", "1 is real time."),
    )
    observation_type = OBSERVATIONS[one_of(observation, tuple(OBSERVATIONS), "observation")]
    sampler = build_task_sampler(course, **task_options)
    if course == PROCEDURAL_COURSE and observation == "state":
        warnings.warn(UNSEEN_LEVEL_MESSAGE, UnseenLevelWarning, stacklevel=3)
    return EnvConfig(sampler, observation_type, build_reward(reward), settings)


def _unknown_argument_message(name: str) -> str:
    """Return the message about an unknown argument; it begins as Python's, by which TorchRL and others recognise it."""
    names = ("course", "render_mode", *EnvOptions.__annotations__)
    closest = closest_choice(name, (*names, *ARGUMENT_HINTS)) or ""
    guess = f"did you mean {quote(closest)}?" if closest else "the docstring of MiniGolfEnv describes them."
    advice = ARGUMENT_HINTS.get(closest, guess)
    return f"got an unexpected keyword argument {quote(name)}: expected one of {', '.join(map(repr, names))}; {advice}"


def build_task_sampler(
    course: str | Course = "dogleg",
    *,
    difficulty: str | None = None,
    start_level: int | None = None,
    num_levels: int | None = None,
    **rules: Any,
) -> TaskSampler:
    """Return the sampler of the tasks that an environment's arguments describe.

    Raises:
        TypeError: an argument is unknown.
        ValueError: an argument has a wrong value, or is for levels while the course has none.
    """
    level_arguments = {"difficulty": difficulty, "start_level": start_level, "num_levels": num_levels}
    given: dict[str, Any] = {name: value for name, value in level_arguments.items() if value is not None}
    name = course if isinstance(course, str) else None
    if name != PROCEDURAL_COURSE:
        if given:
            raise ValueError(
                f"{', '.join(given)}: expected with course={quote(PROCEDURAL_COURSE)} only, "
                f"received {quote(given)} with {quote(course)}."
            )
        return _build_round(rules) if name == ROUND_COURSE else SingleTask(build_task(_check_name(course), **rules))
    difficulty = one_of(given.get("difficulty", DIFFICULTY_NAMES[0]), DIFFICULTY_NAMES, "difficulty")
    build = functools.partial(_build_level, difficulty, rules)
    levels = LevelSampler(build, given.get("start_level", 0), given.get("num_levels", 500))
    levels.default()  # Raises an error of the rules here, not at the first reset.
    return levels


def build_task(
    course: str | Course = "dogleg",
    *,
    max_strokes: int = 10,
    tee: str = "random",
    top_speed: float | None = None,
    cup_radius: float | None = None,
    putt_noise: tuple[float, float] = (0.0, 0.0),
    dt: float = 1 / 120,
    impact: str = "average",
) -> Task:
    """Return the task that an environment's arguments describe: a course with its rules.

    Raises:
        ValueError: an argument has a wrong value.
    """
    loaded = load_course(course, cup_radius=cup_radius)
    if loaded.cup is None:
        raise ValueError(
            f"course: expected one with a cup, received {quote(loaded.name)}; "
            "load_course(...).world() throws a ball in a room without a cup."
        )
    speed = loaded.top_speed if top_speed is None else top_speed
    speed = positive_number(speed, "top_speed", "give the launch speed of a full putt in m/s.")
    world = _cached_world(
        loaded, positive_number(dt, "dt", "1/120 s suits minigolf."), one_of(impact, IMPACT_MODELS, "impact")
    )
    strokes = integer(max_strokes, "max_strokes", 1, MAX_STROKES)
    return Task(
        course=loaded,
        holes=compile_hole(loaded, speed, strokes, world.num_steps_for(MAX_PUTT_TIME)),
        world=world,
        random_tee=one_of(tee, TEE_CHOICES, "tee") == "random",
        putt_noise=check_noise(putt_noise),
    )


def _check_name(course: str | Course) -> str | Course:
    """Return the course, or raise a ValueError for an unknown name that lists "round" and "procedural", too."""
    if isinstance(course, str) and not Path(course).suffix and not is_level_name(course):
        return one_of(course, (*list_courses(), ROUND_COURSE, PROCEDURAL_COURSE, *ROOM_NAMES), "course")
    return course


def _build_round(rules: dict[str, Any]) -> SequentialTasks:
    """Return the sampler of the round; errors in the arguments ``rules`` are raised here, not at a later hole."""
    tasks = SequentialTasks(functools.partial(_build_hole, rules), len(ROUND_HOLES))
    num_checked = 1 if rules.get("cup_radius") is None else tasks.count  # Only the cup's radius depends on the hole.
    for number in range(1, 1 + num_checked):
        tasks.get(number)
    return tasks


def _build_hole(rules: dict[str, Any], number: int) -> Task:
    return replace(build_task(ROUND_HOLES[number - 1], **rules), index=number)


def _build_level(difficulty: str, rules: dict[str, Any], level: int) -> Task:
    return replace(build_task(level_name(difficulty, level), **rules), index=level)


def check_actions(actions: ArrayLike, shape: tuple[int | None, ...]) -> FloatArray:
    """Return actions of a shape such as (2,) as an array, or raise a ValueError."""
    return finite_array(actions, shape, "action", ACTION_HINT)


def check_position(task: Task, position: ArrayLike) -> FloatArray:
    """Return a ball's centre (3,) as an array if a ball can be there, or raise a ValueError."""
    ball = finite_array(position, (3,), "position", POSITION_HINT)
    check_positions(task, ball)
    return ball


def check_positions(task: Task, positions: FloatArray) -> None:
    """Raise a ValueError unless balls at (3,) or (N, 3) are in free space within the bounds."""
    task.world.check_collision_free(positions)
    lower, upper = np.asarray(task.course.bounds)
    outside = ((positions < lower) | (positions > upper)).any(axis=-1)
    if outside.any():
        raise ValueError(
            f"position: expected a place within the course's bounds {lower.tolist()} to {upper.tolist()}, "
            f"received {positions[outside].reshape(-1, 3)[0].tolist()}; the ball would be out of bounds."
        )


def check_autoreset(mode: str | AutoresetMode) -> AutoresetMode:
    """Return an autoreset mode, or raise a ValueError."""
    known = [m.value for m in AutoresetMode]
    if mode not in known and mode not in list(AutoresetMode):
        raise ValueError(f"autoreset_mode: expected one of {known}, received {quote(mode)}.")
    return AutoresetMode(mode)


def check_options(options: Any, *known: str) -> dict[str, Any]:
    """Return a copy of reset's options, a dict of known keys, or raise a ValueError."""
    given = {} if options is None else options
    if not isinstance(given, dict):
        raise ValueError(f"options: expected a dict or None, received {quote(given)}.")
    unknown = [name for name in given if name not in known]
    if unknown:
        raise ValueError(f"options: expected only {' and '.join(map(repr, known))}, received {quote(unknown)} as well.")
    return dict(given)


def check_mask(mask: Any, n: int) -> NDArray[np.int64]:
    """Return the indices of the environments that a mask (n,) selects, all for None, or raise a ValueError."""
    if mask is None:
        return np.arange(n)
    if not (isinstance(mask, np.ndarray) and mask.dtype == np.bool_ and mask.shape == (n,) and mask.any()):
        raise ValueError(
            f"reset_mask: expected a bool array of shape ({n},) with a True in it, received {quote(mask)}."
        )
    return np.flatnonzero(mask)


def one_per_env(value: Any, n: int, what: str) -> list[Any]:
    """Return a sequence of n values, one for each environment, as a list, or raise a ValueError."""
    is_list = isinstance(value, (Sequence, np.ndarray)) and count_axes(value) > 0
    if not is_list or len(value) != n:
        received = str(len(value)) if is_list else quote(value)
        raise ValueError(f"{what}: expected {n}, one for each environment, received {received}.")
    return list(value)


def check_noise(value: tuple[float, float]) -> tuple[float, float]:
    """Return the validated noise of putts: standard deviations of direction (degrees) and speed (fraction of it).

    Raises:
        ValueError: the noise is not two finite numbers >= 0.
    """
    direction_deviation, speed_deviation = finite_array(value, (2,), "putt_noise", NOISE_HINT).tolist()
    if direction_deviation < 0.0 or speed_deviation < 0.0:
        raise ValueError(f"putt_noise: expected numbers >= 0, received {quote(value)}; {NOISE_HINT}")
    return direction_deviation, speed_deviation


@functools.lru_cache(maxsize=LEVEL_CACHE_SIZE)
def _cached_world(course: Course, dt: float, impact: str) -> World:
    """Return the course's world; environments share worlds, which are immutable."""
    world: World = course.world(dt=dt, impact=impact)
    return world
