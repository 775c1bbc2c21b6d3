"""RecordVideo records every frame of every putt, with Gymnasium's file names and triggers."""

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

from minigolf_env.rendering import PAUSE_AFTER_PUTT
from minigolf_env.wrappers import RecordVideo
from minigolf_env.wrappers.record_video import capped_cubic_schedule
from tests.videos import decode

SIZE = (64, 48)
FPS = 5
PUTT = np.array([0.5, 0.1], np.float32)
WEAK_PUTT = np.array([0.1, 0.0], np.float32)

pytestmark = pytest.mark.usefixtures("gl")


def make(render_mode: str | None = "rgb_array", **options: Any) -> Any:
    """Return an environment whose episodes have two putts, the first of which does not hole out."""
    look: dict[str, Any] = {"render_size": SIZE, "camera": "top", "render_profile": "fast"}
    return gym.make("MiniGolf-v0", render_mode=render_mode, max_strokes=2, tee="fixed", **look, **options)


def num_frames(shot_time: float) -> int:
    """Return the number of frames of a putt."""
    return math.ceil((shot_time + PAUSE_AFTER_PUTT) * FPS)


def always(n: int) -> bool:
    """Start a video every time."""
    return True


def never(n: int) -> bool:
    """Start no video."""
    return False


def play(env: Any, num_putts: int) -> list[int]:
    """Play some putts, with a reset before each episode; return the number of frames of each."""
    lengths = []
    is_over = True
    for _ in range(num_putts):
        if is_over:
            env.reset(seed=0)
        *_, is_over, _, info = env.step(PUTT)
        lengths.append(num_frames(info["shot_time"]))
    return lengths


def file_names(folder: Path) -> list[str]:
    """Return the names of the files in a folder, sorted."""
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("mode", ["rgb_array", "rgb_array_list"])
def test_video_has_every_frame_of_every_putt(tmp_path: Path, mode: str) -> None:
    """An episode's video has the tee and all its putts; calls of render() in between take no frame from it."""
    env = RecordVideo(make(mode), tmp_path, always, fps=FPS)
    lengths = []
    for _ in range(2):
        env.reset(seed=0)
        for _ in range(2):
            lengths.append(num_frames(env.step(PUTT)[-1]["shot_time"]))
            rendered = env.render()
    env.close()
    assert file_names(tmp_path) == ["rl-video-episode-0.mp4", "rl-video-episode-1.mp4"]
    for k in range(2):
        video = decode(tmp_path / f"rl-video-episode-{k}.mp4", SIZE)
        assert len(video) == 1 + sum(lengths[2 * k : 2 * k + 2])
    last = rendered[-1] if isinstance(rendered, list) else rendered
    assert np.abs(video[-1].astype(float) - last).mean() < 5.0


def test_default_schedule_is_gymnasiums(tmp_path: Path) -> None:
    """Episodes that are cubes are recorded, and from 1,000 on every thousandth."""
    recorded = [n for n in range(3001) if capped_cubic_schedule(n)]
    assert recorded == [k**3 for k in range(10)] + [1000, 2000, 3000]
    env = RecordVideo(make(), tmp_path, fps=1)
    play(env, 8)
    env.close()
    assert file_names(tmp_path) == ["rl-video-episode-0.mp4", "rl-video-episode-1.mp4"]


def test_step_trigger_counts_putts_and_video_length_counts_frames(tmp_path: Path) -> None:
    """Steps are counted over episodes; a video with a length continues over resets."""
    env = RecordVideo(make(), tmp_path, step_trigger=lambda k: k in (1, 5), name_prefix="a", fps=FPS)
    lengths = play(env, 6)
    env.close()
    assert file_names(tmp_path) == ["a-step-1.mp4", "a-step-5.mp4"]
    assert len(decode(tmp_path / "a-step-1.mp4", SIZE)) == lengths[1]
    assert len(decode(tmp_path / "a-step-5.mp4", SIZE)) == lengths[5]

    length = 1 + lengths[0] + lengths[1] + 1 + 3
    env = RecordVideo(make(), tmp_path, lambda k: k == 0, video_length=length, name_prefix="b", fps=FPS)
    play(env, 4)
    assert not env.recording
    env.close()
    assert len(decode(tmp_path / "b-episode-0.mp4", SIZE)) == length


def test_steps_without_recording_draw_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor do their putts stay in memory."""
    env = RecordVideo(make(), tmp_path, never)
    monkeypatch.setattr("minigolf_env.rendering.gl.offscreen.draw", None)
    play(env, 6)
    assert env._renderer._pending == [] and file_names(tmp_path) == []


def test_two_recorders_of_one_environment_are_independent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither takes frames from the other; one records by hand, one prints the path of its video."""
    env = RecordVideo(make(), tmp_path, never, name_prefix="inner", fps=FPS)
    outer = RecordVideo(env, tmp_path, always, name_prefix="outer", fps=2 * FPS, disable_logger=False)
    outer.reset(seed=0)
    env.start_recording("mine")
    info = outer.step(PUTT)[-1]
    env.stop_recording()
    outer.close()
    assert len(decode(tmp_path / "mine.mp4", SIZE)) == num_frames(info["shot_time"])
    outer_length = 1 + math.ceil((info["shot_time"] + PAUSE_AFTER_PUTT) * 2 * FPS)
    assert len(decode(tmp_path / "outer-episode-0.mp4", SIZE)) == outer_length
    assert capsys.readouterr().err.strip() == f"{tmp_path / 'outer-episode-0.mp4'}: {outer_length / 2 / FPS:.1f} s"


def test_rejects_invalid_arguments_before_creating_the_folder(tmp_path: Path) -> None:
    """The message says what to do about a render mode without images and about another environment."""
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
    assert not folder.exists()


@pytest.mark.parametrize("name", ["../up", "/up", "sub/up", "up/", "zero\0byte", None])
def test_videos_stay_in_their_folder(tmp_path: Path, name: Any) -> None:
    """Names with folders are refused, before anything is made and in the middle of a recording, which continues."""
    folder = tmp_path / "videos"
    with pytest.raises(ValueError, match="name_prefix: expected the beginning of a file's name, without folders"):
        RecordVideo(make(), folder, name_prefix=name)
    assert not folder.exists()
    env = RecordVideo(make(), folder, always, fps=1)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="video_name: expected"):
        env.start_recording(name)
    env.close()
    assert file_names(tmp_path) == ["videos"] and file_names(folder) == ["rl-video-episode-0.mp4"]


@pytest.mark.parametrize("folder", ["file", "file/below", "loop", "zero\0byte", "n" * 300, "/dev/null", "/proc/videos"])
def test_folder_that_cannot_be_written_is_an_error(tmp_path: Path, folder: str) -> None:
    """One line names the argument and says what to do."""
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(OSError, match=r"^video_folder: .*; choose another( folder)?\.$"):
        RecordVideo(make(), tmp_path / folder)
    assert file_names(tmp_path) == ["file", "loop"]


def test_warns_about_videos_that_it_will_replace(tmp_path: Path) -> None:
    """Only videos with the same prefix count."""
    (tmp_path / "rl-video-episode-0.mp4").touch()
    with pytest.warns(UserWarning, match="new ones replace"):
        RecordVideo(make(), tmp_path)
    RecordVideo(make(), tmp_path, name_prefix="other")


def test_copy_plays_on_without_recording_and_spec_remakes_the_wrapper(tmp_path: Path) -> None:
    """A copy can start a separate video; that of the original is not disturbed."""
    env = RecordVideo(make(), tmp_path, always, fps=FPS)
    env.reset(seed=0)
    for copied in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):  # noqa: S301 (its own)
        assert not copied.recording
        assert copied.step(PUTT)[1] == copy.deepcopy(env).step(PUTT)[1]
        copied.start_recording("copy")
        info = copied.step(PUTT)[-1]
        copied.close()
        assert len(decode(tmp_path / "copy.mp4", SIZE)) == num_frames(info["shot_time"])
    env.close()
    assert len(decode(tmp_path / "rl-video-episode-0.mp4", SIZE)) == 1
    assert env.spec is not None
    assert env.spec.additional_wrappers[-1].name == "RecordVideo"
    with pytest.warns(UserWarning, match="new ones replace"):
        remade = gym.make(env.spec)
    assert isinstance(remade, RecordVideo)
    remade.close()


def test_failed_video_ends_and_the_environment_plays_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The step raises the reason."""
    env = RecordVideo(make(), tmp_path / "videos", step_trigger=lambda k: k == 0, fps=FPS)
    env.reset(seed=0)
    with monkeypatch.context() as patch:
        patch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nowhere"))
        with pytest.raises(OSError, match="does not start"):
            env.step(WEAK_PUTT)
    assert not env.recording
    env.step(PUTT)
    env.close()
    assert file_names(tmp_path / "videos") == []


def test_warns_about_a_video_that_was_not_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An environment without close() loses its last video; a fork loses none, as its parent writes it."""
    env = RecordVideo(make(), tmp_path, always, fps=FPS)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match=r"lost: call close\(\)"):
        env.__del__()
    with monkeypatch.context() as fork, warnings.catch_warnings():
        fork.setattr(os, "getpid", lambda: -1)
        warnings.simplefilter("error")
        env.__del__()
    env.close()
