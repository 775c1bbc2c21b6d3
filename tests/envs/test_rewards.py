"""Reward functions: registered ones by name, and a user's own."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv, Outcome
from minigolf_env.envs.rewards import REWARDS
from minigolf_env.envs.task import TaskBatch

PUTT_NOISE = (0.5, 0.015)


def holed_fast(before: NDArray[Any], outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> NDArray[Any]:
    """Return a reward that uses all arguments of a reward function."""
    progress = task.distance_to_cup(before) - task.distance_to_cup(outcome.position)
    return np.where(outcome.holed, 10.0, progress) - 0.1 * outcome.bounces - 0.01 * outcome.time - 0.5 * ended


def wrong_shape(before: NDArray[Any], outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> NDArray[Any]:
    """Return one number too many."""
    return np.zeros(len(before) + 1)


def not_finite(before: NDArray[Any], outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> NDArray[Any]:
    """Return NaN for the last ball."""
    return np.where(np.arange(len(before)) == len(before) - 1, np.nan, 0.0)


def not_numbers(before: NDArray[Any], outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> list[str]:
    """Return text."""
    return ["1.0"] * len(before)


def raises(before: NDArray[Any], outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> NDArray[Any]:
    """Raise an error of the user's."""
    raise KeyError("a fault of the user's")


def test_function_gets_arrays_of_the_stroke() -> None:
    """A reward function gets before, outcome, ended and task; N is 1 in a single environment."""
    seen: list[tuple[Any, ...]] = []

    def record(*arguments: Any) -> NDArray[np.float64]:
        seen.append(arguments)
        return np.full(len(arguments[0]), 3.0)

    env = MiniGolfEnv(reward=record, tee="fixed", max_strokes=2)
    env.reset(seed=0)
    start = env.get_state()["position"]
    _, reward, _, _, info = env.step([0.3, 0.1])
    before, outcome, ended, task = seen[0]
    assert type(reward) is float and reward == 3.0
    assert before.tolist() == [list(start)] and ended.tolist() == [False] and task is env.task
    assert outcome.position.tolist() == [list(env.get_state()["position"])]
    assert outcome.time.tolist() == [info["shot_time"]] and outcome.bounces.tolist() == [info["bounces"]]
    env.step([0.3, 0.1])
    assert seen[1][2].tolist() == [True]


@pytest.mark.parametrize("course", ["dogleg", "round"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_batch_gives_rewards_of_single_environments_bitwise(mode: str, course: str) -> None:
    """Rewards have the same bits, also where some environments are reset and play no stroke."""
    options: dict[str, Any] = {"course": course, "reward": holed_fast, "max_strokes": 2, "putt_noise": PUTT_NOISE}
    made = gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=3, autoreset_mode=mode, **options)
    singles = [gym.make("minigolf_env:MiniGolf-v0", **options) for _ in range(3)]
    made.reset(seed=4)
    for i, env in enumerate(singles):
        env.reset(seed=4 + i)
    over = [False] * 3
    for k in range(6):
        putts = np.random.default_rng(k).uniform(-1, 1, (3, 2)).astype(np.float32)
        rewards = made.step(putts)[1]
        assert rewards.dtype == np.float64 and rewards.shape == (3,)
        for i, env in enumerate(singles):
            if over[i] and mode == "NextStep":
                env.reset()
                assert rewards[i] == 0.0
                over[i] = False
                continue
            if over[i]:
                env.reset()
            _, reward, over[i], _, _ = env.step(putts[i])
            assert rewards[i] == reward


@pytest.mark.parametrize("name", list(REWARDS))
def test_registered_function_gives_the_same_rewards_as_its_name(name: str) -> None:
    """The checks of a user's function change no bit."""
    envs = [MiniGolfVectorEnv(4, reward=reward, max_strokes=3) for reward in (name, REWARDS[name])]
    for env in envs:
        env.reset(seed=1)
    for k in range(5):
        putts = np.random.default_rng(k).uniform(-1, 1, (4, 2))
        rewards = [env.step(putts)[1] for env in envs]
        assert rewards[0].tobytes() == rewards[1].tobytes()


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (wrong_shape, r"reward 'wrong_shape': expected shape \({n},\), received \({m},\)"),
        (not_finite, r"reward 'not_finite': expected finite numbers .* received nan"),
        (not_numbers, r"reward 'not_numbers': expected numbers of shape \({n},\), received"),
        (lambda *arguments: 1.0, r"reward '<lambda>': expected shape \({n},\), received \(\)"),
        (raises, "a fault of the user's"),
    ],
)
@pytest.mark.parametrize("noise", [(0.0, 0.0), PUTT_NOISE])
def test_error_of_reward_function_leaves_environment_unchanged(
    function: Callable[..., Any], message: str, noise: tuple[float, float]
) -> None:
    """The ball, the strokes and the random numbers stay; the message names the reward."""
    single = MiniGolfEnv(reward=function, putt_noise=noise)
    batch = MiniGolfVectorEnv(3, reward=function, putt_noise=noise)
    for env, n, putts in ((single, 1, np.full(2, 0.3)), (batch, 3, np.full((3, 2), 0.3))):
        assert isinstance(env, (MiniGolfEnv, MiniGolfVectorEnv))
        env.reset(seed=2)
        before = env.get_state()
        with pytest.raises((ValueError, KeyError), match=message.format(n=n, m=n + 1)):
            env.step(putts)
        assert env.get_state() == before


def test_function_cannot_change_the_state() -> None:
    """A reward function gets read-only arrays."""

    def move(before: NDArray[Any], outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> NDArray[Any]:
        for array in (before, *outcome, ended):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0
        return np.zeros(len(before))

    for env in (MiniGolfEnv(reward=move), MiniGolfVectorEnv(2, reward=move)):
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape or ()))


def test_function_is_not_called_without_strokes() -> None:
    """A step that only resets environments calls no reward function, which may not take empty arrays."""
    batch = MiniGolfVectorEnv(
        2, reward=lambda before, outcome, ended, task: outcome.time / outcome.time.max(), max_strokes=1
    )
    batch.reset(seed=0)
    putts = np.full((2, 2), 0.3)
    assert batch.step(putts)[1].max() == 1.0
    assert batch.step(putts)[1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("reward", ["shape", 5, None, ["shaped"]])
def test_unknown_reward_is_refused(reward: Any) -> None:
    """The message lists the names, guesses which was meant, and says that a function is possible."""
    expected = r"reward \(or a function\): expected one of 'strokes', 'shaped', received"
    for make in (lambda: MiniGolfEnv(reward=reward), lambda: MiniGolfVectorEnv(2, reward=reward)):
        with pytest.raises(ValueError, match=expected) as error:
            make()
    assert reward != "shape" or "did you mean 'shaped'" in str(error.value)


def test_spec_with_a_function_says_that_json_cannot_hold_it() -> None:
    """A spec with a registered reward can be written and read; one with a function still makes environments."""
    named = gym.make("minigolf_env:MiniGolf-v0", reward="strokes")
    assert named.spec is not None and '"reward": "strokes"' in named.spec.to_json()
    single = gym.make("minigolf_env:MiniGolf-v0", reward=holed_fast)
    batch = gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=2, reward=holed_fast)
    for spec in (single.spec, single.unwrapped.spec, batch.spec):
        assert spec is not None and spec.kwargs["reward"] is holed_fast
        with pytest.raises(ValueError, match="received the function 'holed_fast', which JSON cannot hold; add it to"):
            spec.to_json()
    assert single.spec is not None
    again = gym.make(single.spec)
    results = []
    for env in (single, again):
        env.reset(seed=3)
        results.append(env.step(np.array([0.3, 0.1], np.float32))[1])
    assert results[0] == results[1]


@pytest.mark.parametrize("make", [MiniGolfEnv, lambda **options: MiniGolfVectorEnv(2, **options)])
def test_copies_keep_the_function(make: Callable[..., Any]) -> None:
    """A function of a module is pickled by its name; a lambda can be deep-copied, not pickled."""
    env = make(reward=holed_fast)
    env.reset(seed=3)
    pair = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]  # noqa: S301 (our own)
    putts = np.full(env.action_space.shape, 0.3)
    expected = env.step(putts)[1]
    assert all(np.array_equal(other.step(putts)[1], expected) for other in pair)
    anonymous = make(reward=lambda before, outcome, ended, task: -outcome.time)
    anonymous.reset(seed=3)
    other = copy.deepcopy(anonymous)
    assert np.array_equal(other.step(putts)[1], anonymous.step(putts)[1])
    with pytest.raises((AttributeError, pickle.PicklingError), match="lambda"):
        pickle.dumps(anonymous)


def test_checker_accepts_a_function() -> None:
    """Gymnasium's environment checker; rendering is left out, there is no display here."""
    check_env(gym.make("minigolf_env:MiniGolf-v0", reward=holed_fast).unwrapped, skip_render_check=True)
