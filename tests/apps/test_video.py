"""Videos: every frame is in the file, which is written atomically; an invalid argument is one line of output."""

import math
import subprocess
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env import cli
from minigolf_env.apps.record_policy import record_policy
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.players.policies import RandomPolicy
from minigolf_env.rendering import PAUSE_AFTER_PUTT, RenderingError
from minigolf_env.rendering.video_writer import VideoWriter
from tests.videos import decode

SIZE = (64, 48)
FPS = 5
SMALL: dict[str, Any] = {"size": SIZE, "fps": FPS, "profile": "fast"}


def make_frames(n: int, size: tuple[int, int] = SIZE) -> NDArray[np.uint8]:
    """Return n frames (n, height, width, 3) in which a bright bar moves over a colour gradient."""
    width, height = size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    gradient = np.stack([255 * x / width, 255 * y / height, np.full(x.shape, 90.0)], axis=-1).astype(np.uint8)
    shown = np.repeat(gradient[None], n, axis=0)
    for k in range(n):
        shown[k, :, k % width : k % width + 6] = 240
    return shown


def write(path: Path, n: int = 7, size: tuple[int, int] = SIZE) -> None:
    """Write a video of n frames."""
    with VideoWriter(path, size, FPS) as writer:
        for frame in make_frames(n, size):
            writer.add(frame)


@pytest.fixture
def broken_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace ffmpeg by a program that reads all its input and then reports a full disk."""
    script = tmp_path / "ffmpeg"
    script.write_text("#!/bin/sh\ncat > /dev/null\necho 'av_write: No space left on device' >&2\nexit 28\n")
    script.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(script))


@pytest.mark.parametrize("ending", [".mp4", ".gif", ".MP4"])
def test_video_has_every_frame(tmp_path: Path, ending: str) -> None:
    """The decoded frames are close to the original ones."""
    path = tmp_path / f"a{ending}"
    write(path)
    shown = decode(path, SIZE).astype(float)
    assert len(shown) == 7
    assert np.abs(shown - make_frames(7)).mean() < 8.0


def test_mp4_plays_in_browsers(tmp_path: Path) -> None:
    """H.264 in yuv420p, sides made even by repeating the last line, named colour space, index at the beginning."""
    path = tmp_path / "odd.mp4"
    write(path, size=(63, 47))
    shown = decode(path, (64, 48)).astype(float)
    assert np.abs(shown[:, :, 63] - shown[:, :, 62]).mean() < 3.0
    output = subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-i", path], capture_output=True, text=True).stderr
    assert "h264 (High)" in output and "yuv420p(tv, bt709, progressive)" in output
    raw = path.read_bytes()
    assert 0 <= raw.find(b"moov") < raw.find(b"mdat")


def test_writer_keeps_no_frames_in_memory(tmp_path: Path) -> None:
    """Its memory does not grow with the length of the video."""
    with VideoWriter(tmp_path / "long.mp4", (320, 240), 30) as writer:
        frame = np.zeros((240, 320, 3), np.uint8)
        tracemalloc.start()
        for k in range(300):
            writer.add(frame + np.uint8(k % 250))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 4 * frame.nbytes


@pytest.mark.parametrize("ending", [".mp4", ".gif"])
@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_interrupted_video_leaves_the_earlier_file(tmp_path: Path, ending: str, error: type[BaseException]) -> None:
    """The folder has nothing but the earlier file of the same name; the writer is closed."""
    path = tmp_path / f"a{ending}"
    path.write_bytes(b"before")
    with pytest.raises(error), VideoWriter(path, SIZE, FPS) as writer:
        writer.add(make_frames(1)[0])
        raise error
    assert list(tmp_path.iterdir()) == [path] and path.read_bytes() == b"before"
    with pytest.raises(ValueError, match="closed"):
        writer.add(make_frames(1)[0])


def test_garbage_collected_writer_leaves_no_file(tmp_path: Path) -> None:
    """A writer that was not closed is discarded with its last reference."""
    writer = VideoWriter(tmp_path / "a.mp4", SIZE, FPS)
    writer.add(make_frames(1)[0])
    del writer
    assert list(tmp_path.iterdir()) == []


FORK = """
import gc, os, pathlib, select, sys
import numpy as np
from minigolf_env.rendering.video_writer import VideoWriter
path, frame = pathlib.Path(sys.argv[1]), np.zeros((16, 16, 3), np.uint8)
writer = VideoWriter(path, (16, 16), 5)
writer.add(frame)
def files(): return {file: file.stat().st_ino for file in path.parent.iterdir()}
before = files()
held = [file.open() for file in before]  # Open, so that no other file gets their inodes.
read, write = os.pipe()
child = os.fork()
if child == 0: CHILD
"""
WAIT = "assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0\n"
UNTOUCHED = "assert files() == before\n"
FINISH = "writer.add(frame), writer.close(), os.write(write, b'.')\n"


@pytest.mark.parametrize("child", ["sys.exit()", "del writer; gc.collect(); os._exit(0)", "writer.close(); sys.exit()"])
def test_parent_continues_its_video_when_a_fork_exits(tmp_path: Path, child: str) -> None:
    """In all ways to exit; no frame is written twice."""
    path = tmp_path / "a.mp4"
    code = FORK.replace("CHILD", child) + WAIT + UNTOUCHED + FINISH
    subprocess.run([sys.executable, "-c", code, path], check=True)
    assert len(decode(path, (16, 16))) == 2


def test_parent_finishes_its_video_while_a_fork_lives(tmp_path: Path) -> None:
    """The fork waits for the parent to finish its video, for at most a minute."""
    path = tmp_path / "a.mp4"
    code = FORK.replace("CHILD", "sys.exit(not select.select([read], [], [], 60.0)[0])") + FINISH + WAIT
    subprocess.run([sys.executable, "-c", code, path], check=True)
    assert len(decode(path, (16, 16))) == 2


def test_close_replaces_the_earlier_file(tmp_path: Path) -> None:
    """Until then the earlier file stays; closing twice is harmless; permissions are those of a new file."""
    path = tmp_path / "a.mp4"
    path.write_bytes(b"before")
    writer = VideoWriter(path, SIZE, FPS)
    writer.add(make_frames(1)[0])
    assert path.read_bytes() == b"before"
    writer.close()
    writer.close()
    assert len(decode(path, SIZE)) == 1
    assert path.stat().st_mode & 0o777 == 0o666 & ~_umask(tmp_path)


def _umask(folder: Path) -> int:
    """Return the permissions that new files in a folder lack."""
    (folder / "new").touch()
    return 0o666 & ~(folder / "new").stat().st_mode


@pytest.mark.parametrize(
    ("name", "size", "fps", "message"),
    [
        ("a.avi", SIZE, FPS, "'.mp4', '.gif'"),
        ("a.mp", SIZE, FPS, "did you mean '.mp4'"),
        ("a", SIZE, FPS, "the suffix"),
        ("file/a.mp4", SIZE, FPS, "is not a folder; choose another folder"),
        ("folder.mp4", SIZE, FPS, "something else of that name"),
        ("a.mp4", (0, 48), FPS, "width and height"),
        ("a.mp4", (64,), FPS, "width and height"),
        ("a.mp4", SIZE, 0, "fps: expected an integer"),
        ("a.mp4", SIZE, 29.97, "fps: expected an integer from 1 to .*, received 29.97; 30 is usual"),
        ("a.gif", SIZE, 60, "fps of a .gif: .* to 50"),
    ],
)
def test_rejects_invalid_arguments(tmp_path: Path, name: str, size: Any, fps: Any, message: str) -> None:
    """The message names the argument, and nothing is written."""
    (tmp_path / "folder.mp4").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises((ValueError, OSError), match=message):
        VideoWriter(tmp_path / name, size, fps)
    assert {path.name for path in tmp_path.iterdir()} == {"file", "folder.mp4"}


@pytest.mark.parametrize("shape", [(47, 64, 3), (48, 64), (48, 64, 4)])
def test_rejects_frames_of_another_shape_and_empty_videos(tmp_path: Path, shape: tuple[int, ...]) -> None:
    """Nothing is written."""
    with (
        pytest.raises(ValueError, match="frame: expected uint8 of shape"),
        VideoWriter(tmp_path / "a.mp4", SIZE, 5) as w,
    ):
        w.add(np.zeros(shape, np.uint8))
    with pytest.raises(ValueError, match="at least one frame"), VideoWriter(tmp_path / "a.mp4", SIZE, FPS):
        pass
    assert list(tmp_path.iterdir()) == []


def test_message_about_a_failed_ffmpeg_has_its_reason(tmp_path: Path, broken_ffmpeg: None) -> None:
    """The message has the last line of ffmpeg's output and a remedy; no file remains."""
    with pytest.raises(OSError, match=r"exit code 28.*No space left on device; free space"):
        write(tmp_path / "a.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


def test_ffmpeg_that_exits_at_once_raises_an_oserror(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A broken pipe becomes the same kind of error as a failed ffmpeg."""
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/bin/false")
    with pytest.raises(OSError, match=r"ffmpeg failed \(exit code 1\): no message"):
        write(tmp_path / "a.mp4", 100)
    assert list(tmp_path.iterdir()) == []


def test_message_about_a_missing_ffmpeg_has_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The message says how to install one."""
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nowhere"))
    with pytest.raises(OSError, match=r"does not start.*pip install"):
        write(tmp_path / "a.mp4")

    def missing() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    with pytest.raises(OSError, match=r"there is none for this system; pip install"):
        write(tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("game", [{"course": "dogleg"}, {"course": "procedural", "difficulty": "medium"}])
def test_recording_has_every_putt_of_the_policy(
    tmp_path: Path, gl: None, capsys: pytest.CaptureFixture[str], game: dict[str, str]
) -> None:
    """There is one frame of the tee and fps per second of each putt; the last has the ball at rest."""
    path = tmp_path / "a.mp4"
    record_policy(path, policy="random", seed=3, camera="top", episodes=2, **game, **SMALL)
    player, total, strokes = RandomPolicy(3), 0, []
    for seed in (3, 4):
        env = MiniGolfEnv(render_mode="rgb_array", render_size=SIZE, camera="top", render_profile="fast", **game)
        observation, info = env.reset(seed=seed)
        over, total = False, total + 1
        while not over:
            observation, _, over, _, info = env.step(player.act(observation, env))
            total += math.ceil((info["shot_time"] + PAUSE_AFTER_PUTT) * FPS)
        strokes.append(f"{info['strokes']}" + ("" if info["is_success"] else " (not holed)"))
    shown = decode(path, SIZE)
    assert len(shown) == total
    assert np.abs(shown[-1].astype(float) - env.render()).mean() < 5.0
    line = capsys.readouterr().out
    assert line.startswith(f"{path}: {total / FPS:.1f} s of 64 x 48, ")
    assert f"strokes: {', '.join(strokes)};" in line and line.count("\n") == 1


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        ({"policy": "serch"}, "did you mean 'search'"),
        ({"policy": "none.zip"}, "none at none.zip"),
        ({"course": "doglegg"}, "did you mean 'dogleg'"),
        ({"course": "room"}, "a cup"),
        ({"difficulty": "easy"}, "difficulty: expected with course='procedural'"),
        ({"course": "procedural", "difficulty": "medum"}, "did you mean 'medium'"),
        ({"camera": "tpo"}, "did you mean 'top'"),
        ({"profile": "hig"}, "did you mean 'high'"),
        ({"size": (0, 48)}, "size: expected width and height"),
        ({"fps": 0}, "fps: expected"),
        ({"episodes": 0}, "episodes: expected"),
        ({"seed": -1}, "seed: expected"),
        ({"output": "a.mpeg"}, "did you mean '.mp4'"),
    ],
)
def test_recording_validates_its_arguments_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mistake: dict[str, Any], message: str
) -> None:
    """An invalid argument is reported before a world is built or a file is created."""

    def build(*args: object, **options: object) -> None:
        raise AssertionError("the world was built before the arguments were checked")

    monkeypatch.setattr("minigolf_env.courses.Course.world", build)
    monkeypatch.chdir(tmp_path)
    arguments = {"output": "a.mp4", "course": "dogleg", **SMALL, **mistake}
    with pytest.raises((ValueError, OSError), match=message):
        record_policy(**arguments)
    assert list(tmp_path.iterdir()) == []


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    """Return the exit code of the command line."""
    monkeypatch.setattr(sys, "argv", ["minigolf", "video", *words])
    try:
        cli.main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_command_line_exit_codes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], gl: None
) -> None:
    """The exit code is 0 with a file, 1 for an invalid argument, 2 for an unknown option or without OpenGL."""
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, "-o", "a.gif", "--size", "64", "48", "--fps", "5", "--profile", "fast") == 0
    assert len(decode(tmp_path / "a.gif", SIZE)) > 5
    assert run(monkeypatch, "-o", "a.gif", "--policy", "serch") == 1
    message = capsys.readouterr().err.splitlines()[-1]
    assert message.startswith("minigolf: policy") and message.endswith("did you mean 'search'?")
    assert run(monkeypatch, "-o", "a.gif", "--polcy", "search") == 2

    def no_opengl(*args: object, **options: object) -> None:
        raise RenderingError("there is no OpenGL here.")

    monkeypatch.setattr("minigolf_env.apps.record_policy.record_policy", no_opengl)
    assert run(monkeypatch, "-o", "a.gif") == 2


def test_invalid_argument_prints_one_line_and_no_traceback(tmp_path: Path) -> None:
    """The line goes to stderr of the process."""
    command = [sys.executable, "-m", "minigolf_env.cli", "video", "-o", str(tmp_path / "a.mpeg")]
    end = subprocess.run(command, capture_output=True, text=True)
    assert (end.returncode, end.stdout, end.stderr.count("\n")) == (1, "", 1)
    assert "did you mean '.mp4'?" in end.stderr
