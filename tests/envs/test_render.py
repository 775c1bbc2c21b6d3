"""Render modes and image observations of the environments."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

import minigolf_env  # noqa: F401 (registers the environments)
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.observations.pixels import IMAGE_SIZE
from minigolf_env.rendering import RENDER_FPS, RenderingError

pytestmark = pytest.mark.usefixtures("gl")

SMALL: dict[str, Any] = {"render_size": (64, 48), "render_profile": "fast"}
GENTLE_PUTT = np.array([0.3, 0.1], np.float32)


def num_frames(shot_time: float) -> int:
    """Return the number of frames of a putt, with the pause after it."""
    return int(np.ceil((shot_time + 0.6) * RENDER_FPS))


@pytest.mark.parametrize("camera", ["follow", "top", "tee", "orbit"])
def test_rgb_array_shows_the_present_state(camera: str) -> None:
    """(H, W, 3) uint8; a new array each time, equal until something happens, different after a putt."""
    env = MiniGolfEnv(render_mode="rgb_array", camera=camera, **SMALL)
    env.reset(seed=0)
    first, again = env.render(), env.render()
    assert first.shape == (48, 64, 3) and first.dtype == np.uint8
    assert first is not again and (first == again).all()
    env.step(GENTLE_PUTT)
    assert (env.render() != first).any()


def test_rgb_array_list_holds_all_frames_since_the_last_call() -> None:
    """The list has a frame of the tee, then RENDER_FPS a second of each putt; after the call it is empty."""
    env = MiniGolfEnv(render_mode="rgb_array_list", **SMALL)
    env.reset(seed=0)
    assert len(env.render()) == 1 and env.render() == []
    times = [env.step(GENTLE_PUTT)[4]["shot_time"] for _ in range(2)]
    frames = env.render()
    assert len(frames) == sum(map(num_frames, times))
    assert all(frame.shape == (48, 64, 3) for frame in frames)
    env.step(GENTLE_PUTT)
    env.reset(seed=1)
    assert len(env.render()) == 1


def test_frames_do_not_depend_on_how_often_render_is_called() -> None:
    """Frames of several calls are those of one."""
    one, many = (MiniGolfEnv(render_mode="rgb_array_list", **SMALL) for _ in range(2))
    one.reset(seed=3), many.reset(seed=3)
    pieces = many.render()
    for _ in range(3):
        one.step(GENTLE_PUTT), many.step(GENTLE_PUTT)
        pieces += many.render()
    np.testing.assert_array_equal(one.render(), pieces)


def test_rendering_changes_no_result() -> None:
    """An environment that is rendered gives the same results as one that is not."""
    plain, shown = (
        MiniGolfEnv(putt_noise=(1.0, 0.05)),
        MiniGolfEnv(putt_noise=(1.0, 0.05), render_mode="rgb_array", **SMALL),
    )
    np.testing.assert_array_equal(plain.reset(seed=2)[0], shown.reset(seed=2)[0])
    for _ in range(3):
        a, b = plain.step(GENTLE_PUTT), shown.step(GENTLE_PUTT)
        np.testing.assert_array_equal(a[0], b[0])
        assert a[1:] == b[1:]
        shown.render()


def test_without_render_mode_render_returns_none_and_keeps_nothing() -> None:
    """Without a render mode no path is computed."""
    env = MiniGolfEnv()
    env.reset(seed=0)
    env.step(GENTLE_PUTT)
    assert env.render() is None
    assert env.renderer._pending == []


def test_render_before_reset_asks_for_reset() -> None:
    """Before the first reset there is no ball to render."""
    for env in (MiniGolfEnv(render_mode="rgb_array"), MiniGolfVectorEnv(2, render_mode="rgb_array")):
        with pytest.raises(ResetNeeded):
            env.render()


def test_render_works_after_close() -> None:
    """An environment owns no OpenGL object that closing would release."""
    env = MiniGolfEnv(render_mode="rgb_array", **SMALL)
    env.reset(seed=0)
    before = env.render()
    env.close(), env.close()
    np.testing.assert_array_equal(env.render(), before)


def test_copies_render_the_same_frames() -> None:
    """Copies include the frames that were not rendered yet."""
    env = MiniGolfEnv(render_mode="rgb_array_list", **SMALL)
    env.reset(seed=0)
    env.step(GENTLE_PUTT)
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]  # noqa: S301 (our own)
    frames = env.render()
    for other in copies:
        np.testing.assert_array_equal(other.render(), frames)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"render_mode": "rgb_aray"}, "render_mode.*did you mean 'rgb_array'"),
        ({"camera": "folow"}, "camera.*did you mean 'follow'"),
        ({"render_profile": "hi"}, "render_profile.*did you mean 'high'"),
        ({"render_size": (0, 48)}, "render_size.*at least 1"),
        ({"render_size": (64.5, 48)}, "render_size"),
        ({"render_size": (64, 48, 3)}, "render_size"),
        ({"render_size": 64}, "render_size"),
        ({"render_speed": 0}, "render_speed"),
        ({"observation": "pixel"}, "observation.*did you mean 'pixels'"),
    ],
)
def test_render_argument_error_names_the_argument(options: dict[str, Any], words: str) -> None:
    """A wrong render argument raises a ValueError in both environments."""
    for make in (MiniGolfEnv, lambda **kw: MiniGolfVectorEnv(2, **kw)):
        with pytest.raises(ValueError, match=words):
            make(**options)


def test_human_without_a_display_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """The display is opened when something is to be shown."""
    monkeypatch.delenv("DISPLAY", raising=False)
    env = MiniGolfEnv(render_mode="human")
    with pytest.raises(RenderingError, match=r"display.*xvfb.*rgb_array"):
        env.reset(seed=0)


@pytest.mark.parametrize("mode", ["rgb_array", "rgb_array_list"])
def test_batch_renders_what_single_environments_do(mode: str) -> None:
    """A tuple with one entry for each environment, over two steps."""
    batch = MiniGolfVectorEnv(3, render_mode=mode, **SMALL)
    singles = [MiniGolfEnv(render_mode=mode, **SMALL) for _ in range(3)]
    batch.reset(seed=5)
    for i, single in enumerate(singles):
        single.reset(seed=5 + i)
    actions = np.array([[0.2, 0.1], [0.4, -0.3], [0.1, 0.0]], np.float32)
    for _ in range(2):
        shown = batch.render()
        assert isinstance(shown, tuple) and len(shown) == 3
        for one, single in zip(shown, singles, strict=True):
            np.testing.assert_array_equal(one, single.render())
        batch.step(actions)
        for action, single in zip(actions, singles, strict=True):
            single.step(action)


def test_batch_without_render_mode_renders_nothing() -> None:
    """Without a render mode, render() of a batch returns None."""
    batch = MiniGolfVectorEnv(2)
    batch.reset(seed=0)
    assert batch.render() is None


def test_last_putt_is_rendered_after_autoreset() -> None:
    """SameStep resets before render() can be called."""
    batch = MiniGolfVectorEnv(1, render_mode="rgb_array_list", autoreset_mode="SameStep", max_strokes=1, **SMALL)
    batch.reset(seed=0)
    batch.render()
    for _ in range(3):
        info = batch.step(GENTLE_PUTT[None])[4]
        (frames,) = batch.render() or ((),)
        assert len(frames) == num_frames(info["final_info"]["shot_time"][0]) + 1


def test_putt_is_rendered_on_its_hole_if_earlier_ones_were_not() -> None:
    """Its frames are the same whether the holes before it were rendered or not."""
    options: dict[str, Any] = {"render_mode": "rgb_array_list", "autoreset_mode": "SameStep", "max_strokes": 1}
    often, once = (MiniGolfVectorEnv(1, "round", **options, **SMALL) for _ in range(2))
    often.reset(seed=0)
    once.reset(seed=0)
    for _ in range(3):
        often.render()
        often.step(GENTLE_PUTT[None])
        once.step(GENTLE_PUTT[None])
    np.testing.assert_array_equal(often.render(), once.render())


def test_pixels_show_ball_cup_and_strokes_left() -> None:
    """The image changes where the ball moves; its bar is as long as the strokes left."""
    env = MiniGolfEnv(observation="pixels", max_strokes=4)
    first, _ = env.reset(seed=0)
    assert env.observation_space.contains(first) and first.shape == (IMAGE_SIZE, IMAGE_SIZE, 3)
    second = env.step(GENTLE_PUTT)[0]
    assert (first[-1] == 255).all() and (second[-1, :, 0] == 255).sum() == 0.75 * IMAGE_SIZE
    moved = np.argwhere((first[:-2] != second[:-2]).any(axis=2))
    assert 8 < len(moved) < 0.1 * IMAGE_SIZE * IMAGE_SIZE


def test_batch_pixels_equal_single_environments_bitwise() -> None:
    """Pixels of environment i are those of a single environment, through an automatic reset."""
    batch = MiniGolfVectorEnv(4, observation="pixels", max_strokes=2)
    seen: list[NDArray[Any]] = [batch.reset(seed=7)[0]]
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (3, 4, 2)).astype(np.float32)
    seen += [batch.step(putts)[0] for putts in actions]
    for i in range(4):
        single = MiniGolfEnv(observation="pixels", max_strokes=2)
        observation, _ = single.reset(seed=7 + i)
        over = False
        for k in range(4):
            np.testing.assert_array_equal(seen[k][i], observation)
            if k < 3:
                observation, _, ended, _, _ = single.step(actions[k, i]) if not over else (*single.reset(), False, 0, 0)
                over = bool(ended)


def test_checkers_accept_pixels() -> None:
    """Gymnasium's and stable-baselines3's, without windows: there is no display here."""
    check_env(gym.make("MiniGolf-v0", observation="pixels").unwrapped, skip_render_check=True)
    pytest.importorskip("stable_baselines3.common.env_checker").check_env(gym.make("MiniGolf-v0", observation="pixels"))
