"""stable-baselines3's view of the native batch."""

from __future__ import annotations

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

N, STROKES = 4, 2


@pytest.fixture
def envs() -> SB3VecEnv:
    """Return a small batch whose episodes end after two strokes at the latest."""
    batch = gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=N, autoreset_mode="SameStep", max_strokes=STROKES)
    return SB3VecEnv(batch)


def test_it_shows_its_environments(gl: None) -> None:
    """get_images, and the tiled picture that stable-baselines3 makes of them; none without a render mode."""
    options = {"autoreset_mode": "SameStep", "render_mode": "rgb_array", "render_size": (32, 24)}
    envs = SB3VecEnv(gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=N, **options))
    envs.reset()
    pictures = envs.get_images()
    assert [picture.shape for picture in pictures if picture is not None] == [(24, 32, 3)] * N
    tiled = envs.render()
    assert tiled is not None and tiled.shape == (48, 64, 3)


def test_it_tells_what_single_environments_do(envs: SB3VecEnv) -> None:
    """Observations, rewards, ends, terminal observations and infos are the single environments', reset at once."""
    envs.seed(5)
    observed = envs.reset()
    singles = [MiniGolfEnv(max_strokes=STROKES) for _ in range(N)]
    assert observed.tobytes() == np.array([env.reset(seed=5 + i)[0] for i, env in enumerate(singles)]).tobytes()
    for step in range(5):
        putts = np.random.default_rng(step).uniform(-1, 1, (N, 2)).astype(np.float32)
        observed, rewards, dones, infos = envs.step(putts)
        for i, env in enumerate(singles):
            expected, reward, terminated, _, info = env.step(putts[i])
            assert (rewards[i], dones[i]) == (np.float32(reward), terminated)
            if terminated:
                assert infos[i]["terminal_observation"].tobytes() == expected.tobytes()
                assert infos[i]["TimeLimit.truncated"] is False
                assert {key: infos[i][key] for key in info} == info
                expected = env.reset()[0]
            assert observed[i].tobytes() == expected.tobytes()


def test_monitors_count_strokes(envs: SB3VecEnv) -> None:
    """VecMonitor takes strokes as the episode's length, adds up the rewards, and leaves our infos as they were."""
    monitored = VecMonitor(envs, info_keywords=("is_success",))
    monitored.reset()
    returns = np.zeros(N)
    for _ in range(STROKES):
        _, rewards, dones, infos = monitored.step(np.full((N, 2), [-0.01, 0.0], dtype=np.float32))
        returns += rewards
    assert dones.all() and [info["episode"]["l"] for info in infos] == [STROKES] * N
    assert [info["episode"]["r"] for info in infos] == pytest.approx(returns.tolist())
    assert [info["episode"]["is_success"] for info in infos] == [False] * N


def test_nothing_is_shared_between_steps_and_environments(envs: SB3VecEnv) -> None:
    """Learners write into rewards and infos, and keep references to all."""
    seen = [envs.reset()]
    infos = list(envs.reset_infos)
    for step in range(2 * STROKES):
        observed, rewards, _, more = envs.step(np.random.default_rng(step).uniform(-1, 1, (N, 2)))
        seen += [observed, rewards, *(info["terminal_observation"] for info in more if info)]
        infos += more
    assert len(set(map(id, infos))) == len(infos)
    assert not any(np.shares_memory(a, b) for a, b in itertools.combinations(seen, 2))


def test_attributes_are_each_environments_own(envs: SB3VecEnv) -> None:
    """get_attr, set_attr and env_method by indices, as in stable-baselines3's own."""
    assert envs.get_attr("render_mode") == [None] * N and envs.has_attr("task") and not envs.has_attr("strokes")
    assert envs.env_is_wrapped(gym.Wrapper) == [False] * N
    envs.reset()
    states = envs.env_method("get_state")
    assert envs.env_method("get_state", indices=[2, 0]) == [states[2], states[0]]
    (outcome,) = envs.env_method("what_if", [[0.1, 0.0]] * 3, indices=1)
    assert outcome.position.shape == (3, 3)
    rng = np.random.Generator(np.random.PCG64(5))
    others = envs.get_attr("np_random")
    envs.set_attr("np_random", rng, indices=[1])
    assert envs.get_attr("np_random") == [others[0], rng, *others[2:]]
    with pytest.raises(ValueError, match="np_random: expected 4 different generators"):
        envs.set_attr("np_random", rng)
    with pytest.raises(AttributeError, match="make a new batch"):
        envs.set_attr("render_mode", "human", indices=[0])


def test_a_video_has_a_picture_of_each_step(gl: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """stable-baselines3's VecVideoRecorder, with a stand-in for moviepy, which encodes for it."""
    films: list[list[np.ndarray]] = []

    class Clip:
        def __init__(self, frames: list[np.ndarray], fps: int) -> None:
            films.append(frames)

        def write_videofile(self, path: str) -> None:
            Path(path).touch()

    for name in ("moviepy", "moviepy.video", "moviepy.video.io", "moviepy.video.io.ImageSequenceClip"):
        module = types.ModuleType(name)
        monkeypatch.setitem(sys.modules, name, module)
    module.ImageSequenceClip = Clip  # type: ignore[attr-defined]
    options = {"autoreset_mode": "SameStep", "render_mode": "rgb_array", "render_size": (32, 24)}
    envs = SB3VecEnv(gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=N, **options))
    video = VecVideoRecorder(VecMonitor(envs), str(tmp_path), lambda step: step == 0, video_length=2)
    video.reset()
    for _ in range(3):
        video.step(np.full((N, 2), [0.1, 0.0], dtype=np.float32))
    assert [frame.shape for frame in films[0]] == [(48, 64, 3)] * 3
    assert not np.array_equal(films[0][0], films[0][1]) and len(list(tmp_path.iterdir())) == 1
    video.close()


def test_another_reset_mode_is_refused() -> None:
    """NextStep would feed the learner transitions across episodes."""
    with pytest.raises(ValueError, match="SameStep"):
        SB3VecEnv(gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=2))
