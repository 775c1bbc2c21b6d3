"""Search finds putts that hole out, and disturbs nothing."""

from __future__ import annotations

import numpy as np
import pytest

from minigolf_env.envs import MiniGolfEnv
from minigolf_env.planning import search


@pytest.fixture
def env() -> MiniGolfEnv:
    """Return the default hole with a ball on the tee."""
    made = MiniGolfEnv()
    made.reset(seed=4)
    return made


def test_the_plan_is_what_happens(env: MiniGolfEnv) -> None:
    """The putt that search found leads where it says, and the search left the game as it was."""
    before = env.get_state()
    plan = search(env, directions=40, speeds=10, rounds=2)
    assert env.get_state() == before
    assert env.action_space.contains(plan.action)
    outcome = env.what_if(plan.action[None])
    assert bool(outcome.holed[0]) == plan.holed
    assert plan.distance == (0.0 if plan.holed else env.task.distance(outcome.position)[0])


def test_more_search_is_no_worse(env: MiniGolfEnv) -> None:
    """Refinement only ever adds putts to choose from."""
    coarse, fine = (search(env, directions=30, speeds=8, rounds=rounds) for rounds in (0, 3))
    assert fine.distance <= coarse.distance
    assert fine.tried >= coarse.tried == 240


def test_a_perfect_player_holes_in_one(env: MiniGolfEnv) -> None:
    """The hole has a hole-in-one from the tee, and search with its defaults finds it."""
    assert search(env).holed


def test_senseless_sizes_are_refused(env: MiniGolfEnv) -> None:
    """A search over nothing is a ValueError."""
    with pytest.raises(ValueError, match="directions"):
        search(env, directions=0)
    with pytest.raises(ValueError, match="rounds"):
        search(env, rounds=-1)


def test_search_is_deterministic(env: MiniGolfEnv) -> None:
    """The same state gives the same plan."""
    plans = [search(env, directions=20, speeds=5, rounds=1) for _ in range(2)]
    assert np.array_equal(plans[0].action, plans[1].action) and plans[0][1:] == plans[1][1:]
