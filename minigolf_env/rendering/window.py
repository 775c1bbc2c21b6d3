"""A window that shows putts in real time, or in its multiples: frames are dropped, never simulated time."""

from __future__ import annotations

import math
import os
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.episode_renderer import Settings
from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.gl.context import INSTALL, check_process, for_windows
from minigolf_env.rendering.replay import Replay
from minigolf_env.rendering.scene_state import Frame

if TYPE_CHECKING:
    from minigolf_env.rendering.gl.objects import Target

Picture = NDArray[np.uint8]

SOFTWARE = ("llvmpipe", "softpipe", "swrast", "SwiftShader")
"""Names of renderers without a GPU."""

NEEDED_BY = "window (of `minigolf play` or render_mode 'human')"
"""What messages say of a window that cannot be opened."""

TICK = 1.0 / 120.0
"""Frames are at least this far apart, s."""


class Window:
    """A window on a course. Closed by its user, it stays closed and everything it is told to show passes unseen.

    Args:
        course: the course.
        settings: size, camera, profile and speed.
        options: of pyglet's window.

    Raises:
        RenderingError: there is no display, or no OpenGL on it.
    """

    def __init__(self, course: Course, settings: Settings, **options: Any) -> None:
        self.course = course
        """What is shown; it may be changed."""
        self.overlay: Callable[[], None] | None = None
        """Called after each picture, to draw over it in the window's context."""
        self._speed, self._aspect = settings.speed, settings.aspect
        self._process = os.getpid()
        self._fits = False
        self._shown: tuple[Camera, Frame] | None = None
        self._drawn: Target | None = None
        with for_windows():
            self.window = open_window(settings.size, f"minigolf: {course.name}", **options)
            from minigolf_env.rendering.gl.renderer import Renderer, renderer_name

            self.window.switch_to()
            self._renderer = Renderer()
            software = any(name in renderer_name() for name in SOFTWARE)
        self._profile = {"auto": "fast" if software else "high"}.get(settings.profile, settings.profile)
        redraw = weakref.WeakMethod(self._redraw)
        self.window.push_handlers(on_expose=lambda: _call(redraw), on_resize=lambda width, height: None)
        weakref.finalize(self, _close, self.window, self._process)

    @property
    def is_open(self) -> bool:
        """Whether its user has not closed it."""
        return self.window is not None and not self.window.has_exit

    def enter(self, course: Course) -> None:
        """Show another course from now on."""
        if course is not self.course:
            self.course = course
            if self.is_open:
                self.window.set_caption(f"minigolf: {course.name}")

    def show(self, camera: Camera, frame: Frame) -> None:
        """Show a moment, all that the camera was to show, and let the window's user do things.

        Raises:
            RenderingError: in a process that was forked from the one that opened the window.
        """
        check_process(self._process)
        self._fits = True
        self.draw(camera, frame)
        if not self.is_open:
            return
        with for_windows():
            self.window.dispatch_events()
            if self.window.has_exit:
                self.close()

    def draw(self, camera: Camera, frame: Frame) -> None:
        """Show a moment."""
        self._shown = camera, frame
        with for_windows():
            self._redraw()

    def picture(self, size: tuple[int, int]) -> Picture | None:
        """Return what is shown, without the overlay, as a picture (height, width, 3); None if there is nothing."""
        if not self.is_open or self._shown is None:
            return None
        with for_windows():
            self.window.switch_to()
            if self._drawn is None or self._drawn.size != size:
                self._drawn = self._renderer.draw(self.course, *self._shown, size, self._profile)
            return self._drawn.read()

    def play(self, replay: Replay) -> None:
        """Show a putt, and return when it has ended or the window is closed."""
        start = shown = time.perf_counter()
        now = 0.0
        while self.is_open and now < replay.duration:
            self.show(*replay.at(now))
            time.sleep(max(0.0, shown + TICK - time.perf_counter()))
            shown = time.perf_counter()
            now = (shown - start) * self._speed
        if self.is_open:
            self.show(*replay.at(replay.duration))

    def close(self) -> None:
        """Close the window."""
        if self.window is not None:
            _close(self.window, self._process)
        self.window = None

    def _redraw(self) -> None:
        if not self.is_open or self._shown is None:
            return
        self.window.switch_to()
        size = self.window.get_framebuffer_size()
        if min(size) < 1:
            return  # Put away.
        camera, frame = self._shown
        if self._fits:
            camera = _widened(camera, max(1.0, self._aspect * size[1] / size[0]))
        self._drawn = self._renderer.draw(self.course, camera, frame, size, self._profile)
        self._drawn.show(*size)
        if self.overlay is not None:
            self.overlay()
        self.window.flip()


def _close(window: Any, process: int) -> None:
    """Close pyglet's window in the process that opened it; a forked child leaves its parent's open."""
    if os.getpid() == process:
        with for_windows():
            window.close()


def _call(method: weakref.WeakMethod[Callable[[], None]]) -> None:
    """Call a method of what is perhaps no longer there: a window that nobody holds is closed."""
    found = method()
    if found is not None:
        found()


def _widened(camera: Camera, times: float) -> Camera:
    """Return a camera that sees so many times more, as a picture that has become narrower needs it."""
    slope = times * math.tan(math.radians(camera.fov) / 2.0)
    return camera if times == 1.0 else replace(camera, fov=math.degrees(2.0 * math.atan(slope)))


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
            f"{NEEDED_BY}: expected a display, found none (DISPLAY is not set); run on a desktop, under "
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
            f"{NEEDED_BY}: no window can be opened: {type(error).__name__}: {error}. {INSTALL}"
        ) from error
