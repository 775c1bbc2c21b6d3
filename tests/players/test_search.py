"""Search finds putts that hole out, and disturbs nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium.wrappers import TimeLimit

from minigolf_env.courses import Course
from minigolf_env.courses.builder import Hole
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.players.search import DRAWS, Effort, search

COARSE = (Effort(20, 5, 1),)
NOISE = (0.5, 0.015)


def behind_a_wall() -> Course:
    """Return a hole whose cup a slow ball can only reach around the end of a wall."""
    hole = Hole("wall", tee=(0.4, 1.0), cup=(3.6, 1.0, 0.0), top_speed=2.0)
    hole.add("lane", outline=[{"box": (0, 0, 4, 2)}])
    hole.add("block", outline=[{"box": (2.0, 0.0, 2.1, 1.6)}], bottom=-0.05, top=0.15)
    return hole.course()


@pytest.fixture
def env() -> MiniGolfEnv:
    """Return the default hole with a ball on the tee."""
    made = MiniGolfEnv()
    made.reset(seed=4)
    return made


@pytest.mark.parametrize("noise", [(0.0, 0.0), NOISE])
def test_the_plan_is_what_happens(env: MiniGolfEnv, noise: tuple[float, float]) -> None:
    """The putt that search found leads where it says, and the search left the game as it was, its noise too."""
    before = env.get_state()
    plan = search(env, [Effort(40, 10, 2)], noise=noise)
    assert env.get_state() == before and env.task.putt_noise == (0.0, 0.0)
    wrapped = search(TimeLimit(env, 5), [Effort(40, 10, 2)], noise=noise)
    np.testing.assert_array_equal(wrapped.action, plan.action)
    assert env.action_space.contains(plan.action)
    outcome = env.what_if(plan.action[None])
    assert bool(outcome.holed[0]) == plan.holed
    assert plan.distance == (0.0 if plan.holed else env.task.distance_to_cup(outcome.position)[0])


def test_more_search_is_no_worse(env: MiniGolfEnv) -> None:
    """Refinement only ever adds putts to choose from."""
    coarse, fine = (search(env, [Effort(30, 8, rounds)], look_ahead=False) for rounds in (0, 3))
    assert fine.distance <= coarse.distance
    assert fine.tried >= coarse.tried == 240


def test_a_perfect_player_holes_in_one(env: MiniGolfEnv) -> None:
    """The hole has a hole-in-one from the tee, and search with its defaults finds it: one stroke, for certain."""
    plan = search(env)
    assert plan.holed and plan.strokes == 1.0


def test_two_putts_where_one_does_not_do() -> None:
    """A plan of two strokes is one: the second search, from where its putt leaves the ball, holes out."""
    env = MiniGolfEnv(behind_a_wall(), tee="fixed")
    env.reset(seed=0)
    blind, plan = search(env, look_ahead=False), search(env)
    assert not plan.holed and plan.strokes == 2.0 < blind.strokes
    env.step(plan.action)
    assert search(env).holed


@pytest.mark.parametrize("options", [{}, {"noise": NOISE}])
def test_search_is_deterministic(env: MiniGolfEnv, options: dict[str, Any]) -> None:
    """The same state gives the same plan."""
    plans = [search(env, COARSE, **options) for _ in range(2)]
    assert np.array_equal(plans[0].action, plans[1].action) and plans[0][1:] == plans[1][1:]


def test_noise_is_planned_for(env: MiniGolfEnv) -> None:
    """The environment's noise is what is planned for; the plan's score is about what its putt gets under that noise."""
    noisy = MiniGolfEnv(putt_noise=NOISE)
    noisy.reset(seed=4)
    plan = search(noisy)
    assert plan[1:] == search(env, noise=NOISE)[1:] and 1.0 <= plan.strokes < 3.0
    putts = np.tile(plan.action.astype(np.float64), (2000, 1))
    velocities = noisy.task.launch_velocity(putts, np.random.default_rng(0).standard_normal((2000, 2)))
    positions = np.tile(noisy.get_state()["position"], (2000, 1))
    outcome = noisy.task.simulate(positions, velocities)
    left = np.where(outcome.holed, 0.0, 1.0 + 0.3 * noisy.task.distance_to_cup(outcome.position))
    assert plan.strokes == pytest.approx(1.0 + left.mean(), abs=0.15)


def test_draws_are_normal() -> None:
    """Mean 0, standard deviation 1, independent."""
    assert np.abs(DRAWS.mean(axis=0)).max() < 0.05
    assert np.abs(np.cov(DRAWS.T) - np.eye(2)).max() < 0.12


def test_senseless_efforts_are_refused(env: MiniGolfEnv) -> None:
    """A search over nothing is a ValueError, and so is noise below 0."""
    for effort in (Effort(0, 1, 0), Effort(1, 0, 0), Effort(1, 1, -1)):
        with pytest.raises(ValueError, match="efforts: expected directions"):
            search(env, [effort])
    with pytest.raises(ValueError, match="at least one"):
        search(env, [])
    with pytest.raises(ValueError, match="putt_noise"):
        search(env, noise=(-1.0, 0.0))
