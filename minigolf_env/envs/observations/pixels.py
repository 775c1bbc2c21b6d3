"""The observation "pixels": an image of the course from above.

The renderer draws each course once, as a G-buffer. A compiled kernel puts the ball into it, see ``compositing.py``.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import cast
from weakref import WeakKeyDictionary

import numpy as np
from gymnasium import Space
from gymnasium.spaces import Box
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.observations.compositing import NO_NORMAL, TopView, composite_range
from minigolf_env.envs.task import TaskBatch
from minigolf_env.physics.batch import for_each_range
from minigolf_env.rendering.camera import Camera, top_camera
from minigolf_env.rendering.lighting import LIGHTING

IMAGE_SIZE = 84
"""Width and height of the image, pixels, as for deep Q-networks."""

MIN_MARKER_PIXELS = 2.5
"""Smallest radius of the ball's marker in the image, pixels: in its true size the ball would be less than one."""

STROKES_BAR_HEIGHT = 2
"""Height of the bar at the bottom, pixels; its white part is the fraction of the strokes that is left."""

MAX_CACHED_VIEWS = 1300
"""Number of courses whose views are kept; each takes 99 kB, all of them 128 MB."""

MAX_VIEWS_PER_CALL = 512
"""Number of courses whose views a call of the kernel holds."""

_views: WeakKeyDictionary[Course, TopView] = WeakKeyDictionary()
"""Views of courses, the least recently used first. A view is dropped with its course."""

_lock = threading.Lock()
"""Held while the views are looked up or drawn."""


def pixel_space() -> Space[NDArray[np.uint8]]:
    """Return the space of "pixels" observations (84, 84, 3)."""
    return cast(Space[NDArray[np.uint8]], Box(0, 255, (IMAGE_SIZE, IMAGE_SIZE, 3), np.uint8))


def observe_pixels(
    task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64], state: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Return images (N, 84, 84, 3) of balls at positions (N, 3), m, after a number of strokes (N,).

    Raises:
        RenderingError: a course has to be drawn, and OpenGL is not available.
    """
    images = np.empty((len(positions), IMAGE_SIZE, IMAGE_SIZE, 3), np.uint8)
    rows_per_task = len(positions) // len(task.tasks)
    # A part of the courses at a time: views of more courses than are kept need not be in memory together.
    for first_task in range(0, len(task.tasks), MAX_VIEWS_PER_CALL):
        tasks = task.tasks[first_task : first_task + MAX_VIEWS_PER_CALL]
        rows = slice(first_task * rows_per_task, (first_task + len(tasks)) * rows_per_task)
        _composite([top_view(single.course) for single in tasks], positions[rows], images[rows])
    strokes_left = 1.0 - strokes / task.max_strokes
    is_white = np.arange(IMAGE_SIZE) < IMAGE_SIZE * strokes_left[:, None]
    images[:, -STROKES_BAR_HEIGHT:] = np.where(is_white, 255, 0)[:, None, :, None]
    return images


def _composite(views: Sequence[TopView], positions: FloatArray, images: NDArray[np.uint8]) -> None:
    """Write the images (N, 84, 84, 3) of balls at positions (N, 3), m, of which each view has N / M, on all threads."""

    def composite_rows(first: int, last: int, view: TopView) -> None:
        composite_range(first, last, view, LIGHTING, positions, images)

    for_each_range(views, len(positions), composite_rows)


def top_view(course: Course) -> TopView:
    """Return the view of a course; it is drawn unless it is among the MAX_CACHED_VIEWS most recently used.

    Raises:
        RenderingError: OpenGL is not available.
    """
    with _lock:
        view = _views.pop(course, None)
        if view is None:
            view = _draw_top_view(course)
            if len(_views) >= MAX_CACHED_VIEWS:
                del _views[next(iter(_views))]
        _views[course] = view
        return view


def marker_view(course: Course) -> tuple[Camera, float]:
    """Return the camera of the image, and the radius of the marker, m."""
    camera = top_camera(course, 1.0)
    pixels_per_metre = camera.pixels_per_metre(camera.eye[2] - course.tee.height, IMAGE_SIZE)
    return camera, max(course.ball_radius, MIN_MARKER_PIXELS / pixels_per_metre)


def _draw_top_view(course: Course) -> TopView:
    """Return the view of a course, drawn by the renderer."""
    from minigolf_env.rendering.gl.offscreen import draw_gbuffer

    camera, marker_radius = marker_view(course)
    gbuffer = draw_gbuffer(course, camera, (IMAGE_SIZE, IMAGE_SIZE))
    can_be_darkened = (gbuffer.normal != NO_NORMAL).any(axis=2)
    max_distance = float(gbuffer.distance.max(where=can_be_darkened, initial=0.0))
    return TopView(*gbuffer, camera.pixels_per_metre(1.0, IMAGE_SIZE), *camera.eye, max_distance, marker_radius)
