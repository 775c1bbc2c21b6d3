"""Pictures as arrays, without a window: one context and one renderer a process, made at the first picture."""

from __future__ import annotations

import functools
import platform
import threading
from collections import OrderedDict
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.dirty_rect import moving_part
from minigolf_env.rendering.gl.context import Context, HeadlessContext
from minigolf_env.rendering.scene_state import Frame

if TYPE_CHECKING:
    from minigolf_env.rendering.gl.renderer import Renderer

Picture = NDArray[np.uint8]
View = tuple[Course, Camera, tuple[int, int], str]

_FIRST = threading.Lock()
"""Held while the studio is made: threads get one and the same."""

STILLS = 16
"""Pictures of courses without a ball that are kept, for views that come again."""


def draw(course: Course, camera: Camera, frame: Frame, size: tuple[int, int], profile: str = "high") -> Picture:
    """Return a picture (height, width, 3).

    Where a camera stands still, only the part in which something moves is drawn again: the same bits in less time.

    Args:
        course: the course.
        camera: where it is seen from.
        frame: the ball and what else moves.
        size: width and height, pixels.
        profile: "high", with smooth edges, or "fast".

    Raises:
        RenderingError: there is no OpenGL here, ``size`` is beyond its limit, or the process was forked after the
            first picture.
    """
    return draw_many(course, camera, [frame], size, profile)[0]


def draw_many(
    course: Course, camera: Camera, frames: Iterable[Frame], size: tuple[int, int], profile: str = "high"
) -> list[Picture]:
    """Return a picture of each frame, as ``draw`` does, in a little less time."""
    with studio().context.current():
        return [studio().draw((course, camera, size, profile), frame) for frame in frames]


class Studio:
    """The context and the renderer of this process, and the stills of its latest views."""

    def __init__(self, context: Context | None = None) -> None:
        self.context = context or _make_context()
        self._renderer: Renderer | None = None
        self._stills: OrderedDict[View, Picture] = OrderedDict()
        self._latest: View | None = None

    def draw(self, view: View, frame: Frame) -> Picture:
        """Return a picture; the context is current."""
        course, camera, size, profile = view
        if view not in self._stills and view != self._latest:
            self._latest = view  # Perhaps the camera moves: a still would be of no use.
            return self.renderer().draw(course, camera, frame, size, profile).read()
        still = self._still(view)
        part = moving_part(course, camera, frame, size)
        picture = still.copy()
        if part.left < part.right and part.top < part.bottom:
            drawn = self.renderer().draw(course, camera, frame, size, profile, part)
            picture[part.top : part.bottom, part.left : part.right] = drawn.read(part)
        return picture

    def _still(self, view: View) -> Picture:
        """Return the picture without a ball; it is kept."""
        course, camera, size, profile = view
        if view not in self._stills:
            self._stills[view] = self.renderer().draw(course, camera, None, size, profile).read()
            if len(self._stills) > STILLS:
                self._stills.popitem(last=False)
        self._stills.move_to_end(view)
        return self._stills[view]

    def renderer(self) -> Renderer:
        """Return the renderer; the context is current."""
        if self._renderer is None:
            from minigolf_env.rendering.gl.renderer import Renderer

            self._renderer = Renderer()
        return self._renderer


def _make_context() -> Context:
    if platform.system() == "Linux":
        return HeadlessContext()
    from minigolf_env.rendering.window import HiddenWindow

    return HiddenWindow()


def studio() -> Studio:
    """Return this process's studio, made when first asked for."""
    with _FIRST:
        return _studio()


@functools.cache
def _studio() -> Studio:
    return Studio()
