"""A video file that takes one picture after another."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
import weakref
from pathlib import Path
from types import TracebackType
from typing import IO, Self

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from minigolf_env._atomic_io import check_output, commit, create_temp_sibling
from minigolf_env._validation import integer, one_of
from minigolf_env.rendering import check_size

Picture = NDArray[np.uint8]

ENDINGS = (".mp4", ".gif")

GIF_FPS = 50
"""Most pictures a second of a GIF: its times are in 1/100 s, and players show a time of 1/100 s as 1/10 s."""

MP4_FPS = 1000
"""Beyond any screen."""

MP4 = (
    # H.264 halves the colours of each direction, so sides must be even: an odd one gets its last line twice.
    "-vf",
    "pad=ceil(iw/2)*2:ceil(ih/2)*2,fillborders=right={odd[0]}:bottom={odd[1]}:mode=smear,"
    # The colours are made as the file then says: players guess otherwise.
    "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709:range=tv",
    *("-c:v", "libx264", "-crf", "20"),
    # The index comes first, so that a browser plays before it has the whole file.
    *("-movflags", "+faststart", "-f", "mp4"),
)
GIF = (
    # One palette for all pictures. Undithered: on the grain of grass and wood, dots only cost bytes (4 to 11 %) and
    # closeness (3 to 4 dB).
    "-filter_complex",
    "split[a][b];[a]palettegen=stats_mode=full[p];[b][p]paletteuse=dither=none:diff_mode=rectangle",
    *("-loop", "0", "-f", "gif"),
)


class VideoWriter:
    """A video that takes one picture after another: an .mp4 (H.264, plays in browsers) or a .gif, by its ending.

    The file is there, whole, after ``close()``, and one of that name before is replaced then. Leaving a ``with`` block
    by an exception, Ctrl-C included, leaves no trace. This process holds no pictures; a GIF's wait in ffmpeg until the
    last is there, 4 bytes a pixel, since its palette is made of all. In a forked process the Writer is closed, and
    its parent's goes on.

    Args:
        path: the file; its folder is made.
        size: width and height of the pictures, pixels. An .mp4 has even sides: odd ones grow by one.
        fps: pictures a second, a whole number; at most 50 for a .gif.

    Raises:
        ValueError: an argument or a picture is not what it should be.
        OSError: the file cannot be written, or ffmpeg is missing or fails.
    """

    def __init__(self, path: Path, size: tuple[int, int], fps: int) -> None:
        self.path = check_path(path)
        self.size = check_size(size, "size")
        self.fps = check_fps(fps, self.path)
        self.pictures = 0
        """How many were added."""
        self.process = os.getpid()
        """The one that writes it; its forks do not."""
        command = _command(self.size, self.fps, self.path.suffix.lower())
        with contextlib.ExitStack() as undo:
            self._part = create_temp_sibling(self.path)
            undo.callback(self._part.unlink, missing_ok=True)
            self._log: IO[bytes] = undo.enter_context(tempfile.TemporaryFile())
            self._ffmpeg = _start([*command, str(self._part)], self._log)
            undo.pop_all()
        self.discard = weakref.finalize(self, _discard, self._ffmpeg, self._log, self._part)
        """End without a file: at once, and by itself when the Writer is gone."""
        _WRITERS.add(self)

    def add(self, picture: Picture) -> None:
        """Add a picture (height, width, 3)."""
        width, height = self.size
        if picture.shape != (height, width, 3) or picture.dtype != np.uint8:
            raise ValueError(
                f"picture: expected uint8 of shape {(height, width, 3)}, received {picture.dtype} of {picture.shape}; "
                "all pictures of a video have the size that the Writer was made with."
            )
        if not self.discard.alive:
            raise ValueError(f"{self.path}: the video is closed; make a new Writer.")
        try:
            _pipe(self._ffmpeg).write(np.ascontiguousarray(picture).data)
        except OSError as error:
            raise self._failure() from error
        except BaseException:  # Ctrl-C: perhaps half a picture went out.
            self.discard()
            raise
        self.pictures += 1

    def close(self) -> None:
        """Finish the file; nothing happens if that was done, or the video was discarded."""
        if not self.discard.alive:
            return
        try:
            if self.pictures == 0:
                raise ValueError(f"{self.path}: expected at least one picture, received none; no video was written.")
            try:
                _pipe(self._ffmpeg).close()
            except OSError as error:
                raise self._failure() from error
            if self._ffmpeg.wait() != 0:
                raise self._failure()
            commit(self._part, self.path)
        finally:
            self.discard()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        self.discard()

    def _failure(self) -> OSError:
        """Return what ffmpeg said before it failed, and discard the video."""
        try:
            self._ffmpeg.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._ffmpeg.kill()
        self._log.seek(0)
        said = self._log.read().decode(errors="replace").strip().splitlines() or ["it said nothing"]
        self.discard()
        full = any("No space left" in line for line in said)
        hint = "make room on the disk." if full else "try another size or ending, or another ffmpeg."
        return OSError(f"{self.path}: ffmpeg failed (exit code {self._ffmpeg.returncode}): {said[-1]}; {hint}")


_WRITERS: weakref.WeakSet[VideoWriter] = weakref.WeakSet()
"""All that a fork takes along."""


def _leave_to_parent() -> None:
    """Take a forked process out of the videos: it neither ends them, nor keeps ffmpeg waiting for more pictures."""
    for writer in [writer for writer in _WRITERS if writer.discard.alive]:
        writer.discard.detach()
        pipe = _pipe(writer._ffmpeg)
        if not pipe.closed:  # Its buffer may hold pictures that the parent writes: they go nowhere.
            with Path(os.devnull).open("wb") as nowhere:
                os.dup2(nowhere.fileno(), pipe.fileno(), inheritable=False)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_to_parent)


NO_FFMPEG = "pip install --force-reinstall imageio-ffmpeg, or name one in the environment variable IMAGEIO_FFMPEG_EXE."


def check_path(path: str | Path) -> Path:
    """Return where a video can be written, absolute, or raise a ValueError or OSError."""
    path = Path(path)
    if path.suffix.lower() not in ENDINGS:
        one_of(path.suffix.lower(), ENDINGS, f"{path}: the ending")
    return check_output(path)


def check_fps(fps: int, path: Path) -> int:
    """Return pictures a second that a kind of file can have, or raise a ValueError."""
    if path.suffix.lower() == ".gif":
        return integer(fps, "fps of a .gif", 1, GIF_FPS, "an .mp4 takes more.")
    return integer(fps, "fps", 1, MP4_FPS, "30 is usual.")


def _command(size: tuple[int, int], fps: int, ending: str) -> list[str]:
    """Return the command that encodes raw pictures from its standard input; the file's name is to be added."""
    try:
        ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise OSError(f"ffmpeg: there is none for this system; {NO_FFMPEG}") from error
    width, height = size
    odd = width % 2, height % 2
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(fps), "-i", "-"]
    coding = [word.format(odd=odd) for word in MP4] if ending == ".mp4" else list(GIF)
    return [ffmpeg, "-hide_banner", "-loglevel", "error", "-y", *source, *coding]


def _start(command: list[str], log: IO[bytes]) -> subprocess.Popen[bytes]:
    try:
        # A group of its own: Ctrl-C is for Python alone, which then ends ffmpeg.
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log, process_group=0)
    except OSError as error:
        raise OSError(f"ffmpeg: {command[0]} does not start: {error}; {NO_FFMPEG}") from error


def _pipe(ffmpeg: subprocess.Popen[bytes]) -> IO[bytes]:
    if ffmpeg.stdin is None:
        raise BrokenPipeError("ffmpeg takes nothing in.")
    return ffmpeg.stdin


def _discard(ffmpeg: subprocess.Popen[bytes], log: IO[bytes], part: Path) -> None:
    """End ffmpeg if it still runs, and remove what it wrote if that was not renamed."""
    if ffmpeg.poll() is None:
        ffmpeg.kill()
        ffmpeg.wait()
    with contextlib.suppress(OSError):  # What was still to be written is not wanted.
        _pipe(ffmpeg).close()
    log.close()
    part.unlink(missing_ok=True)
