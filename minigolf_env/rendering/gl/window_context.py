"""OpenGL contexts of pyglet windows."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.gl.context import INSTALL_HINT, check_process, egl_released

WINDOW_PURPOSE = "window (of `minigolf play` or render_mode 'human')"
"""Beginning of the message if a window cannot be opened."""


class HiddenWindowContext:
    """The context of a window that is never shown, for systems without EGL (macOS, Windows).

    Raises:
        RenderingError: there is no display, or no OpenGL on it.
    """

    def __init__(self) -> None:
        self._process_id = os.getpid()
        self._lock = threading.RLock()
        with egl_released():
            self._window = open_window((1, 1), "minigolf", visible=False)

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the context current within a ``with`` block.

        Raises:
            RenderingError: this process was forked from the one that made the context.
        """
        check_process(self._process_id)
        with self._lock, egl_released():
            self._window.switch_to()
            yield


def open_window(size: tuple[int, int], caption: str, **options: Any) -> Any:
    """Return a pyglet window with an OpenGL 3.3 context.

    Args:
        size: width and height, pixels.
        caption: title of the window.
        options: further arguments of pyglet's window.

    Raises:
        RenderingError: there is no display, or no OpenGL on it.
    """
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        raise RenderingError(
            f"{WINDOW_PURPOSE}: expected a display, found none (DISPLAY is not set); run on a desktop, under "
            "`xvfb-run -s '-screen 0 1280x1024x24'` (apt-get install xvfb), or use render_mode='rgb_array'."
        )
    try:
        import pyglet

        pyglet.options["shadow_window"] = False
        from pyglet import gl

        # The annotations call Config abstract; it is the template that pyglet's manual says to make.
        config: Any = gl.Config(double_buffer=True, major_version=3, minor_version=3)  # type: ignore[abstract]
        return pyglet.window.Window(*size, caption=caption, resizable=True, config=config, vsync=False, **options)
    except Exception as error:  # pyglet raises what its platform's libraries do.
        raise RenderingError(
            f"{WINDOW_PURPOSE}: no window can be opened: {type(error).__name__}: {error}. {INSTALL_HINT}"
        ) from error
