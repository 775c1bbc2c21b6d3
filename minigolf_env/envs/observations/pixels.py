"""The observation "pixels": the course from above, drawn by the renderer."""

from __future__ import annotations

from typing import cast

import numpy as np
from gymnasium import Space
from gymnasium.spaces import Box
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.envs.task import FloatArray, TaskBatch
from minigolf_env.rendering import flag_rest_position, static_view

IMAGE_SIZE = 84
"""Pixels a side, as deep Q-networks have it."""

MIN_BALL_RADIUS = 2.5
"""The ball's radius in the picture is at least this, pixels: in its true size it would be less than one."""

STROKES_BAR_HEIGHT = 2
"""Rows at the bottom, pixels: their white part is the share of the strokes that is left."""

PIXEL_RENDER_PROFILE = "fast"


def pixel_space() -> Space[NDArray[np.uint8]]:
    """Return the space of "pixels" observations (SIDE, SIDE, 3)."""
    return cast(Space[NDArray[np.uint8]], Box(0, 255, (IMAGE_SIZE, IMAGE_SIZE, 3), np.uint8))


def observe_pixels(game: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return pictures (N, SIDE, SIDE, 3) of balls at positions (N, 3), m, after a number of strokes (N,).

    Raises:
        RenderingError: there is no OpenGL here.
    """
    if len(game.courses) == 1:
        drawn = _from_above(game.courses[0], positions)
    else:
        drawn = [_from_above(course, ball[None])[0] for course, ball in zip(game.courses, positions, strict=True)]
    pictures, left = np.stack(drawn), 1.0 - strokes / game.max_strokes
    is_white = np.arange(IMAGE_SIZE) < IMAGE_SIZE * left[:, None]
    pictures[:, -STROKES_BAR_HEIGHT:] = np.where(is_white, 255, 0)[:, None, :, None]
    return pictures


def _from_above(course: Course, balls: FloatArray) -> list[NDArray[np.uint8]]:
    """Return the pictures of balls (N, 3), m, on a course."""
    from minigolf_env.rendering.gl.offscreen import draw_many

    camera, state = static_view(course, "top", 1.0, balls[0])
    metre = camera.pixels_per_metre(camera.eye[2] - course.tee.height, IMAGE_SIZE)
    state = state._replace(ball_scale=max(1.0, MIN_BALL_RADIUS / (metre * course.ball_radius)))
    states = [state._replace(ball=ball, flag=flag_rest_position(course)) for ball in balls]
    return draw_many(course, camera, states, (IMAGE_SIZE, IMAGE_SIZE), PIXEL_RENDER_PROFILE)
