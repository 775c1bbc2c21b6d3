"""Video files, written frame by frame through ffmpeg.

ffmpeg runs here rather than in imageio's writer for three guarantees: the file is written atomically, a forked process
neither ends nor blocks the video, and an error has ffmpeg's message.
"""

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

from minigolf_env._atomic_io import DISK_FULL_ERRNOS, DISK_FULL_HINT, check_output, commit, create_temp_sibling
from minigolf_env._validation import integer, one_of
from minigolf_env.rendering.image import Image, check_size

VIDEO_SUFFIXES = (".mp4", ".gif")
"""Suffixes of the supported kinds of files."""

MAX_GIF_FPS = 50
"""Highest frame rate of a GIF: its times are in 1/100 s, and players replace a frame time of 1/100 s by 1/10 s."""

MAX_MP4_FPS = 1000
"""Highest frame rate of an .mp4; no display is faster."""

FFMPEG_HINT = (
    "pip install --force-reinstall imageio-ffmpeg, or set the environment variable IMAGEIO_FFMPEG_EXE to an ffmpeg."
)
"""Remedy for a missing ffmpeg, the end of error messages."""

MP4_OPTIONS = (
    # H.264 subsamples colours by 2 in each direction, so sides must be even: the last line of an odd side is repeated.
    "-vf",
    "pad=ceil(iw/2)*2:ceil(ih/2)*2,fillborders=right={odd[0]}:bottom={odd[1]}:mode=smear,"
    # The colour space is converted explicitly and named in the file: otherwise players guess.
    "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709:range=tv",
    *("-c:v", "libx264", "-crf", "20"),
    # The index comes first, so that a browser plays before it has received the whole file.
    *("-movflags", "+faststart", "-f", "mp4"),
)
"""ffmpeg's options for an .mp4; {odd} is 1 for an odd width, or height, and 0 for an even one."""

GIF_OPTIONS = (
    # One palette for all frames, no dithering: on the textures of grass and wood it makes files larger (4 to 11 %) and
    # less accurate (3 to 4 dB).
    "-filter_complex",
    "split[a][b];[a]palettegen=stats_mode=full[p];[b][p]paletteuse=dither=none:diff_mode=rectangle",
    *("-loop", "0", "-f", "gif"),
)
"""ffmpeg's options for a .gif."""


class VideoWriter:
    """A video file that is written frame by frame: an .mp4 (H.264, plays in browsers) or a .gif, by its suffix.

    ``close()`` writes the file atomically; until then an earlier file of the same name stays. Leaving a ``with`` block
    by an exception, Ctrl-C included, leaves no file. The writer keeps no frames in memory; ffmpeg keeps those of a GIF,
    4 bytes per pixel, until the last has arrived, since their palette is computed from all. In a forked process the
    writer is closed, and that of the parent continues.

    Args:
        path: the file; its folder is created.
        size: width and height of the frames, pixels. An .mp4 has even sides: odd ones grow by one.
        fps: frames per second, an integer; at most 50 for a .gif.

    Raises:
        ValueError: an argument or a frame is invalid.
        OSError: the file cannot be written, or ffmpeg is missing or fails.
    """

    def __init__(self, path: str | Path, size: tuple[int, int], fps: int) -> None:
        self.path = check_path(path)
        self.size = check_size(size, "size")
        self.fps = check_fps(fps, self.path)
        self.num_frames = 0
        """Number of frames that were added."""
        self.process_id = os.getpid()
        """Id of the process that writes the video; its forks do not."""
        command = _ffmpeg_command(self.size, self.fps, self.path.suffix.lower())
        with contextlib.ExitStack() as undo:
            self._temp_path = create_temp_sibling(self.path)
            undo.callback(self._temp_path.unlink, missing_ok=True)
            self._log: IO[bytes] = undo.enter_context(tempfile.TemporaryFile())
            self._ffmpeg = _start_ffmpeg([*command, str(self._temp_path)], self._log)
            undo.pop_all()
        self.discard = weakref.finalize(self, _discard, self._ffmpeg, self._log, self._temp_path)
        """Stop ffmpeg without writing the file; runs by itself when the writer is garbage-collected."""
        _OPEN_WRITERS.add(self)

    def add(self, frame: Image) -> None:
        """Append a frame (height, width, 3), uint8."""
        width, height = self.size
        frame = np.asarray(frame)
        if frame.shape != (height, width, 3) or frame.dtype != np.uint8:
            raise ValueError(
                f"frame: expected uint8 of shape {(height, width, 3)}, received {frame.dtype} of {frame.shape}; "
                "all frames of a video have the size that the VideoWriter was made with."
            )
        if not self.discard.alive:
            raise ValueError(f"{self.path}: the video is closed; make a new VideoWriter.")
        try:
            _input_pipe(self._ffmpeg).write(np.ascontiguousarray(frame).data)
        except OSError as error:
            raise self._failure() from error
        except BaseException:  # After Ctrl-C ffmpeg may have received half a frame.
            self.discard()
            raise
        self.num_frames += 1

    def close(self) -> None:
        """Finish the file; does nothing if it is finished or was discarded."""
        if not self.discard.alive:
            return
        try:
            if self.num_frames == 0:
                raise ValueError(f"{self.path}: expected at least one frame, received none; no video was written.")
            try:
                _input_pipe(self._ffmpeg).close()
            except OSError as error:
                raise self._failure() from error
            if self._ffmpeg.wait() != 0:
                raise self._failure()
            commit(self._temp_path, self.path)
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
        """Return an error with ffmpeg's last message, and discard the video."""
        try:
            self._ffmpeg.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._ffmpeg.kill()
        self._log.seek(0)
        messages = self._log.read().decode(errors="replace").strip().splitlines() or ["no message"]
        self.discard()
        is_disk_full = any(os.strerror(number) in line for number in DISK_FULL_ERRNOS for line in messages)
        hint = DISK_FULL_HINT if is_disk_full else "try another size or suffix, or another ffmpeg."
        return OSError(f"{self.path}: ffmpeg failed (exit code {self._ffmpeg.returncode}): {messages[-1]}; {hint}")


_OPEN_WRITERS: weakref.WeakSet[VideoWriter] = weakref.WeakSet()
"""All writers of this process, which a fork inherits."""


def _detach_from_parent() -> None:
    """Detach the writers of a forked process: it neither ends the videos nor keeps ffmpeg waiting for more frames."""
    for writer in [writer for writer in _OPEN_WRITERS if writer.discard.alive]:
        writer.discard.detach()
        pipe = _input_pipe(writer._ffmpeg)
        # The pipe's buffer may hold frames that the parent writes: the fork's copy goes to the null device.
        if not pipe.closed:
            with Path(os.devnull).open("wb") as null_device:
                os.dup2(null_device.fileno(), pipe.fileno(), inheritable=False)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_detach_from_parent)


def check_path(path: str | Path) -> Path:
    """Return the absolute path of a video that can be written, or raise a ValueError or OSError."""
    path = Path(path)
    one_of(path.suffix.lower(), VIDEO_SUFFIXES, "output: the file's ending")
    return check_output(path)


def check_fps(fps: int, path: Path) -> int:
    """Return a frame rate that the kind of file supports, or raise a ValueError."""
    if path.suffix.lower() == ".gif":
        return integer(fps, "fps of a .gif", 1, MAX_GIF_FPS, "an .mp4 takes more.")
    return integer(fps, "fps", 1, MAX_MP4_FPS, "30 is usual.")


def _ffmpeg_command(size: tuple[int, int], fps: int, suffix: str) -> list[str]:
    """Return the command that encodes raw frames from its standard input, without the output path at its end."""
    try:
        ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise OSError(f"ffmpeg: there is none for this system; {FFMPEG_HINT}") from error
    width, height = size
    odd = width % 2, height % 2
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(fps), "-i", "-"]
    encoding = [option.format(odd=odd) for option in MP4_OPTIONS] if suffix == ".mp4" else list(GIF_OPTIONS)
    return [ffmpeg, "-hide_banner", "-loglevel", "error", "-y", *source, *encoding]


def _start_ffmpeg(command: list[str], log: IO[bytes]) -> subprocess.Popen[bytes]:
    """Start ffmpeg with a pipe for the frames, or raise an OSError."""
    try:
        # A separate process group: Ctrl-C reaches Python alone, which then stops ffmpeg. Signals that Python ignores
        # stay ignored: at a limit on the size of files ffmpeg reports an error, instead of ending without a message.
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=log,
            process_group=0,
            restore_signals=False,
        )
    except OSError as error:
        raise OSError(f"ffmpeg: {command[0]} does not start: {error}; {FFMPEG_HINT}") from error


def _input_pipe(ffmpeg: subprocess.Popen[bytes]) -> IO[bytes]:
    """Return the pipe to ffmpeg's standard input."""
    if ffmpeg.stdin is None:
        raise BrokenPipeError("ffmpeg has no standard input.")
    return ffmpeg.stdin


def _discard(ffmpeg: subprocess.Popen[bytes], log: IO[bytes], temp_path: Path) -> None:
    """Stop ffmpeg if it still runs, and remove its temporary file if that was not committed."""
    if ffmpeg.poll() is None:
        ffmpeg.kill()
        ffmpeg.wait()
    with contextlib.suppress(OSError):  # Closing flushes the rest of the buffer, which may fail.
        _input_pipe(ffmpeg).close()
    log.close()
    temp_path.unlink(missing_ok=True)
