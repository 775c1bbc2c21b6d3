"""Films of putts, and pictures of the window."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pyglet

from minigolf_env.rendering.window import Window

FPS = 30
"""Pictures a second of a film."""


FAULTS = (ImportError, OSError, RuntimeError, ValueError)
"""What encoders raise: the disk is full, the folder is not writable, the program is missing."""

WIDEST = 80
"""Letters of a message at most."""


class Recorder:
    """Films putts, from when it is switched on to when it is switched off, into a file in the present folder."""

    def __init__(self) -> None:
        self._writer: Any = None
        self._path = Path()
        self._size = 0, 0

    @property
    def is_on(self) -> bool:
        """Whether putts are filmed."""
        return self._writer is not None

    def switch(self, name: str, size: tuple[int, int]) -> str:
        """Begin a film of a course, of a size made even as encoders ask for, or end it; return what to say."""
        if self._writer is not None:
            return self.close()
        try:
            from minigolf_env.rendering.video_writer import VideoWriter

            self._size = size[0] // 2 * 2, size[1] // 2 * 2
            self._path = _unused(f"minigolf-{name}", "mp4")
            self._writer = VideoWriter(self._path, self._size, FPS)
        except FAULTS as error:
            return f"No film: {error}"[:WIDEST]
        return f"The next putts are filmed: {self._path}"

    def add(self, window: Window) -> str:
        """Add what a window shows; return what to say if that fails."""
        try:
            self._writer.add(window.picture(self._size))
        except FAULTS as error:
            self._writer = None
            return f"The film ends: {error}"[:WIDEST]
        return ""

    def close(self) -> str:
        """Finish the film, if there is one; return what to say."""
        writer, self._writer = self._writer, None
        if writer is None:
            return ""
        try:
            writer.close()
        except FAULTS as error:
            return f"No film: {error}"[:WIDEST]
        return f"Film written: {self._path}"


def save_picture() -> str:
    """Write what has just been drawn into the window to a file in the present folder; return what to say."""
    path = _unused("minigolf", "png")
    try:
        pyglet.image.get_buffer_manager().get_color_buffer().save(str(path))
    except OSError as error:
        return f"No picture: {error}"[:WIDEST]
    return f"Picture written: {path}"


def _unused(stem: str, ending: str) -> Path:
    return next(path for k in itertools.count(1) if not (path := Path(f"{stem}-{k}.{ending}")).exists())
