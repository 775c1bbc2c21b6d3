"""stable-baselines3's view of the native batch."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecMonitor

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


def test_attributes_and_monitoring(envs: SB3VecEnv) -> None:
    """Attributes come once for each environment; VecMonitor counts strokes as the episode's length."""
    assert envs.get_attr("render_mode") == [None] * N
    assert envs.env_is_wrapped(gym.Wrapper) == [False] * N
    with pytest.raises(ValueError, match="share"):
        envs.set_attr("render_mode", "human", indices=[0])
    monitored = VecMonitor(envs)
    monitored.reset()
    for _ in range(STROKES):
        *_, dones, infos = monitored.step(np.full((N, 2), [-0.01, 0.0], dtype=np.float32))
    assert dones.all() and [info["episode"]["l"] for info in infos] == [STROKES] * N


def test_another_reset_mode_is_refused() -> None:
    """NextStep would feed the learner transitions across episodes."""
    with pytest.raises(ValueError, match="SameStep"):
        SB3VecEnv(gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=2))
