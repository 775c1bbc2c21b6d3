"""The round: nine holes in turn, from one environment or many."""

from __future__ import annotations

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import minigolf_env  # noqa: F401 (registers the environment)
from minigolf_env.courses import ROUND_COURSE, ROUND_HOLES, list_courses, load_course, par_of
from minigolf_env.courses.io.toml_course import read_description
from minigolf_env.courses.library import DATA_DIR
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv, round_reset_options

NUM_ENVS = 4


def make(**options: Any) -> MiniGolfEnv:
    """Return an environment on the round."""
    return MiniGolfEnv(ROUND_COURSE, **options)


def test_holes_are_played_in_turn() -> None:
    """The nine in the order of the list, then the first again; info names and counts them."""
    env = make()
    infos = [env.reset(seed=3 if k == 0 else None)[1] for k in range(len(ROUND_HOLES) + 2)]
    assert [info["course"] for info in infos] == [*ROUND_HOLES, *ROUND_HOLES[:2]]
    assert list(ROUND_HOLES) == list_courses()[:9]
    assert [info["hole"] for info in infos] == [*range(1, 10), 1, 2]
    assert all(type(info["hole"]) is int and par_of(info["course"]) for info in infos)


def test_hole_of_the_round_equals_the_hole_alone() -> None:
    """The observations, putts and rewards are those of an environment on that hole, in the same spaces."""
    env = make(tee="fixed", observation="rays")
    for number, name in enumerate(ROUND_HOLES, 1):
        alone = MiniGolfEnv(name, tee="fixed", observation="rays")
        observed, _ = env.reset(seed=5, options={"hole": number})
        assert observed.tobytes() == alone.reset(seed=5)[0].tobytes()
        assert env.observation_space == alone.observation_space and env.observation_space.contains(observed)
        action = np.array(read_description(DATA_DIR / f"{name}.toml").hole_in_one, dtype=np.float32)
        played, other = env.step(action), alone.step(action)
        assert played[0].tobytes() == other[0].tobytes() and played[1:4] == other[1:4]
        assert played[-1] == {**other[-1], "hole": number} and played[-1]["is_success"]


def test_seed_restarts_the_round() -> None:
    """A seed gives the same bits again; a reset without a seed continues, also after a selected hole."""
    env = make()
    first = env.reset(seed=6)[0].tobytes(), env.reset()[0].tobytes()
    assert env.reset(options={"hole": 7})[1]["hole"] == 7 and env.reset()[1]["hole"] == 8
    assert (env.reset(seed=6)[0].tobytes(), env.reset()[0].tobytes()) == first
    check_env(gym.make("MiniGolf-v0", course=ROUND_COURSE).unwrapped, skip_render_check=True)


def test_state_includes_the_hole() -> None:
    """Another environment, and an unpickled copy, resume it: this putt and the holes after it."""
    env, other = make(max_strokes=2), make(max_strokes=2)
    env.reset(seed=8, options={"hole": 4})
    env.step([0.4, 0.2])
    state = env.get_state()
    assert state["hole"] == 4
    other.reset(seed=0)
    other.set_state(state)
    copy = pickle.loads(pickle.dumps(env))  # noqa: S301 (our own)
    played = [copied.step([0.3, -0.5]) for copied in (env, other, copy)]
    assert len({step[0].tobytes() for step in played}) == 1 and played[0][1:] == played[1][1:] == played[2][1:]
    after = [copied.reset() for copied in (env, other, copy)]
    assert len({observed.tobytes() for observed, _ in after}) == 1 and [info["hole"] for _, info in after] == [5] * 3


@pytest.mark.parametrize("observation", ["state", "rays"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_batch_on_the_round_equals_single_environments_bitwise(mode: str, observation: str) -> None:
    """Environment i is a single environment seeded with seed + i, though they reach holes at different times."""
    options: dict[str, Any] = {"max_strokes": 3, "observation": observation}
    batch = gym.make_vec("MiniGolf-v0", num_envs=NUM_ENVS, course=ROUND_COURSE, autoreset_mode=mode, **options)
    singles = [make(**options) for _ in range(NUM_ENVS)]
    observed, info = batch.reset(seed=7)
    for i, env in enumerate(singles):
        one, one_info = env.reset(seed=7 + i)
        assert observed[i].tobytes() == one.tobytes() and {key: info[key][i] for key in one_info} == one_info
    mask = np.arange(NUM_ENVS) < 2
    if mode == "Disabled":
        observed, info = batch.reset(options={"reset_mask": mask, "hole": [6, 2, 1, 1]})
        for env, hole in zip(singles, [6, 2], strict=False):
            env.reset(options={"hole": hole})
    over = np.zeros(NUM_ENVS, np.bool_)
    for step in range(9):
        if mode == "Disabled" and over.any():
            observed, _ = batch.reset(options={"reset_mask": over})
            for i in np.flatnonzero(over):
                assert observed[i].tobytes() == singles[i].reset()[0].tobytes()
            over = np.zeros(NUM_ENVS, np.bool_)
        putts = np.random.default_rng(step).uniform(-1, 1, (NUM_ENVS, 2)).astype(np.float32)
        observed, rewards, terminated, _, info = batch.step(putts)
        for i, env in enumerate(singles):
            if mode == "NextStep" and over[i]:
                one, one_info = env.reset()
            else:
                one, reward, ended, _, one_info = env.step(putts[i])
                assert (rewards[i], terminated[i]) == (reward, ended)
                if mode == "SameStep" and ended:
                    assert info["final_obs"][i].tobytes() == one.tobytes()
                    assert {key: info["final_info"][key][i] for key in one_info} == one_info
                    one, one_info = env.reset()
            assert {key: info[key][i] for key in one_info} == one_info
            assert observed[i].tobytes() == one.tobytes()
        over = terminated.copy()
    assert max(info["hole"]) > 2
    batch.close()


def test_seeds_restart_the_rounds_of_a_batch() -> None:
    """Environments without a seed continue."""
    batch = MiniGolfVectorEnv(3, ROUND_COURSE)
    first, _ = batch.reset(seed=1)
    assert batch.reset()[1]["hole"].tolist() == [2, 2, 2]
    assert batch.reset(seed=[4, None, None])[1]["hole"].tolist() == [1, 3, 3]
    assert batch.reset(seed=5, options={"hole": 9})[1]["hole"].tolist() == [9, 9, 9]
    assert batch.reset()[1]["hole"].tolist() == [1, 1, 1]
    again, info = batch.reset(seed=1)
    assert again.tobytes() == first.tobytes() and info["course"].tolist() == [ROUND_HOLES[0]] * 3


def test_what_if_simulates_the_present_hole() -> None:
    """what_if moves neither the ball nor the round."""
    env = make(tee="fixed")
    env.reset(seed=0, options={"hole": 9})
    action = read_description(DATA_DIR / f"{ROUND_HOLES[8]}.toml").hole_in_one
    assert env.what_if([action]).holed.all() and env.reset()[1]["hole"] == 1


def test_reset_options_play_the_round_with_seeded_episodes() -> None:
    """Other courses need no options."""
    env = make()
    played = [env.reset(seed=k, options=round_reset_options(ROUND_COURSE, k))[1]["course"] for k in range(10)]
    assert played == [*ROUND_HOLES, ROUND_HOLES[0]]
    assert round_reset_options("dogleg", 3) == round_reset_options(load_course("dogleg"), 3) == {}


def test_rules_apply_to_every_hole() -> None:
    """A rule that does not fit a hole raises an error when the environment is made."""
    env = make(cup_radius=0.05, max_strokes=4)
    for number in range(1, 10):
        env.reset(options={"hole": number})
        assert (env.task.cup.radius, env.task.max_strokes) == (0.05, 4)
    with pytest.raises(ValueError, match="course 'funnel': cup"):
        make(cup_radius=0.3)


@pytest.mark.parametrize("hole", [0, 10, 1.5, "dogleg", True])
def test_reset_rejects_invalid_hole(hole: Any) -> None:
    """The environment stays as it was."""
    env = make()
    env.reset(seed=1, options={"hole": 2})
    for wrong, message in (
        ({"hole": hole}, "hole: expected an integer from 1 to 9, received"),
        ({"position": env.get_state()["position"]}, "position: expected with a 'hole'"),
        ({"level": 2}, "options: expected only 'hole' and 'position'"),
    ):
        with pytest.raises(ValueError, match=message):
            env.reset(seed=5, options=wrong)
    assert env.step([0.0, 0.0])[-1]["hole"] == 2
    with pytest.raises(ValueError, match="hole: expected an integer from 1 to 9"):
        MiniGolfVectorEnv(2, ROUND_COURSE).reset(options={"hole": [1, hole]})
    with pytest.raises(ValueError, match="num_levels: expected with course='procedural' only"):
        make(num_levels=3)


def test_images_show_the_hole_being_played(gl: None) -> None:
    """Observations and frames are those of an environment on that hole alone."""
    looks: dict[str, Any] = {"observation": "pixels", "render_size": (64, 48), "render_profile": "fast"}
    env = make(render_mode="rgb_array_list", **looks)
    for number, name in enumerate(ROUND_HOLES[:3], 1):
        alone = MiniGolfEnv(name, "rgb_array_list", **looks)
        options = {"hole": number}
        assert np.array_equal(env.reset(seed=2, options=options)[0], alone.reset(seed=2)[0])
        assert np.array_equal(env.step([0.1, 0.0])[0], alone.step([0.1, 0.0])[0])
        assert np.array_equal(env.render(), alone.render())
