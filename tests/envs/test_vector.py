"""The vector environment equals N single environments bit for bit."""

from __future__ import annotations

import itertools
import pickle
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numba
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Discrete
from gymnasium.vector.utils import batch_space

from minigolf_env.courses import list_courses
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.observations import OBSERVATIONS
from minigolf_env.envs.spaces import BOX_ARRAYS, batch_box
from tests.envs.vector_parity import VectorParity

RESET_SEED = 11
NUM_ENVS = 7
AUTORESET_MODES = ["NextStep", "SameStep", "Disabled"]


def actions(step: int) -> np.ndarray:
    """Return putts (N, 2), some of which hole out from near the cup."""
    return np.random.default_rng(step).uniform(-1, 1, (NUM_ENVS, 2)).astype(np.float32)


def make(mode: str, **options: Any) -> gym.vector.VectorEnv:
    """Return the batch from gym.make_vec."""
    return gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=NUM_ENVS, autoreset_mode=mode, max_strokes=3, **options)


@pytest.fixture
def restored_num_threads() -> Iterator[None]:
    """Restore numba's number of threads."""
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.mark.parametrize("noise", [(0.0, 0.0), (0.5, 0.015)])
@pytest.mark.parametrize("mode", AUTORESET_MODES)
@pytest.mark.parametrize("num_threads", [1, 2])
def test_batch_equals_single_environments_bitwise(
    mode: str, noise: tuple[float, float], num_threads: int, restored_num_threads: None
) -> None:
    """Environment i is a single environment seeded with seed + i, in every mode, for any number of threads."""
    if num_threads > numba.config.NUMBA_NUM_THREADS:
        pytest.skip("needs as many cores")
    numba.set_num_threads(num_threads)
    VectorParity(mode, NUM_ENVS, max_strokes=3, putt_noise=noise).play(8)


@pytest.mark.parametrize("course", [*list_courses(), "procedural"])
@pytest.mark.parametrize("mode", AUTORESET_MODES)
def test_batch_equals_single_environments_on_every_course(mode: str, course: str) -> None:
    """A batch on every course has the bits of single environments, in every mode, with noise."""
    VectorParity(mode, 3, course=course, max_strokes=2, putt_noise=(0.5, 0.015)).play(5)


@pytest.mark.parametrize(
    ("observation", "reward"), [("state", "shaped"), ("state", "strokes"), ("rays", "shaped"), ("pixels", "strokes")]
)
@pytest.mark.parametrize("course", ["dogleg", "procedural"])
@pytest.mark.parametrize("mode", AUTORESET_MODES)
def test_batch_equals_single_environments_for_all_observations_and_rewards(
    mode: str, course: str, observation: str, reward: str, request: pytest.FixtureRequest
) -> None:
    """Every mode gives the same bits, on one hole and on levels, with other options changed, too."""
    if observation == "pixels":
        request.getfixturevalue("gl")
    options: dict[str, Any] = {"tee": "fixed", "impact": "conservative", "top_speed": 3.0, "cup_radius": 0.08}
    VectorParity(mode, 3, course=course, max_strokes=2, reward=reward, observation=observation, **options).play(5)


@pytest.mark.parametrize("course", ["dogleg", "procedural"])
@pytest.mark.parametrize("mode", AUTORESET_MODES)
def test_batch_and_single_environments_exchange_states(mode: str, course: str) -> None:
    """States of a batch and of single environments are equal, and both continue from them equally."""
    options: dict[str, Any] = {"course": course, "max_strokes": 2, "putt_noise": (0.5, 0.015)}
    pair = VectorParity(mode, 4, **options)
    for first in range(3):
        states = pair.batch.get_state()
        assert states == [env.get_state() for env in pair.singles]
        pair.play(3, first)
        after = pair.batch.get_state()
        pair.batch.set_state(states)
        assert pair.batch.get_state() == states
        pair.singles = [MiniGolfEnv(**options) for _ in states]
        for env, state in zip(pair.singles, states, strict=True):
            env.set_state(state)
        pair.over = np.array([state["over"] for state in states])
        pair.play(3, first)
        assert pair.batch.get_state() == after


def test_batch_resumes_states_without_a_reset() -> None:
    """A batch resumes states before its first reset; a state needs no more than a position."""
    batch = MiniGolfVectorEnv(2)
    states = [{"position": (0.4, 0.5, 0.1), "strokes": 3}, {"position": (0.6, 0.5, 0.1)}]
    batch.set_state(states)
    assert [state["position"] for state in batch.get_state()] == [(0.4, 0.5, 0.1), (0.6, 0.5, 0.1)]
    assert batch.step(np.zeros((2, 2)))[-1]["strokes"].tolist() == [4, 1]


VALID_STATE = {"position": (0.4, 0.5, 0.1)}


@pytest.mark.parametrize(
    ("states", "words"),
    [
        (VALID_STATE, "states: expected 3, one for each environment"),
        ([VALID_STATE] * 2, "states: expected 3, one for each environment, received 2"),
        ("abc", "states: expected 3"),
        ([VALID_STATE, VALID_STATE, "left"], "state 2: state: expected 'position'"),
        ([VALID_STATE, {"position": (0.4, 0.5, -0.1)}, VALID_STATE], "state 1: position: expected a ball in"),
        ([VALID_STATE, VALID_STATE, {"position": (9.0, 9.0, 0.1)}], "state 2: position: expected a place within"),
        ([VALID_STATE, {"position": (0.4, 0.5)}, VALID_STATE], "state 1: position: expected shape"),
        ([VALID_STATE, VALID_STATE, VALID_STATE | {"strokes": 99}], "state 2: strokes"),
        ([VALID_STATE, VALID_STATE, VALID_STATE | {"strokes": 10}], "state 2: strokes: expected"),
        ([VALID_STATE, VALID_STATE, VALID_STATE | {"np_random": {"state": 1}}], "state 2: np_random"),
        (
            [VALID_STATE, VALID_STATE | {"over": True}, VALID_STATE],
            "state 1: over: expected an episode that is not over",
        ),
        ([VALID_STATE, VALID_STATE | {"level": 3}, VALID_STATE], "state 1: level: expected none"),
    ],
)
def test_invalid_states_are_rejected_and_change_nothing(states: Any, words: str) -> None:
    """One invalid state rejects all of them, before the first reset, too."""
    batch = MiniGolfVectorEnv(3, autoreset_mode="SameStep")
    for k in range(2):
        with pytest.raises(ValueError, match=words):
            batch.set_state(states)
        if k == 0:
            with pytest.raises(gym.error.ResetNeeded):
                batch.get_state()
            batch.reset(seed=1)
            before = batch.get_state()
    assert batch.get_state() == before


@pytest.mark.parametrize("course", ["dogleg", "procedural"])
def test_what_if_equals_single_environments_bitwise(course: str) -> None:
    """Separate and shared putts give the same bits; no ball moves and no random number is drawn."""
    pair = VectorParity("NextStep", 4, course=course, max_strokes=2, putt_noise=(0.5, 0.015))
    for k in range(3):
        pair.play(1, k)
        before, putts = pair.batch.get_state(), pair.putts(k, 6)
        own, same, none = (pair.batch.what_if(actions) for actions in (putts, putts[0], putts[:, :0]))
        assert pair.batch.get_state() == before
        assert own.position.shape == (4, 6, 3) and own.holed.shape == (4, 6) and none.result.shape == (4, 0)
        for i, env in enumerate(pair.singles):
            for outcome, mine in ((own, putts[i]), (same, putts[0])):
                for field, expected in zip(outcome, env.what_if(mine), strict=True):
                    assert field[i].dtype == expected.dtype and field[i].tobytes() == expected.tobytes()


def test_what_if_rejects_invalid_actions() -> None:
    """Valid actions are finite, for all environments or for each, after a reset."""
    batch = MiniGolfVectorEnv(3)
    with pytest.raises(gym.error.ResetNeeded):
        batch.what_if(np.zeros((5, 2)))
    batch.reset(seed=0)
    for wrong in (np.zeros(2), np.zeros((2, 5, 2)), np.zeros((3, 5, 3)), np.zeros((1, 3, 5, 2)), "left", np.inf):
        with pytest.raises(ValueError, match="action: expected"):
            batch.what_if(wrong)


def test_call_and_get_attr_equal_gymnasiums_sync_vector_env() -> None:
    """Methods and shared attributes give the results of a SyncVectorEnv."""
    batch = MiniGolfVectorEnv(3)
    loop = gym.vector.SyncVectorEnv([MiniGolfEnv] * 3)
    batch.reset(seed=5), loop.reset(seed=5)
    assert batch.call("get_state") == loop.call("get_state")
    putts = np.random.default_rng(0).uniform(-1, 1, (4, 2))
    for mine, theirs in zip(batch.call("what_if", putts), loop.call("what_if", actions=putts), strict=True):
        assert all(a.tobytes() == b.tobytes() for a, b in zip(mine, theirs, strict=True))
    for name in ("render_mode", "action_space", "observation_space"):
        assert batch.get_attr(name) == loop.get_attr(name) == batch.call(name)
    assert [task.course.name for task in batch.get_attr("task")] == ["dogleg"] * 3
    assert batch.get_attr("metadata")[0]["render_fps"] == 30 and batch.call("render") == (None,) * 3


def test_set_attr_sets_generators_only() -> None:
    """Each environment takes a generator; all other attributes follow from the rules, or are shared."""
    batch, other = MiniGolfVectorEnv(2), MiniGolfVectorEnv(2)
    rngs = [gym.utils.seeding.np_random(seed)[0] for seed in (8, 9)]
    with pytest.raises(gym.error.ResetNeeded):
        batch.set_attr("np_random", rngs)
    batch.reset(seed=0)
    batch.set_attr("np_random", rngs)
    assert batch.get_attr("np_random") == tuple(rngs)
    assert batch.reset()[0].tobytes() == other.reset(seed=8)[0].tobytes()
    for wrong in (
        rngs[0],
        rngs[:1],
        [rngs[0]] * 2,
        [1, 2],
        [np.random.Generator(np.random.MT19937(k)) for k in (1, 2)],
        [np.random.PCG64(k) for k in (1, 2)],
        [np.random.Generator(rngs[0].bit_generator) for _ in range(2)],
    ):
        with pytest.raises(ValueError, match="np_random: expected 2"):
            batch.set_attr("np_random", wrong)
    assert batch.get_attr("np_random") == tuple(rngs)
    for name in ("render_mode", "task", "strokes"):
        with pytest.raises(AttributeError, match=f"expected 'np_random', received '{name}'"):
            batch.set_attr(name, [None, None])
    for name in ("step", "reset", "set_state", "strokes"):
        with pytest.raises(AttributeError, match=f"'get_state', 'render' or 'what_if', received '{name}'"):
            batch.call(name)


def test_random_streams_do_not_depend_on_the_batch_size() -> None:
    """Environment i observes the same in a smaller batch."""
    large, small = make("NextStep"), gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=2, max_strokes=3)
    assert large.reset(seed=RESET_SEED)[0][:2].tobytes() == small.reset(seed=RESET_SEED)[0].tobytes()
    for step in range(5):
        assert large.step(actions(step))[0][:2].tobytes() == small.step(actions(step)[:2])[0].tobytes()


@pytest.mark.parametrize("mode", AUTORESET_MODES[:2])
def test_arrays_are_new_each_step(mode: str) -> None:
    """No returned array is overwritten later, or shares memory with another: learners keep references."""
    batch = make(mode)
    kept = [*arrays(batch.reset(seed=0)), *(array for k in range(4) for array in arrays(batch.step(actions(k))))]
    before = [array.tolist() for array in kept]
    batch.step(actions(4))
    assert [array.tolist() for array in kept] == before
    assert not any(np.shares_memory(a, b) for a, b in itertools.combinations(kept, 2))


def arrays(results: Any) -> list[np.ndarray]:
    """Return all arrays in the values that reset or step returned, except those inside arrays of objects."""
    values = results.values() if isinstance(results, dict) else results
    found = (arrays(value) if isinstance(value, (dict, tuple)) else [value] for value in values)
    return [array for several in found for array in several]


def test_batch_has_the_single_spaces_and_reports_its_autoreset_mode() -> None:
    """The spaces are the single environment's, batched."""
    batch, single = make("SameStep"), MiniGolfEnv()
    assert isinstance(batch.unwrapped, MiniGolfVectorEnv)
    assert batch.single_action_space == single.action_space
    assert batch.single_observation_space == single.observation_space
    assert batch.observation_space.contains(batch.reset(seed=0)[0])
    assert batch.metadata["autoreset_mode"] == gym.vector.AutoresetMode.SAME_STEP


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"num_envs": 0}, "num_envs"),
        ({"autoreset_mode": "Never"}, "autoreset_mode"),
        ({"render_mode": "human"}, "render"),
    ],
)
def test_batch_argument_error_names_the_argument(options: dict[str, Any], word: str) -> None:
    """A wrong argument raises a ValueError that names it."""
    with pytest.raises(ValueError, match=word):
        MiniGolfVectorEnv(**options)


def test_invalid_action_changes_nothing_in_a_batch() -> None:
    """A single NaN rejects the actions of the whole batch."""
    batch, other = make("NextStep"), make("NextStep")
    batch.reset(seed=1), other.reset(seed=1)
    bad = actions(0)
    bad[3, 1] = np.nan
    for wrong in (bad, actions(0)[:-1], "left"):
        with pytest.raises(ValueError, match="action"):
            batch.step(wrong)
    assert batch.step(actions(0))[0].tobytes() == other.step(actions(0))[0].tobytes()


def test_batch_without_autoreset_asks_for_reset() -> None:
    """A step after the end of an episode raises ResetNeeded."""
    batch = make("Disabled")
    batch.reset(seed=0)
    for _ in range(3):
        batch.step(np.zeros((NUM_ENVS, 2)))
    with pytest.raises(gym.error.ResetNeeded, match="reset_mask"):
        batch.step(np.zeros((NUM_ENVS, 2)))


def test_partial_reset_reports_only_the_environments_that_it_resets() -> None:
    """Values of the others are zero or None, and masked, as in Gymnasium's vector environments."""
    envs = MiniGolfVectorEnv(3, "round", autoreset_mode="Disabled")
    envs.reset(seed=0)
    envs.step(np.zeros((3, 2)))
    mask = np.array([False, True, False])
    _, infos = envs.reset(options={"reset_mask": mask})
    for key in ("strokes", "is_success", "status", "shot_time", "bounces", "course", "hole"):
        assert (infos[f"_{key}"] == mask).all()
        assert not any(infos[key][~mask])
    assert infos["status"][1] == "tee" and infos["hole"][1] == 2
    assert [state["strokes"] for state in envs.get_state()] == [1, 0, 1]
    _, complete = envs.reset()
    assert {key: values.dtype for key, values in infos.items()} == {key: v.dtype for key, v in complete.items()}


def test_seeds_of_a_batch_are_those_of_its_generators() -> None:
    """np_random_seed has the seed of each environment; a generator that was set from outside has the seed -1."""
    envs = MiniGolfVectorEnv(3)
    with pytest.raises(ResetNeeded):
        _ = envs.np_random_seed
    envs.reset(seed=7)
    assert envs.np_random_seed == envs.get_attr("np_random_seed") == (7, 8, 9)
    envs.reset(seed=[None, 3, None])
    assert envs.np_random_seed == (7, 3, 9) and isinstance(envs.np_random, tuple)
    envs.reset()
    assert envs.np_random_seed == (7, 3, 9)
    single = MiniGolfEnv()
    single.reset(seed=3)
    assert single.np_random_seed == 3
    envs.set_attr("np_random", [np.random.default_rng(k) for k in range(3)])
    assert envs.np_random_seed == (-1, -1, -1)
    envs.reset(seed=7)
    kept, _, last = envs.np_random
    envs.np_random = (kept, np.random.default_rng(0), last)
    assert envs.np_random_seed == (7, -1, 9)


def test_environments_derive_from_gymnasium_directly() -> None:
    """Clients such as skrl look for Gymnasium's classes among the direct bases."""
    assert gym.vector.VectorEnv in MiniGolfVectorEnv.__bases__
    assert gym.Env in MiniGolfEnv.__bases__


@pytest.mark.parametrize("name", OBSERVATIONS)
def test_batched_space_is_gymnasiums_without_repeated_bounds(name: str) -> None:
    """It is equal, samples alike, and its arrays have the memory of one environment's."""
    space = OBSERVATIONS[name].space()
    batched, expected = batch_box(space, 3), batch_space(space, 3)
    assert batched == expected and batched.shape == expected.shape and batched.dtype == expected.dtype
    batched.seed(5)
    expected.seed(5)
    sample = batched.sample()
    np.testing.assert_array_equal(sample, expected.sample())
    assert batched.contains(sample) and not batched.contains(sample[0])
    assert all(getattr(batched, array).strides[0] == 0 for array in BOX_ARRAYS)
    assert pickle.loads(pickle.dumps(batched)) == expected  # noqa: S301 (our own bytes)
    assert batch_box(Discrete(4), 3) == batch_space(Discrete(4), 3)
