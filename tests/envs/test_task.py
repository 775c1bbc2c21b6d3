"""The rules of the game."""

from __future__ import annotations

import numpy as np
import pytest

from minigolf_env.envs import Task
from minigolf_env.envs.options import make_task


@pytest.fixture(scope="module")
def task() -> Task:
    """Return the default hole's rules."""
    return make_task()


def test_a_putt_longer_than_one_is_a_full_putt(task: Task) -> None:
    """The length of an action is clipped to 1, its direction kept."""
    launched = task.launch(np.array([[0.3, 0.4], [3.0, 4.0], [0.0, 0.0], [1.0, 1.0]]))
    assert np.allclose(np.linalg.norm(launched, axis=1), np.array([0.5, 1.0, 0.0, 1.0]) * task.top_speed)
    assert np.allclose(launched[1], 2.0 * launched[0])
    assert (launched[:, 2] == 0.0).all()


def test_below_the_rim_means_holed_only_without_the_energy_to_leave(task: Task) -> None:
    """Energy decides: the ball must not be able to lift its centre one radius above the rim."""
    x, y, rim = task.cup.position
    position = np.array([x, y, rim - 0.05])
    radius, g = task.world.ball_radius, 9.81
    escape = np.sqrt(2.0 * g * (0.05 + radius))
    up = np.array([0.0, 0.0, 1.0])
    assert task.is_holed(position, 0.99 * escape * up)
    assert not task.is_holed(position, 1.01 * escape * up)
    aside = np.array([1.01 * task.cup.radius, 0.0, 0.0])
    assert not task.is_holed(position + 0.06 * up, 0.0 * up), "above the rim"
    assert not task.is_holed(position + aside, 0.0 * up), "beside the cup"


def test_distance_is_zero_at_the_cup_and_shrinks_along_the_route(task: Task) -> None:
    """Along the route the distance falls by what was walked; elsewhere it is at least the straight line's."""
    assert task.distance(np.array(task.cup.position)) == pytest.approx(0.0)
    route = np.array(task.course.route)
    legs = np.linalg.norm(np.diff(route, axis=0), axis=1)
    at_corners = task.distance(np.column_stack([route, np.zeros(len(route))]))
    assert at_corners == pytest.approx([legs[i:].sum() for i in range(len(route))])
    lower, upper = np.asarray(task.course.bounds)
    anywhere = np.random.default_rng(0).uniform(lower, upper, (1000, 3))
    straight = np.hypot(*(anywhere[:, :2] - np.array(task.cup.position)[:2]).T)
    assert (task.distance(anywhere) >= straight - 1e-12).all()


def test_shaping_adds_a_constant_to_every_episode(task: Task) -> None:
    """Whatever way an episode takes, shaped rewards sum to minus the strokes plus what the start is worth."""
    shaped = make_task(reward="shaped")
    rng = np.random.default_rng(1)
    start = shaped.tee_off([rng])[0]
    totals = []
    for strokes in (1, 2, 5):
        worth = shaped.potential(np.array([start, *rng.uniform(0.1, 1.0, (strokes, 3))]))
        rewards = shaped.rewards(worth[:-1], worth[1:], np.arange(1, strokes + 1) == strokes)
        totals.append(sum(rewards) + strokes)
    assert totals == pytest.approx([totals[0]] * 3)
    plain = make_task(reward="strokes")
    assert plain.rewards(plain.potential(start), plain.potential(start), np.array(False)) == -1.0


def test_rules_take_one_ball_or_many(task: Task) -> None:
    """Arrays of any leading shape give what single balls give, to the bit."""
    rng = np.random.default_rng(2)
    positions, putts = rng.uniform(0.1, 1.0, (5, 3)), rng.uniform(-1, 1, (5, 2))
    strokes = np.arange(5)
    for many, one in (
        (task.launch(putts), [task.launch(p) for p in putts]),
        (task.observe(positions, strokes), [task.observe(p, s) for p, s in zip(positions, strokes, strict=True)]),
        (task.distance(positions), [task.distance(p) for p in positions]),
        (task.is_holed(positions, positions), [task.is_holed(p, p) for p in positions]),
    ):
        assert many.tobytes() == np.array(one).tobytes()


def test_a_ball_that_left_the_course_goes_back(task: Task) -> None:
    """Out of bounds: the ball lies where it was struck."""
    start = task.tee_off([np.random.default_rng(3)])
    outcome = task.play(start, np.array([[0.0, 0.0, 8.0]]))
    assert outcome.result[0] == 1
    assert (outcome.position == start).all()
