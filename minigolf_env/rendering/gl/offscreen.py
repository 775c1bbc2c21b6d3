"""Rendering to arrays without a window: one context and one renderer per process, made at the first image."""

from __future__ import annotations

import functools
import platform
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.dirty_rect import compute_dirty_rect
from minigolf_env.rendering.errors import ContextLostError
from minigolf_env.rendering.gbuffer import GBuffer
from minigolf_env.rendering.gl.context import Context, EGLContext
from minigolf_env.rendering.image import Image
from minigolf_env.rendering.scene_state import SceneState

if TYPE_CHECKING:
    from minigolf_env.rendering.gl.renderer import Renderer

Rendered = TypeVar("Rendered")

BackgroundKey = tuple[Course, Camera, tuple[int, int], str]
"""Course, camera, size (pixels) and profile: together they determine the image without a ball."""

MAX_CACHED_BACKGROUNDS = 16
"""Number of images without a ball that are kept for cameras that stand still."""

_CREATION_LOCK = threading.Lock()
"""Held while the renderer of the process is made, so that all threads get the same one."""


def draw(course: Course, camera: Camera, state: SceneState, size: tuple[int, int], profile: str = "high") -> Image:
    """Return an image (height, width, 3).

    Where the camera stands still, only the dirty rectangle is drawn again: the same bits in less time.

    Args:
        course: the course.
        camera: the camera.
        state: poses of ball, flag and lines.
        size: width and height, pixels.
        profile: "high", with anti-aliasing, or "fast".

    Raises:
        RenderingError: OpenGL is not available, ``size`` is beyond its limit, or the process was forked after the
            first image.
    """
    return _render(lambda renderer: renderer.draw((course, camera, size, profile), state))


def draw_gbuffer(course: Course, camera: Camera, size: tuple[int, int]) -> GBuffer:
    """Return the G-buffer of a course with its flag and no ball, in the profile "fast".

    Args:
        course: the course.
        camera: the camera.
        size: width and height, pixels.

    Raises:
        RenderingError: see ``draw``.
    """
    return _render(lambda renderer: renderer.renderer().draw_gbuffer(course, camera, size))


class OffscreenRenderer:
    """A context, a renderer in it, and cached backgrounds of the most recent cameras.

    Args:
        context: the context to draw in; None: the one of this platform.
    """

    def __init__(self, context: Context | None = None) -> None:
        self.context = context or _create_context()
        self._renderer: Renderer | None = None
        self._backgrounds: OrderedDict[BackgroundKey, Image] = OrderedDict()
        self._last_key: BackgroundKey | None = None

    def draw(self, key: BackgroundKey, state: SceneState) -> Image:
        """Return an image; the context is current."""
        course, camera, size, profile = key
        # A new camera may be moving: the background would be wasted.
        if key not in self._backgrounds and key != self._last_key:
            self._last_key = key
            return self.renderer().draw(course, camera, state, size, profile).read()
        # Copy the background and draw the dirty rectangle.
        image = self._background(key).copy()
        rect = compute_dirty_rect(course, camera, state, size)
        if rect.left < rect.right and rect.top < rect.bottom:
            framebuffer = self.renderer().draw(course, camera, state, size, profile, rect)
            image[rect.top : rect.bottom, rect.left : rect.right] = framebuffer.read(rect)
        return image

    def renderer(self) -> Renderer:
        """Return the renderer, made at the first call; the context is current."""
        if self._renderer is None:
            from minigolf_env.rendering.gl.renderer import Renderer

            self._renderer = Renderer()
        return self._renderer

    def _background(self, key: BackgroundKey) -> Image:
        """Return the cached image without a ball."""
        course, camera, size, profile = key
        if key not in self._backgrounds:
            self._backgrounds[key] = self.renderer().draw(course, camera, None, size, profile).read()
            if len(self._backgrounds) > MAX_CACHED_BACKGROUNDS:
                self._backgrounds.popitem(last=False)
        self._backgrounds.move_to_end(key)
        return self._backgrounds[key]


def get_offscreen_renderer() -> OffscreenRenderer:
    """Return the renderer of this process, made at the first call."""
    with _CREATION_LOCK:
        return _process_renderer()


def _render(work: Callable[[OffscreenRenderer], Rendered]) -> Rendered:
    """Return the result of some work for which the renderer's context is current.

    If another library has ended the context, a new one is made, once.
    """
    renderer = get_offscreen_renderer()
    try:
        with renderer.context.current():
            return work(renderer)
    except ContextLostError:
        _discard_renderer(renderer)
    renderer = get_offscreen_renderer()
    with renderer.context.current():
        return work(renderer)


def _discard_renderer(renderer: OffscreenRenderer) -> None:
    """Forget the renderer of the process, unless another thread has replaced it already."""
    with _CREATION_LOCK:
        if _process_renderer() is renderer:
            _process_renderer.cache_clear()


@functools.cache
def _process_renderer() -> OffscreenRenderer:
    """Return the cached renderer of this process; the caller holds the lock."""
    return OffscreenRenderer()


def _create_context() -> Context:
    """Return a context without a visible window: EGL on Linux, a hidden window elsewhere."""
    if platform.system() == "Linux":
        return EGLContext()
    from minigolf_env.rendering.gl.window_context import HiddenWindowContext

    return HiddenWindowContext()
