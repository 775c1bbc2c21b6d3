"""The video writer: all frames are in the file, and the file is written atomically."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.rendering.video_writer import VideoWriter
from tests.cost import measure_memory
from tests.videos import decode

SIZE = (64, 48)
FPS = 5


def make_frames(n: int, size: tuple[int, int] = SIZE) -> NDArray[np.uint8]:
    """Return n frames (n, height, width, 3) in which a bright bar moves over a color gradient."""
    width, height = size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    gradient = np.stack([255 * x / width, 255 * y / height, np.full(x.shape, 90.0)], axis=-1).astype(np.uint8)
    frames = np.repeat(gradient[None], n, axis=0)
    for k in range(n):
        frames[k, :, k % width : k % width + 6] = 240
    return frames


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
def test_file_contains_every_frame(tmp_path: Path, ending: str) -> None:
    """The decoded frames are as many as were added, and look the same."""
    path = tmp_path / f"a{ending}"
    write(path)
    decoded = decode(path, SIZE).astype(float)
    assert len(decoded) == 7
    assert np.abs(decoded - make_frames(7)).mean() < 8.0


def test_mp4_plays_in_browsers(tmp_path: Path) -> None:
    """H.264 in yuv420p, even sides by a copy of the last line, a named color space, and the index at the front."""
    path = tmp_path / "odd.mp4"
    write(path, size=(63, 47))
    decoded = decode(path, (64, 48)).astype(float)
    assert np.abs(decoded[:, :, 63] - decoded[:, :, 62]).mean() < 3.0
    report = subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-i", path], capture_output=True, text=True).stderr
    assert "h264 (High)" in report and "yuv420p(tv, bt709, progressive)" in report
    raw = path.read_bytes()
    assert 0 <= raw.find(b"moov") < raw.find(b"mdat")


def test_writer_keeps_no_frames_in_memory(tmp_path: Path) -> None:
    """Memory does not grow with the length of the video."""
    with VideoWriter(tmp_path / "long.mp4", (320, 240), 30) as writer:
        frame = np.zeros((240, 320, 3), np.uint8)
        with measure_memory() as memory:
            for k in range(300):
                writer.add(frame + np.uint8(k % 250))
    assert memory.peak < 4 * frame.nbytes


@pytest.mark.parametrize("ending", [".mp4", ".gif"])
@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_interrupted_video_leaves_no_trace(tmp_path: Path, ending: str, error: type[BaseException]) -> None:
    """Only the file that was there before remains in the folder."""
    path = tmp_path / f"a{ending}"
    path.write_bytes(b"before")
    with pytest.raises(error), VideoWriter(path, SIZE, FPS) as writer:
        writer.add(make_frames(1)[0])
        raise error
    assert list(tmp_path.iterdir()) == [path] and path.read_bytes() == b"before"
    with pytest.raises(ValueError, match="closed"):
        writer.add(make_frames(1)[0])


def test_unclosed_writer_leaves_no_trace(tmp_path: Path) -> None:
    """A writer that was not closed is discarded with its last reference."""
    writer = VideoWriter(tmp_path / "a.mp4", SIZE, FPS)
    writer.add(make_frames(1)[0])
    del writer
    assert list(tmp_path.iterdir()) == []


FORK_PROGRAM = """
import gc, os, pathlib, select, sys
import numpy as np
from minigolf_env.rendering.video_writer import VideoWriter
path = pathlib.Path(sys.argv[1])
frame = np.zeros((16, 16, 3), np.uint8)
writer = VideoWriter(path, (16, 16), 5)
writer.add(frame)
def files(): return {file: file.stat().st_ino for file in path.parent.iterdir()}
before = files()
held = [file.open() for file in before]  # So that no other file gets its number.
read, write = os.pipe()
child = os.fork()
if child == 0: CHILD
"""
WAIT_FOR_CHILD = "assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0\n"
CHECK_FILES = "assert files() == before\n"
FINISH_VIDEO = "writer.add(frame), writer.close(), os.write(write, b'.')\n"


@pytest.mark.parametrize("child", ["sys.exit()", "del writer; gc.collect(); os._exit(0)", "writer.close(); sys.exit()"])
def test_exit_of_forked_child_does_not_affect_video(tmp_path: Path, child: str) -> None:
    """However the child exits, the parent continues its video, and no frame is written twice."""
    path = tmp_path / "a.mp4"
    code = FORK_PROGRAM.replace("CHILD", child) + WAIT_FOR_CHILD + CHECK_FILES + FINISH_VIDEO
    subprocess.run([sys.executable, "-c", code, path], check=True)
    assert len(decode(path, (16, 16))) == 2


def test_running_forked_child_does_not_block_video(tmp_path: Path) -> None:
    """The child runs until the parent has finished its video; if the parent waited for it, both would wait a minute."""
    path = tmp_path / "a.mp4"
    code = (
        FORK_PROGRAM.replace("CHILD", "sys.exit(not select.select([read], [], [], 60.0)[0])")
        + FINISH_VIDEO
        + WAIT_FOR_CHILD
    )
    subprocess.run([sys.executable, "-c", code, path], check=True)
    assert len(decode(path, (16, 16))) == 2


def test_file_is_replaced_only_when_video_is_complete(tmp_path: Path) -> None:
    """The previous file stays until the video is complete. Closing twice is harmless."""
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
    """Return the permissions that new files lack in a folder."""
    (folder / "new").touch()
    return 0o666 & ~(folder / "new").stat().st_mode


@pytest.mark.parametrize(
    ("name", "size", "fps", "message"),
    [
        ("a.avi", SIZE, FPS, "'.mp4', '.gif'"),
        ("a.mp", SIZE, FPS, "did you mean '.mp4'"),
        ("a", SIZE, FPS, "the file's ending"),
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
    """Each mistake is reported, and nothing is written."""
    (tmp_path / "folder.mp4").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises((ValueError, OSError), match=message):
        VideoWriter(tmp_path / name, size, fps)
    assert {path.name for path in tmp_path.iterdir()} == {"file", "folder.mp4"}


def test_frames_may_be_lists_of_bytes_only_as_arrays_of_uint8(tmp_path: Path) -> None:
    """A list of numbers is an error with its type, not an AttributeError; nothing is left of the video."""
    with (
        pytest.raises(ValueError, match=r"frame: expected uint8 of shape .* received int64"),
        VideoWriter(tmp_path / "a.mp4", SIZE, FPS) as writer,
    ):
        writer.add(np.zeros((*SIZE[::-1], 3), np.int64).tolist())  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("shape", [(47, 64, 3), (48, 64), (48, 64, 4)])
def test_rejects_frames_of_wrong_size(tmp_path: Path, shape: tuple[int, ...]) -> None:
    """A video without frames is rejected too."""
    with (
        pytest.raises(ValueError, match="frame: expected uint8 of shape"),
        VideoWriter(tmp_path / "a.mp4", SIZE, 5) as w,
    ):
        w.add(np.zeros(shape, np.uint8))
    with pytest.raises(ValueError, match="at least one frame"), VideoWriter(tmp_path / "a.mp4", SIZE, FPS):
        pass
    assert list(tmp_path.iterdir()) == []


def test_reports_error_of_ffmpeg(tmp_path: Path, broken_ffmpeg: None) -> None:
    """The error has the last line of ffmpeg and a hint; no file remains."""
    with pytest.raises(OSError, match=r"exit code 28.*No space left on device; free space"):
        write(tmp_path / "a.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


def test_reports_immediate_exit_of_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A broken pipe is reported as the same kind of error."""
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/bin/false")
    with pytest.raises(OSError, match=r"ffmpeg failed \(exit code 1\): no message"):
        write(tmp_path / "a.mp4", 100)
    assert list(tmp_path.iterdir()) == []


def test_reports_missing_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing ffmpeg is an error that says how to install it."""
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nowhere"))
    with pytest.raises(OSError, match=r"does not start.*pip install"):
        write(tmp_path / "a.mp4")

    def missing() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    with pytest.raises(OSError, match=r"there is none for this system; pip install"):
        write(tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []
