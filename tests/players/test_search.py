"""Search finds putts that hole out, and does not change the environment."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium.wrappers import TimeLimit

from minigolf_env.courses import Course
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.players.search import NOISE_SAMPLES, SearchBudget, search

COARSE_BUDGETS = (SearchBudget(20, 5, 1),)
PUTT_NOISE = (0.5, 0.015)


def behind_a_wall() -> Course:
    """Return a hole whose cup a slow ball can only reach by rolling around the end of a wall."""
    hole = CourseBuilder("wall", tee=(0.4, 1.0), cup=(3.6, 1.0, 0.0), top_speed=2.0)
    hole.add("lane", outline=[{"box": (0, 0, 4, 2)}])
    hole.add("block", outline=[{"box": (2.0, 0.0, 2.1, 1.6)}], bottom=-0.05, top=0.15)
    return hole.course()


@pytest.fixture
def env() -> MiniGolfEnv:
    """Return an environment of the default hole, reset."""
    made = MiniGolfEnv()
    made.reset(seed=4)
    return made


@pytest.mark.parametrize("noise", [(0.0, 0.0), PUTT_NOISE])
def test_plan_predicts_outcome_and_leaves_environment_unchanged(env: MiniGolfEnv, noise: tuple[float, float]) -> None:
    """The planned putt ends where the plan says; the state and the noise of the environment are as before."""
    before = env.get_state()
    plan = search(env, [SearchBudget(40, 10, 2)], noise=noise)
    assert env.get_state() == before and env.task.putt_noise == (0.0, 0.0)
    wrapped = search(TimeLimit(env, 5), [SearchBudget(40, 10, 2)], noise=noise)
    np.testing.assert_array_equal(wrapped.action, plan.action)
    assert env.action_space.contains(plan.action)
    outcome = env.what_if(plan.action[None])
    assert bool(outcome.holed[0]) == plan.holed
    assert plan.distance == (0.0 if plan.holed else env.task.distance_to_cup(outcome.position)[0])


def test_more_refinements_are_no_worse(env: MiniGolfEnv) -> None:
    """A refinement only adds putts to choose from."""
    coarse, fine = (search(env, [SearchBudget(30, 8, refinements)], look_ahead=False) for refinements in (0, 3))
    assert fine.distance <= coarse.distance
    assert fine.num_simulated >= coarse.num_simulated == 240


def test_finds_hole_in_one_from_tee(env: MiniGolfEnv) -> None:
    """The default hole has a hole-in-one from the tee, and search with its default budgets finds it."""
    plan = search(env)
    assert plan.holed and plan.strokes == 1.0


def test_finds_two_putts_where_no_single_putt_holes_out() -> None:
    """After the first putt of a plan of two strokes, a second search holes out."""
    env = MiniGolfEnv(behind_a_wall(), tee="fixed")
    env.reset(seed=0)
    greedy = search(env, look_ahead=False)
    plan = search(env)
    assert not plan.holed and plan.strokes == 2.0 < greedy.strokes
    env.step(plan.action)
    assert search(env).holed


@pytest.mark.parametrize("options", [{}, {"noise": PUTT_NOISE}])
def test_search_is_deterministic(env: MiniGolfEnv, options: dict[str, Any]) -> None:
    """The same state gives the same plan, with noise and without."""
    plans = [search(env, COARSE_BUDGETS, **options) for _ in range(2)]
    assert np.array_equal(plans[0].action, plans[1].action) and plans[0][1:] == plans[1][1:]


def test_plans_for_noise_of_environment(env: MiniGolfEnv) -> None:
    """Search uses the environment's noise, and the plan's strokes are about the mean of its putt under that noise."""
    noisy = MiniGolfEnv(putt_noise=PUTT_NOISE)
    noisy.reset(seed=4)
    plan = search(noisy)
    assert plan[1:] == search(env, noise=PUTT_NOISE)[1:] and 1.0 <= plan.strokes < 3.0
    putts = np.tile(plan.action.astype(np.float64), (2000, 1))
    noise = np.random.default_rng(0).standard_normal((2000, 2))
    positions = np.tile(noisy.get_state()["position"], (2000, 1))
    outcome = noisy.task.play(positions, putts, noise=noise).outcome
    left = np.where(outcome.holed, 0.0, 1.0 + 0.3 * noisy.task.distance_to_cup(outcome.position))
    assert plan.strokes == pytest.approx(1.0 + left.mean(), abs=0.15)


def test_noise_samples_are_standard_normal() -> None:
    """The samples have mean 0 and standard deviation 1, and their two components are independent."""
    assert np.abs(NOISE_SAMPLES.mean(axis=0)).max() < 0.05
    assert np.abs(np.cov(NOISE_SAMPLES.T) - np.eye(2)).max() < 0.12


def test_rejects_invalid_budgets_and_noise(env: MiniGolfEnv) -> None:
    """A budget without putts, no budgets, or a negative noise is a ValueError."""
    for budget in (SearchBudget(0, 1, 0), SearchBudget(1, 0, 0), SearchBudget(1, 1, -1)):
        with pytest.raises(ValueError, match="budgets: expected directions"):
            search(env, [budget])
    with pytest.raises(ValueError, match="at least one"):
        search(env, [])
    with pytest.raises(ValueError, match="putt_noise"):
        search(env, noise=(-1.0, 0.0))
