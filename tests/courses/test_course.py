"""Course itself: what it refuses, and that copies of it are it."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pytest

from minigolf_env.courses import CourseError, list_courses, load_course, par_of
from minigolf_env.envs import MiniGolfEnv


@pytest.mark.parametrize("k", [0, 1, 2])
def test_a_route_with_a_point_twice_is_refused(k: int) -> None:
    """Its leg has no direction: distances along the course would be NaN."""
    course = load_course("dogleg")
    with pytest.raises(CourseError, match=r"route.*repeated"):
        dataclasses.replace(course, route=(*course.route[: k + 1], *course.route[k:]))


def test_copies_of_environments_share_course_and_world() -> None:
    """Both are immutable; a copy made for a look ahead costs neither meshes nor pictures again, and plays on alike."""
    env = MiniGolfEnv()
    env.reset(seed=0)
    other = copy.deepcopy(env)
    assert other.task.course is env.task.course and other.task.world is env.task.world
    putt = np.array([0.3, 0.2], np.float32)
    np.testing.assert_array_equal(env.step(putt)[0], other.step(putt)[0])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(env)).step(putt)[0], env.step(putt)[0])  # noqa: S301


@pytest.mark.parametrize("name", [*list_courses(), "room"])
def test_par_is_known_without_building(name: str) -> None:
    """As the course has it."""
    assert par_of(name) == load_course(name).par
