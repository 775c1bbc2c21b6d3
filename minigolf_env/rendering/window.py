"""A window that shows putts in real time or in a multiple of it; late frames are skipped to keep the pace."""

from __future__ import annotations

import math
import os
import time
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.gl.context import check_process, egl_released
from minigolf_env.rendering.gl.window_context import open_window
from minigolf_env.rendering.image import Image
from minigolf_env.rendering.replay import Replay
from minigolf_env.rendering.scene_state import SceneState
from minigolf_env.rendering.settings import RenderSettings

if TYPE_CHECKING:
    from minigolf_env.rendering.gl.buffers import Framebuffer

SOFTWARE_DRIVERS = ("llvmpipe", "softpipe", "swrast", "SwiftShader")
"""Names of OpenGL drivers that draw without a GPU."""

MIN_PRESENT_INTERVAL = 1.0 / 120.0
"""Shortest time between two frames of a replay, s."""


class Window:
    """A window that shows a course. Once its user has closed it, further draw calls do nothing.

    Args:
        course: the course.
        settings: size, camera, profile and speed.
        options: further arguments of pyglet's window.

    Raises:
        RenderingError: there is no display, or no OpenGL on it.
    """

    def __init__(self, course: Course, settings: RenderSettings, **options: Any) -> None:
        self.course = course
        """The course that is shown; it may be changed."""
        self.overlay: Callable[[], None] | None = None
        """Function that is called after each image, to draw over it in the window's context."""
        self._speed = settings.speed
        self._aspect = settings.aspect
        self._process_id = os.getpid()
        self._keeps_width = False
        """The camera is widened when the window becomes narrower than in the settings."""
        self._shown: tuple[Camera, SceneState] | None = None
        self._framebuffer: Framebuffer | None = None
        with egl_released():
            self.window = open_window(settings.size, f"minigolf: {course.name}", **options)
            from minigolf_env.rendering.gl.renderer import Renderer, driver_name

            self.window.switch_to()
            self._renderer = Renderer()
            has_no_gpu = any(name in driver_name() for name in SOFTWARE_DRIVERS)
        self._profile = {"auto": "fast" if has_no_gpu else "high"}.get(settings.profile, settings.profile)
        redraw = weakref.WeakMethod(self._redraw)
        self.window.push_handlers(on_expose=lambda: _call_if_alive(redraw), on_resize=lambda width, height: None)
        weakref.finalize(self, _close, self.window, self._process_id)

    @property
    def is_open(self) -> bool:
        """Return whether the window is open: neither its user nor ``close`` has closed it."""
        return self.window is not None and not self.window.has_exit

    def set_course(self, course: Course) -> None:
        """Show another course from now on."""
        if course is not self.course:
            self.course = course
            if self.is_open:
                self.window.set_caption(f"minigolf: {course.name}")

    def draw_and_handle_events(self, camera: Camera, state: SceneState) -> None:
        """Draw a scene state with the whole width of the camera's view, then handle the events of the window's user.

        Raises:
            RenderingError: this process was forked from the one that opened the window.
        """
        check_process(self._process_id)
        self._keeps_width = True
        self.draw(camera, state)
        if not self.is_open:
            return
        with egl_released():
            self.window.dispatch_events()
            if self.window.has_exit:
                self.close()

    def draw(self, camera: Camera, state: SceneState) -> None:
        """Draw a scene state; the caller handles the window's events."""
        self._shown = camera, state
        with egl_released():
            self._redraw()

    def capture(self, size: tuple[int, int]) -> Image | None:
        """Return what is shown, without the overlay, as an image (height, width, 3); None if nothing is shown."""
        if not self.is_open or self._shown is None:
            return None
        with egl_released():
            self.window.switch_to()
            if self._framebuffer is None or self._framebuffer.size != size:
                self._framebuffer = self._renderer.draw(self.course, *self._shown, size, self._profile)
            return self._framebuffer.read()

    def play(self, replay: Replay) -> None:
        """Show a putt; return when it has ended or the window is closed."""
        start_time = last_frame_time = time.perf_counter()
        replay_time = 0.0
        while self.is_open and replay_time < replay.duration:
            self.draw_and_handle_events(*replay.view(replay_time))
            time.sleep(max(0.0, last_frame_time + MIN_PRESENT_INTERVAL - time.perf_counter()))
            last_frame_time = time.perf_counter()
            replay_time = (last_frame_time - start_time) * self._speed
        if self.is_open:
            self.draw_and_handle_events(*replay.view(replay.duration))

    def close(self) -> None:
        """Close the window."""
        if self.window is not None:
            _close(self.window, self._process_id)
        self.window = None

    def _redraw(self) -> None:
        """Draw the last scene state again, as when the window is exposed or resized."""
        if not self.is_open or self._shown is None:
            return
        self.window.switch_to()
        size = self.window.get_framebuffer_size()
        if min(size) < 1:
            return  # The window is minimized.
        camera, state = self._shown
        if self._keeps_width:
            camera = _widen(camera, max(1.0, self._aspect * size[1] / size[0]))
        self._framebuffer = self._renderer.draw(self.course, camera, state, size, self._profile)
        self._framebuffer.blit_to_window(*size)
        if self.overlay is not None:
            self.overlay()
        self.window.flip()


def _close(window: Any, process_id: int) -> None:
    """Close pyglet's window in the process that opened it; a forked child leaves its parent's open."""
    if os.getpid() == process_id:
        with egl_released():
            window.close()


def _call_if_alive(method: weakref.WeakMethod[Callable[[], None]]) -> None:
    """Call a method unless its object is gone: pyglet's handlers do not keep a window alive."""
    alive = method()
    if alive is not None:
        alive()


def _widen(camera: Camera, factor: float) -> Camera:
    """Return a camera whose view is larger by a factor in both directions."""
    slope = factor * math.tan(math.radians(camera.fov) / 2.0)
    return camera if factor == 1.0 else replace(camera, fov=math.degrees(2.0 * math.atan(slope)))
