"""The observation "pixels": an image of the course from above, drawn by the renderer."""

from __future__ import annotations

from typing import cast

import numpy as np
from gymnasium import Space
from gymnasium.spaces import Box
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.task import TaskBatch
from minigolf_env.rendering import flag_rest_position, static_view

IMAGE_SIZE = 84
"""Width and height of the image, pixels, as for deep Q-networks."""

MIN_BALL_PIXELS = 2.5
"""Smallest radius of the ball in the image, pixels: in its true size it would be less than one."""

STROKES_BAR_HEIGHT = 2
"""Height of the bar at the bottom, pixels; its white part is the fraction of the strokes that is left."""

PIXELS_PROFILE = "fast"
"""Render profile of the image."""


def pixel_space() -> Space[NDArray[np.uint8]]:
    """Return the space of "pixels" observations (84, 84, 3)."""
    return cast(Space[NDArray[np.uint8]], Box(0, 255, (IMAGE_SIZE, IMAGE_SIZE, 3), np.uint8))


def observe_pixels(
    task: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64], state: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Return images (N, 84, 84, 3) of balls at positions (N, 3), m, after a number of strokes (N,).

    Raises:
        RenderingError: OpenGL is not available.
    """
    if len(task.tasks) == 1:
        drawn = _draw_from_above(task.tasks[0].course, positions)
    else:
        pairs = zip(task.tasks, positions, strict=True)
        drawn = [_draw_from_above(single.course, ball[None])[0] for single, ball in pairs]
    images = np.stack(drawn)
    strokes_left = 1.0 - strokes / task.max_strokes
    is_white = np.arange(IMAGE_SIZE) < IMAGE_SIZE * strokes_left[:, None]
    images[:, -STROKES_BAR_HEIGHT:] = np.where(is_white, 255, 0)[:, None, :, None]
    return images


def _draw_from_above(course: Course, balls: FloatArray) -> list[NDArray[np.uint8]]:
    """Return the images of balls (N, 3), m, on a course."""
    from minigolf_env.rendering.gl.offscreen import draw_many

    camera, state = static_view(course, "top", 1.0, balls[0])
    pixels_per_metre = camera.pixels_per_metre(camera.eye[2] - course.tee.height, IMAGE_SIZE)
    state = state._replace(ball_scale=max(1.0, MIN_BALL_PIXELS / (pixels_per_metre * course.ball_radius)))
    states = [state._replace(ball=ball, flag=flag_rest_position(course)) for ball in balls]
    return draw_many(course, camera, states, (IMAGE_SIZE, IMAGE_SIZE), PIXELS_PROFILE)
