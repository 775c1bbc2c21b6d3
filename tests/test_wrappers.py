"""RecordVideo: of every putt all pictures, one environment or many; Gymnasium's names and triggers."""

import copy
import math
import os
import pickle
import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from minigolf_env.rendering import PAUSE
from minigolf_env.wrappers import RecordVideo
from minigolf_env.wrappers.vector import RecordVideo as RecordVectorVideo
from tests.videos import decode

SIZE = (64, 48)
FPS = 5
LOOK: dict[str, Any] = {"render_size": SIZE, "camera": "top", "render_profile": "fast"}
PUTT = np.array([0.5, 0.1], np.float32)
WEAK = np.array([0.1, 0.0], np.float32)

pytestmark = pytest.mark.usefixtures("gl")


def make(render_mode: str | None = "rgb_array", **options: Any) -> Any:
    """Return an environment whose episodes are of two putts, where the first does not hole out."""
    return gym.make("MiniGolf-v0", render_mode=render_mode, max_strokes=2, tee="fixed", **LOOK, **options)


def make_many(n: int = 3, **options: Any) -> Any:
    """Return n such environments as one."""
    return gym.make_vec("MiniGolf-v0", num_envs=n, render_mode="rgb_array", max_strokes=2, **LOOK, **options)


def length(seconds: float) -> int:
    """Return the pictures of a putt."""
    return math.ceil((seconds + PAUSE) * FPS)


def always(n: int) -> bool:
    """Start a video every time."""
    return True


def never(n: int) -> bool:
    """Start none."""
    return False


def play(env: Any, putts: int) -> list[int]:
    """Play so many putts, with a reset before the first of each episode; return their pictures."""
    lengths, over = [], True
    for _ in range(putts):
        if over:
            env.reset(seed=0)
        *_, over, _, info = env.step(PUTT)
        lengths.append(length(info["shot_time"]))
    return lengths


def names(folder: Path) -> list[str]:
    """Return what is in a folder."""
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("mode", ["rgb_array", "rgb_array_list"])
def test_every_picture_of_every_putt(tmp_path: Path, mode: str) -> None:
    """An episode's video has the tee and all its putts; render() in between takes nothing from it."""
    env = RecordVideo(make(mode), tmp_path, always, fps=FPS)
    lengths = []
    for _ in range(2):
        env.reset(seed=0)
        for _ in range(2):
            lengths.append(length(env.step(PUTT)[-1]["shot_time"]))
            shown = env.render()
    env.close()
    assert names(tmp_path) == ["rl-video-episode-0.mp4", "rl-video-episode-1.mp4"]
    for k in range(2):
        video = decode(tmp_path / f"rl-video-episode-{k}.mp4", SIZE)
        assert len(video) == 1 + sum(lengths[2 * k : 2 * k + 2])
    last = shown[-1] if isinstance(shown, list) else shown
    assert np.abs(video[-1].astype(float) - last).mean() < 5.0


def test_default_schedule_is_gymnasiums(tmp_path: Path) -> None:
    """Cubes, then thousands."""
    from minigolf_env.wrappers.recorder import cubes

    assert [n for n in range(3001) if cubes(n)] == [k**3 for k in range(10)] + [1000, 2000, 3000]
    env = RecordVideo(make(), tmp_path, fps=1)
    play(env, 8)
    env.close()
    assert names(tmp_path) == ["rl-video-episode-0.mp4", "rl-video-episode-1.mp4"]


def test_step_trigger_and_video_length(tmp_path: Path) -> None:
    """A step is a putt, counted over episodes; a length counts pictures, and a video of one goes on over resets."""
    env = RecordVideo(make(), tmp_path, step_trigger=lambda k: k in (1, 5), name_prefix="a", fps=FPS)
    lengths = play(env, 6)
    env.close()
    assert names(tmp_path) == ["a-step-1.mp4", "a-step-5.mp4"]
    assert len(decode(tmp_path / "a-step-1.mp4", SIZE)) == lengths[1]
    assert len(decode(tmp_path / "a-step-5.mp4", SIZE)) == lengths[5]

    more = 1 + lengths[0] + lengths[1] + 1 + 3
    env = RecordVideo(make(), tmp_path, lambda k: k == 0, video_length=more, name_prefix="b", fps=FPS)
    play(env, 4)
    assert not env.recording
    env.close()
    assert len(decode(tmp_path / "b-episode-0.mp4", SIZE)) == more


def test_nothing_is_drawn_that_is_not_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor remembered: what was played is forgotten with the step."""
    env = RecordVideo(make(), tmp_path, never)
    monkeypatch.setattr("minigolf_env.rendering.offscreen.draw", None)
    play(env, 6)
    assert env._mirror._unseen == [] and names(tmp_path) == []


def test_recording_by_hand_and_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two recorders of one environment do not take each other's pictures."""
    env = RecordVideo(make(), tmp_path, never, name_prefix="inner", fps=FPS)
    outer = RecordVideo(env, tmp_path, always, name_prefix="outer", fps=2 * FPS, disable_logger=False)
    outer.reset(seed=0)
    env.start_recording("mine")
    info = outer.step(PUTT)[-1]
    env.stop_recording()
    outer.close()
    assert len(decode(tmp_path / "mine.mp4", SIZE)) == length(info["shot_time"])
    pictures = 1 + math.ceil((info["shot_time"] + PAUSE) * 2 * FPS)
    assert len(decode(tmp_path / "outer-episode-0.mp4", SIZE)) == pictures
    assert capsys.readouterr().err.strip() == f"{tmp_path / 'outer-episode-0.mp4'}: {pictures / 2 / FPS:.1f} s"


def test_render_modes_that_are_refused(tmp_path: Path) -> None:
    """At construction, with the remedy; so is another environment, and nothing is made."""
    folder = tmp_path / "videos"
    with pytest.raises(ValueError, match=r"received None; .*render_mode='rgb_array'"):
        RecordVideo(make(None), folder)
    with pytest.raises(ValueError, match=r"gymnasium\.wrappers\.RecordVideo"):
        RecordVideo(gym.make("CartPole-v1"), folder)  # type: ignore[arg-type]
    for length in (-1, 2.5):
        with pytest.raises(ValueError, match="video_length: expected an integer"):
            RecordVideo(make(), folder, video_length=length)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="fps"):
        RecordVideo(make(), folder, fps=0)
    many = gym.make_vec("MiniGolf-v0", 2, "sync", render_mode="rgb_array")
    with pytest.raises(ValueError, match="make_vec"):
        RecordVectorVideo(many, folder)
    many.close()
    with pytest.raises(ValueError, match="received None"):
        RecordVectorVideo(gym.make_vec("MiniGolf-v0", 2), folder)
    assert not folder.exists()


def test_old_videos_are_announced(tmp_path: Path) -> None:
    """Once the folder has videos of the same prefix."""
    (tmp_path / "rl-video-episode-0.mp4").touch()
    with pytest.warns(UserWarning, match="new ones replace"):
        RecordVideo(make(), tmp_path)
    RecordVideo(make(), tmp_path, name_prefix="other")


def test_copies_and_the_spec(tmp_path: Path) -> None:
    """A copy plays on and does not record; the spec makes the same wrapper again."""
    env = RecordVideo(make(), tmp_path, always, fps=FPS)
    env.reset(seed=0)
    for copied in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):  # noqa: S301 (its own)
        assert not copied.recording
        assert copied.step(PUTT)[1] == copy.deepcopy(env).step(PUTT)[1]
        copied.start_recording("copy")
        info = copied.step(PUTT)[-1]
        copied.close()
        assert len(decode(tmp_path / "copy.mp4", SIZE)) == length(info["shot_time"])
    env.close()
    assert len(decode(tmp_path / "rl-video-episode-0.mp4", SIZE)) == 1
    assert env.spec is not None
    assert env.spec.additional_wrappers[-1].name == "RecordVideo"
    with pytest.warns(UserWarning, match="new ones replace"):
        again = gym.make(env.spec)
    assert isinstance(again, RecordVideo)
    again.close()


def test_a_video_that_fails_is_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The step says why, and the environment can be played on."""
    env = RecordVideo(make(), tmp_path / "videos", step_trigger=lambda k: k == 0, fps=FPS)
    env.reset(seed=0)
    with monkeypatch.context() as patch:
        patch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nowhere"))
        with pytest.raises(OSError, match="does not start"):
            env.step(WEAK)
    assert not env.recording
    env.step(PUTT)
    env.close()
    assert names(tmp_path / "videos") == []


def test_forgotten_video_warns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An environment that is not closed loses its last video, and says so; a fork has none to lose."""
    env = RecordVideo(make(), tmp_path, always, fps=FPS)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match=r"lost: call close\(\)"):
        env._recorder.__del__()
    with monkeypatch.context() as fork, warnings.catch_warnings():
        fork.setattr(os, "getpid", lambda: -1)
        warnings.simplefilter("error")
        env._recorder.__del__()
    env.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_vector_videos(tmp_path: Path, mode: str) -> None:
    """A step is as long as its longest putt, in all autoreset modes; the last putt of an episode is seen."""
    env = RecordVectorVideo(make_many(autoreset_mode=mode), tmp_path, episode_trigger=always, fps=FPS)
    env.reset(seed=0)
    actions = np.stack([PUTT, WEAK, -PUTT])
    longest: list[int] = []
    for _ in range(5 if mode == "NextStep" else 4):
        *_, over, _, info = env.step(actions)
        times = info.get("final_info", info)["shot_time"]
        if times.any():
            longest.append(length(times.max()))
        if mode == "Disabled" and over.any():
            env.reset(options={"reset_mask": over})
    env.close()
    shape = (2 * SIZE[0], 2 * SIZE[1])
    assert len(decode(tmp_path / "rl-video-episode-0.mp4", shape)) == 1 + longest[0] + longest[1]
    assert len(decode(tmp_path / "rl-video-episode-1.mp4", shape)) == 1 + longest[2] + longest[3]


def test_shorter_putts_hold_their_last_picture(tmp_path: Path) -> None:
    """Tiles are in the order of the environments, the rest is black; the short putt's tile stays as it ended."""
    env = RecordVectorVideo(make_many(tee="fixed"), tmp_path, episode_trigger=always, fps=FPS)
    env.reset(seed=0)
    info = env.step(np.stack([PUTT, WEAK, PUTT]))[-1]
    short, long = length(info["shot_time"][1]), length(info["shot_time"][0])
    assert short < long - 5
    shown = env.render()
    env.close()
    video = decode(tmp_path / "rl-video-episode-0.mp4", (2 * SIZE[0], 2 * SIZE[1])).astype(float)
    assert len(video) == 1 + long
    left, right = video[:, :48, :64], video[:, :48, 64:]
    assert np.abs(np.diff(left[short + 2 : -5], axis=0)).max() > 20.0, "the long putt moves on"
    assert np.abs(right[-1] - right[short]).mean() < 1.0, "the short one is over"
    assert np.abs(video[-1, :48, 64:] - shown[1]).mean() < 5.0
    assert video[:, 50:, 68:].max() < 20.0


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_environments_that_are_reset_at_different_times(tmp_path: Path, mode: str) -> None:
    """Episodes are counted in the first environment, and the others' resets end no video."""
    env = RecordVectorVideo(make_many(2, autoreset_mode=mode), tmp_path, episode_trigger=always, fps=1)
    env.reset(seed=0)
    if mode == "Disabled":  # The second environment is one putt behind.
        env.step(np.stack([WEAK, WEAK]))
        env.reset(options={"reset_mask": np.array([False, True])})
        over = env.step(np.stack([WEAK, WEAK]))[2]
        assert over.tolist() == [True, False]
        env.reset(options={"reset_mask": over})
    else:
        golf: Any = env.unwrapped
        golf._strokes[1] = 1  # Its first putt is its last.
        for _ in range(3 if mode == "NextStep" else 2):
            env.step(np.stack([WEAK, WEAK]))
    env.close()
    assert names(tmp_path) == ["rl-video-episode-0.mp4", "rl-video-episode-1.mp4"]


def test_vector_options(tmp_path: Path) -> None:
    """The first environment alone, the shape of the whole, steps and lengths."""
    env = RecordVectorVideo(make_many(), tmp_path, (4, 1), step_trigger=lambda k: k == 1, video_length=4, fps=FPS)
    first = RecordVectorVideo(env, tmp_path, record_first_only=True, name_prefix="first", fps=FPS)
    first.reset(seed=0)
    for _ in range(2):
        info = first.step(np.stack([PUTT] * 3))[-1]
    first.close()
    assert decode(tmp_path / "rl-video-step-1.mp4", (3 * SIZE[0], SIZE[1])).shape[0] == 4
    assert len(decode(tmp_path / "first-episode-0.mp4", SIZE)) > length(info["shot_time"][0])
