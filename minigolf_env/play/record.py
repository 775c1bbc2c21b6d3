"""Films of putts, and pictures of the window."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pyglet
from numpy.typing import NDArray

FPS = 30
"""Pictures a second of a film."""


class Recorder:
    """A film that grows with each putt. The file is made at once; the folder is the present one.

    Args:
        stem: how the file's name begins.
        size: of the pictures, pixels; made even, as encoders ask for.

    Raises:
        OSError, ImportError: the file cannot be written.
    """

    def __init__(self, stem: str, size: tuple[int, int]) -> None:
        from minigolf_env.video import Writer

        self.size = size[0] // 2 * 2, size[1] // 2 * 2
        self.path = _unused(stem, "mp4")
        self._writer: Any = Writer(self.path, self.size, FPS)

    def add(self, picture: NDArray[np.uint8] | None) -> None:
        """Add a picture (height, width, 3)."""
        if picture is not None:
            self._writer.add(picture)

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()


def save_picture() -> Path:
    """Write what is in the current window to a file in the present folder, and return its path.

    Raises:
        OSError: the file cannot be written.
    """
    path = _unused("minigolf", "png")
    pyglet.image.get_buffer_manager().get_color_buffer().save(str(path))
    return path


def _unused(stem: str, ending: str) -> Path:
    return next(path for k in itertools.count(1) if not (path := Path(f"{stem}-{k}.{ending}")).exists())
