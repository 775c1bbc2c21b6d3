"""The course check: find the errors that prevent a hole from being played."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course, CourseError, Cup, load_course
from minigolf_env.courses.library import ROOM_NAMES
from minigolf_env.envs import MiniGolfEnv, Result
from minigolf_env.physics import World
from minigolf_env.players.search import search

MAX_SEARCH_STROKES = 10
"""Number of strokes within which search must hole out."""

NUM_RANDOM_PUTTS = 400
"""Number of random putts from the tee whose resting places are checked."""

MAX_CHECKED_PLACES = 40
"""Largest number of resting places from which the ball must be able to leave."""

NUM_ESCAPE_PUTTS = 48
"""Number of random putts that try to move the ball away from a resting place."""

NUM_RIM_PROBES = 16
"""Number of points around the cup where the floor is checked."""


def find_course_errors(course: str | Path | Course) -> Iterator[str]:
    """Yield a sentence for each error of a hole; none if it can be played.

    Args:
        course: a course file, the name of a bundled course, or a Course.
    """
    try:
        loaded = load_course(course)
        world = loaded.world()
    except CourseError as error:
        yield str(error)
        return
    yield from _tee_and_cup_errors(loaded, world)
    if loaded.cup is not None:
        yield from _play_errors(loaded)
    elif not any(loaded is load_course(name) for name in ROOM_NAMES):
        yield "cup: expected one, received none: gym.make cannot play the course; add a cup on a floor."


def _tee_and_cup_errors(course: Course, world: World) -> Iterator[str]:
    """Yield the errors in the positions of tee and cup."""
    # Find the floor below the corners and the middle of the tee.
    below_course = min(float(part.mesh.vertices[:, 2].min()) for part in course.parts) - 1.0
    lower, upper = course.tee.lower, course.tee.upper
    for x, y in sorted({*itertools.product(*zip(lower, upper, strict=True)), course.tee.centre}):
        hit = world.sweep((x, y, course.tee.height + course.ball_radius), (x, y, below_course))
        if not hit.hit:
            yield f"tee: expected a floor below ({x:g}, {y:g}), received none; move the tee over a floor."
            return
    if course.cup is None:
        return
    yield from _cup_errors(course.cup, world)
    # Find the floor around the cup.
    x, y, rim = course.cup.position
    angles = np.linspace(0.0, 2.0 * np.pi, NUM_RIM_PROBES, endpoint=False)
    circle = np.c_[np.cos(angles), np.sin(angles), 0.0 * angles]
    probes = np.array([x, y, 0.0]) + 1.5 * course.cup.radius * circle
    above = np.array([0.0, 0.0, rim + 2.0 * course.ball_radius])
    below = np.array([0.0, 0.0, below_course])
    hits = world.sweep_batch(probes + above, probes + below)
    if not np.all(hits.hit):
        yield f"cup: expected a floor all around {course.cup.position}, received a gap next to it; move the cup."


def _cup_errors(cup: Cup, world: World) -> Iterator[str]:
    """Yield an error if the ball cannot fall to the bottom of the cup."""
    x, y, rim = cup.position
    start_height = rim + world.ball_radius
    try:
        world.check_collision_free((x, y, start_height))
    except ValueError as error:
        yield f"cup: expected free space over it; {error}"
        return
    bottom = rim - cup.depth
    hit = world.sweep((x, y, start_height), (x, y, bottom - 1.0))
    landing_height = rim + hit.alpha * (bottom - 1.0 - start_height)
    if not hit.hit or landing_height < bottom - 1e-6:
        yield f"cup: expected a bottom at z = {bottom:g} m below {cup.position}, received none; cut the cup."
    elif landing_height > bottom + 1e-6:
        yield (
            f"cup: expected a way down to its bottom at z = {bottom:g} m, received something at "
            f"z = {landing_height:g} m; cut the cup, and put its position on the floor's level."
        )


def _play_errors(course: Course) -> Iterator[str]:
    """Yield the errors that appear when the hole is played."""
    env = MiniGolfEnv(course=course, tee="fixed", max_strokes=MAX_SEARCH_STROKES)
    env.reset(seed=0)
    info: dict[str, Any] = {}
    done = False
    while not done:
        _, _, done, _, info = env.step(search(env).action)
    if not info["is_success"]:
        yield (
            f"cup: search did not hole out within {MAX_SEARCH_STROKES} strokes; "
            "open a way to the cup, or raise top_speed."
        )
    yield from _trap_errors(env)


def _trap_errors(env: MiniGolfEnv) -> Iterator[str]:
    """Yield an error for the first place found that a ball can reach but not leave."""
    # Collect resting places of random putts.
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    first = env.what_if(_random_actions(NUM_RANDOM_PUTTS, rng))
    places: Any = np.unique(np.round(first.position[~first.holed], 6), axis=0)
    # Try to leave some of them.
    for place in places[rng.permutation(len(places))[:MAX_CHECKED_PLACES]]:
        try:
            env.reset(options={"position": np.add(place, (0.0, 0.0, 1e-5))})
        except ValueError:
            continue
        escapes = env.what_if(_random_actions(NUM_ESCAPE_PUTTS, rng))
        moved = np.linalg.norm(escapes.position - place, axis=1)
        has_left = escapes.holed | (escapes.result == Result.OUT_OF_BOUNDS)
        if not has_left.any() and moved.max() < 2.0 * env.task.course.ball_radius:
            yield (
                f"trap: the ball can reach {place.round(3).tolist()}, but none of {NUM_ESCAPE_PUTTS} random putts "
                "moved it away; close that spot."
            )
            return


def _random_actions(n: int, rng: np.random.Generator) -> NDArray[np.float32]:
    angle = rng.uniform(-np.pi, np.pi, n)
    length = rng.uniform(0.1, 1.0, n)
    return np.asarray(np.c_[length * np.cos(angle), length * np.sin(angle)], dtype=np.float32)
