"""A window that shows putts in real time, or in its multiples: frames are dropped, never simulated time."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.frame import Frame
from minigolf_env.rendering.gl_context import INSTALL, check_process, for_windows
from minigolf_env.rendering.playback import Replay
from minigolf_env.rendering.screen import Settings

SOFTWARE = ("llvmpipe", "softpipe", "swrast", "SwiftShader")
"""Names of renderers without a GPU."""

TICK = 1.0 / 120.0
"""Frames are at least this far apart, s."""


class Window:
    """A window on a course. Closed by its user, it stays closed and everything it is told to show passes unseen.

    Args:
        course: the course.
        settings: size, camera, profile and speed.

    Raises:
        RenderingError: there is no display, or no OpenGL on it.
    """

    def __init__(self, course: Course, settings: Settings) -> None:
        self._course, self._speed = course, settings.speed
        self._shown: tuple[Camera, Frame] | None = None
        with for_windows():
            self.window = open_window(settings.size, f"minigolf: {course.name}")
            from minigolf_env.rendering.gl_renderer import Renderer, renderer_name

            self.window.switch_to()
            self._renderer = Renderer()
            software = any(name in renderer_name() for name in SOFTWARE)
        self._profile = {"auto": "fast" if software else "high"}.get(settings.profile, settings.profile)
        self.window.push_handlers(on_expose=self._redraw, on_resize=lambda width, height: None)

    @property
    def is_open(self) -> bool:
        """Whether its user has not closed it."""
        return self.window is not None and not self.window.has_exit

    def enter(self, course: Course) -> None:
        """Show another course from now on."""
        if course is not self._course:
            self._course = course
            if self.is_open:
                self.window.set_caption(f"minigolf: {course.name}")

    def show(self, camera: Camera, frame: Frame) -> None:
        """Show a moment, and let the window's user do things."""
        self._shown = camera, frame
        if not self.is_open:
            return
        with for_windows():
            self._redraw()
            self.window.dispatch_events()
            if self.window.has_exit:
                self.close()

    def play(self, replay: Replay) -> None:
        """Show a putt, and return when it has ended or the window is closed."""
        start = time.perf_counter()
        now = 0.0
        while self.is_open and now < replay.duration:
            self.show(*replay.at(now))
            shown, now = now, (time.perf_counter() - start) * self._speed
            if now - shown < TICK:
                time.sleep(TICK)
        if self.is_open:
            self.show(*replay.at(replay.duration))

    def close(self) -> None:
        """Close the window."""
        if self.window is not None:
            with for_windows():
                self.window.close()
            self.window = None

    def _redraw(self) -> None:
        if not self.is_open or self._shown is None:
            return
        self.window.switch_to()
        size = self.window.get_framebuffer_size()
        self._renderer.draw(self._course, *self._shown, size, self._profile).show(*size)
        self.window.flip()


class HiddenWindow:
    """The context of a window that is never seen: for pictures where there is no EGL (macOS, Windows).

    Raises:
        RenderingError: there is no display, or no OpenGL on it.
    """

    def __init__(self) -> None:
        self._process, self._lock = os.getpid(), threading.RLock()
        with for_windows():
            self._window = open_window((1, 1), "minigolf", visible=False)

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make it current within a ``with`` block.

        Raises:
            RenderingError: in a process that was forked from the one that made it.
        """
        check_process(self._process)
        with self._lock, for_windows():
            self._window.switch_to()
            yield


def open_window(size: tuple[int, int], caption: str, **options: Any) -> Any:
    """Return a pyglet window with an OpenGL 3.3 context.

    Raises:
        RenderingError: there is no display, or no OpenGL on it.
    """
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        raise RenderingError(
            "render_mode 'human': expected a display, found none (DISPLAY is not set); run on a desktop, under "
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
            f"render_mode 'human': no window can be opened: {type(error).__name__}: {error}. {INSTALL}"
        ) from error
