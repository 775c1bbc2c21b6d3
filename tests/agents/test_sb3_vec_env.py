"""The adapter from Gymnasium's vector environment to stable-baselines3's VecEnv."""

from __future__ import annotations

import functools
import itertools
import sys
import types
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecMonitor, VecVideoRecorder

from agents.sb3_vec_env import SB3VecEnv
from minigolf_env.envs import MiniGolfEnv

NUM_ENVS = 4
MAX_STROKES = 2


@pytest.fixture
def envs() -> SB3VecEnv:
    """Return a small batch whose episodes end after two strokes at the latest."""
    batch = gym.make_vec(
        "minigolf_env:MiniGolf-v0", num_envs=NUM_ENVS, autoreset_mode="SameStep", max_strokes=MAX_STROKES
    )
    return SB3VecEnv(batch)


def test_renders_environments(gl: None) -> None:
    """``get_images`` returns an image of each environment, and ``render`` stable-baselines3's tiled image of them."""
    options = {"autoreset_mode": "SameStep", "render_mode": "rgb_array", "render_size": (32, 24)}
    envs = SB3VecEnv(gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=NUM_ENVS, **options))
    envs.reset()
    images = envs.get_images()
    assert [image.shape for image in images if image is not None] == [(24, 32, 3)] * NUM_ENVS
    tiled = envs.render()
    assert tiled is not None and tiled.shape == (48, 64, 3)


def test_steps_match_single_environments_bitwise(envs: SB3VecEnv) -> None:
    """Observations, rewards, dones, terminal observations and infos equal those of single environments."""
    envs.seed(5)
    observations = envs.reset()
    singles = [MiniGolfEnv(max_strokes=MAX_STROKES) for _ in range(NUM_ENVS)]
    assert observations.tobytes() == np.array([env.reset(seed=5 + i)[0] for i, env in enumerate(singles)]).tobytes()
    for step in range(5):
        putts = np.random.default_rng(step).uniform(-1, 1, (NUM_ENVS, 2)).astype(np.float32)
        observations, rewards, dones, infos = envs.step(putts)
        for i, env in enumerate(singles):
            expected, reward, terminated, _, info = env.step(putts[i])
            assert (rewards[i], dones[i]) == (np.float32(reward), terminated)
            if terminated:
                assert infos[i]["terminal_observation"].tobytes() == expected.tobytes()
                assert infos[i]["TimeLimit.truncated"] is False
                assert {key: infos[i][key] for key in info} == info
                expected = env.reset()[0]
            assert observations[i].tobytes() == expected.tobytes()


def test_vec_monitor_counts_strokes(envs: SB3VecEnv) -> None:
    """VecMonitor reports the strokes as the episode's length, sums the rewards, and keeps our infos."""
    monitored = VecMonitor(envs, info_keywords=("is_success",))
    monitored.reset()
    returns = np.zeros(NUM_ENVS)
    for _ in range(MAX_STROKES):
        _, rewards, dones, infos = monitored.step(np.full((NUM_ENVS, 2), [-0.01, 0.0], dtype=np.float32))
        returns += rewards
    assert dones.all() and [info["episode"]["l"] for info in infos] == [MAX_STROKES] * NUM_ENVS
    assert [info["episode"]["r"] for info in infos] == pytest.approx(returns.tolist())
    assert [info["episode"]["is_success"] for info in infos] == [False] * NUM_ENVS


def test_steps_and_environments_share_no_memory(envs: SB3VecEnv) -> None:
    """Learning algorithms write into rewards and infos, and keep references to all arrays."""
    arrays = [envs.reset()]
    infos = list(envs.reset_infos)
    for step in range(2 * MAX_STROKES):
        observations, rewards, _, step_infos = envs.step(np.random.default_rng(step).uniform(-1, 1, (NUM_ENVS, 2)))
        arrays += [observations, rewards, *(info["terminal_observation"] for info in step_infos if info)]
        infos += step_infos
    assert len(set(map(id, infos))) == len(infos)
    assert not any(np.shares_memory(a, b) for a, b in itertools.combinations(arrays, 2))


def test_attributes_and_methods_by_indices(envs: SB3VecEnv) -> None:
    """``get_attr``, ``set_attr`` and ``env_method`` select environments as stable-baselines3's own VecEnvs do."""
    assert envs.get_attr("render_mode") == [None] * NUM_ENVS and envs.has_attr("task") and not envs.has_attr("strokes")
    assert envs.env_is_wrapped(gym.Wrapper) == [False] * NUM_ENVS
    envs.reset()
    states = envs.env_method("get_state")
    assert envs.env_method("get_state", indices=[2, 0]) == [states[2], states[0]]
    (outcome,) = envs.env_method("what_if", [[0.1, 0.0]] * 3, indices=1)
    assert outcome.position.shape == (3, 3)
    rng = np.random.Generator(np.random.PCG64(5))
    generators = envs.get_attr("np_random")
    envs.set_attr("np_random", rng, indices=[1])
    assert envs.get_attr("np_random") == [generators[0], rng, *generators[2:]]
    with pytest.raises(ValueError, match="np_random: expected 4 different generators"):
        envs.set_attr("np_random", rng)
    with pytest.raises(AttributeError, match="make a new batch"):
        envs.set_attr("render_mode", "human", indices=[0])


def test_vec_video_recorder_records_each_step(gl: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """stable-baselines3's VecVideoRecorder works, here with a fake in place of its encoder moviepy."""
    clips: list[list[np.ndarray]] = []

    class FakeClip:
        def __init__(self, frames: list[np.ndarray], fps: int) -> None:
            clips.append(frames)

        def write_videofile(self, path: str) -> None:
            Path(path).touch()

    for name in ("moviepy", "moviepy.video", "moviepy.video.io", "moviepy.video.io.ImageSequenceClip"):
        module = types.ModuleType(name)
        monkeypatch.setitem(sys.modules, name, module)
    module.ImageSequenceClip = FakeClip  # type: ignore[attr-defined]
    options = {"autoreset_mode": "SameStep", "render_mode": "rgb_array", "render_size": (32, 24)}
    envs = SB3VecEnv(gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=NUM_ENVS, **options))
    video = VecVideoRecorder(VecMonitor(envs), str(tmp_path), lambda step: step == 0, video_length=2)
    video.reset()
    for _ in range(3):
        video.step(np.full((NUM_ENVS, 2), [0.1, 0.0], dtype=np.float32))
    assert [frame.shape for frame in clips[0]] == [(48, 64, 3)] * 3
    assert not np.array_equal(clips[0][0], clips[0][1]) and len(list(tmp_path.iterdir())) == 1
    video.close()


def test_rejects_other_autoreset_modes() -> None:
    """In NextStep mode the learning algorithm would receive transitions across episodes."""
    with pytest.raises(ValueError, match="SameStep"):
        SB3VecEnv(gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=2))


def test_options_apply_to_the_next_reset_only() -> None:
    """set_options selects the levels of one reset, for all environments or each; missing ones are an error."""
    make = functools.partial(gym.make_vec, "MiniGolf-v0", course="procedural", observation="rays")
    envs = SB3VecEnv(make(num_envs=3, autoreset_mode="SameStep"))
    envs.seed(0)
    envs.set_options({"level": 17})
    envs.reset()
    assert [info["level"] for info in envs.reset_infos] == [17, 17, 17]
    envs.set_options([{"level": level} for level in (4, 5, 6)])
    envs.reset()
    assert [info["level"] for info in envs.reset_infos] == [4, 5, 6]
    envs.reset()
    assert [info["level"] for info in envs.reset_infos] != [4, 5, 6]
    envs.set_options([{"level": 4}, {}, {"level": 6}])
    with pytest.raises(ValueError, match="options: expected the same keys for each of 3 environments"):
        envs.reset()
    envs.set_options({"lvl": 4})
    with pytest.raises(ValueError, match="options: expected only 'level'"):
        envs.reset()
