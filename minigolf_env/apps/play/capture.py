"""Videos of putts and screenshots of the window."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pyglet

from minigolf_env.rendering.window import Window

VIDEO_FPS = 30
"""Frames a second of a video."""

ENCODER_ERRORS = (ImportError, OSError, RuntimeError, ValueError)
"""Exceptions of video encoders: a full disk, a folder that is not writable, a missing program."""

MAX_MESSAGE_LENGTH = 80
"""Largest number of characters of a message."""


class WindowRecorder:
    """Records putts from start to stop into a video file in the current folder."""

    def __init__(self) -> None:
        self._writer: Any = None
        self._path = Path()
        self._size = 0, 0

    @property
    def is_on(self) -> bool:
        """True while putts are recorded."""
        return self._writer is not None

    def toggle(self, name: str, size: tuple[int, int]) -> str:
        """Start a video, or finish it; return a message for the player.

        Args:
            name: name of the course, for the file's name.
            size: size of the framebuffer, pixels; odd sizes are reduced by one, as encoders need even ones.
        """
        if self._writer is not None:
            return self.close()
        try:
            from minigolf_env.rendering.video_writer import VideoWriter

            self._size = size[0] // 2 * 2, size[1] // 2 * 2
            self._path = _unused_path(f"minigolf-{name}", "mp4")
            self._writer = VideoWriter(self._path, self._size, VIDEO_FPS)
        except ENCODER_ERRORS as error:
            return f"No video: {error}"[:MAX_MESSAGE_LENGTH]
        return f"Recording the next putts: {self._path}"

    def add(self, window: Window) -> str:
        """Add the frame of a window; return an error message, or an empty string."""
        try:
            self._writer.add(window.capture(self._size))
        except ENCODER_ERRORS as error:
            self._writer = None
            return f"The video stopped: {error}"[:MAX_MESSAGE_LENGTH]
        return ""

    def close(self) -> str:
        """Finish the video, if there is one; return a message for the player."""
        if self._writer is None:
            return ""
        writer = self._writer
        self._writer = None
        try:
            writer.close()
        except ENCODER_ERRORS as error:
            return f"No video: {error}"[:MAX_MESSAGE_LENGTH]
        return f"Video written: {self._path}"


def save_screenshot() -> str:
    """Write the window's framebuffer to a file in the current folder; return a message for the player."""
    path = _unused_path("minigolf", "png")
    try:
        pyglet.image.get_buffer_manager().get_color_buffer().save(str(path))
    except OSError as error:
        return f"No screenshot: {error}"[:MAX_MESSAGE_LENGTH]
    return f"Screenshot written: {path}"


def _unused_path(stem: str, extension: str) -> Path:
    return next(path for k in itertools.count(1) if not (path := Path(f"{stem}-{k}.{extension}")).exists())
