"""The native batch is N single environments."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numba
import numpy as np
import pytest

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv

SEED = 11
N = 7


def actions(step: int) -> np.ndarray:
    """Return putts (N, 2), some of which hole out from near the cup."""
    return np.random.default_rng(step).uniform(-1, 1, (N, 2)).astype(np.float32)


def make(mode: str, **options: Any) -> gym.vector.VectorEnv:
    """Return the batch through Gymnasium's own door."""
    return gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=N, autoreset_mode=mode, max_strokes=3, **options)


@pytest.mark.parametrize("noise", [(0.0, 0.0), (0.5, 0.015)])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize("threads", [1, 2])
def test_each_environment_equals_a_single_one(mode: str, noise: tuple[float, float], threads: int) -> None:
    """Environment i is a single environment seeded seed + i, bit for bit, in every mode, whatever the threads."""
    if threads > numba.config.NUMBA_NUM_THREADS:
        pytest.skip("needs as many cores")
    numba.set_num_threads(threads)
    batch = make(mode, putt_noise=noise)
    singles = [MiniGolfEnv(max_strokes=3, putt_noise=noise) for _ in range(N)]
    expected = np.array([env.reset(seed=SEED + i)[0] for i, env in enumerate(singles)])
    assert batch.reset(seed=SEED)[0].tobytes() == expected.tobytes()
    over = np.zeros(N, np.bool_)
    for step in range(8):
        putts = actions(step)
        if mode == "Disabled" and over.any():
            batch.reset(options={"reset_mask": over})
            for i in np.flatnonzero(over):
                singles[i].reset()
            over = np.zeros(N, np.bool_)
        observed, rewards, terminated, truncated, info = batch.step(putts)
        for i, env in enumerate(singles):
            if mode == "NextStep" and over[i]:
                assert observed[i].tobytes() == env.reset()[0].tobytes()
                assert rewards[i] == 0.0 and not terminated[i]
                continue
            observation, reward, ended, _, one = env.step(putts[i])
            assert (rewards[i], terminated[i], truncated[i]) == (reward, ended, False)
            if mode == "SameStep" and ended:
                assert info["final_obs"][i].tobytes() == observation.tobytes()
                assert {key: info["final_info"][key][i] for key in one} == one
                observation = env.reset()[0]
            else:
                assert {key: info[key][i] for key in one} == one
            assert observed[i].tobytes() == observation.tobytes()
        over = terminated.copy()
    batch.close()


def test_a_smaller_batch_has_the_same_streams() -> None:
    """What environment i sees does not depend on how many others there are."""
    large, small = make("NextStep"), gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=2, max_strokes=3)
    assert large.reset(seed=SEED)[0][:2].tobytes() == small.reset(seed=SEED)[0].tobytes()
    for step in range(5):
        assert large.step(actions(step))[0][:2].tobytes() == small.step(actions(step)[:2])[0].tobytes()


def test_arrays_are_new_each_step() -> None:
    """Nothing returned is overwritten later: learners keep references."""
    batch = make("NextStep")
    kept = [batch.reset(seed=0)[0], *(batch.step(actions(step))[0] for step in range(4))]
    assert not any(np.shares_memory(a, b) for a in kept for b in kept if a is not b)
    assert len({array.tobytes() for array in kept}) == len(kept)


def test_spaces_and_metadata() -> None:
    """The batch has the single environment's spaces, batched, and says how it resets."""
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
def test_bad_arguments_are_named(options: dict[str, Any], word: str) -> None:
    """A wrong argument is a ValueError that names it."""
    with pytest.raises(ValueError, match=word):
        MiniGolfVectorEnv(**options)


def test_a_bad_action_changes_nothing() -> None:
    """One NaN refuses the whole batch and leaves it as it was."""
    batch, twin = make("NextStep"), make("NextStep")
    batch.reset(seed=1), twin.reset(seed=1)
    bad = actions(0)
    bad[3, 1] = np.nan
    for wrong in (bad, actions(0)[:-1], "left"):
        with pytest.raises(ValueError, match="action"):
            batch.step(wrong)
    assert batch.step(actions(0))[0].tobytes() == twin.step(actions(0))[0].tobytes()


def test_a_disabled_batch_asks_for_its_reset() -> None:
    """Without autoreset a step after the end is refused."""
    batch = make("Disabled")
    batch.reset(seed=0)
    for _ in range(3):
        batch.step(np.zeros((N, 2)))
    with pytest.raises(gym.error.ResetNeeded, match="reset_mask"):
        batch.step(np.zeros((N, 2)))
