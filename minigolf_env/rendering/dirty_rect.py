"""What moves in a picture and what of the picture it may change. Numpy only; the light is the shaders'."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.props import CLOTH_LENGTH, POLE_HEIGHT
from minigolf_env.rendering.scene_state import Frame

FloatArray = NDArray[np.float64]

SUN = np.array([-0.46, -0.38, 0.80]) / np.linalg.norm([-0.46, -0.38, 0.80])
"""Unit vector to the sun."""

CLOTH = np.array([-SUN[1], SUN[0]]) / np.hypot(SUN[0], SUN[1])
"""Unit vector (2,) along the flag's cloth: across the sun's way, so that it throws a shadow."""

DIMMED = 4.0
"""How far around itself the ball takes light away, in radii; surface.frag knows it too."""

SOFT = 0.1
"""How much wider shadows get with the distance from what throws them, at most; a little more than in surface.frag."""


ROUND = np.array([[-1.0], [2.0]])
"""A part of a picture in whole pixels, with one to spare."""

TINY = 1e-6
"""A distance from the camera, m."""

NEAR_AND_FAR = np.array([[[-1.0]], [[1.0]]])
"""Towards the camera, and away from it."""


class Box(NamedTuple):
    """A part of a picture, in pixels from its upper left corner."""

    left: int
    top: int
    right: int
    bottom: int


def flag_at_rest(course: Course) -> FloatArray:
    """Return the foot (3,) of the flag's pole on the cup's bottom, m; the origin without cup."""
    if course.cup is None:
        return np.zeros(3)
    x, y, rim = course.cup.position
    return np.array([x, y, rim - course.cup.depth])


def moving_part(course: Course, camera: Camera, frame: Frame, size: tuple[int, int]) -> Box:
    """Return the part of a picture of (width, height) pixels outside of which it shows no more than the course.

    In it are the ball with all that it takes light from, the flag with its shadow if it is lifted, and the lines.
    """
    lowest = _lowest(course)
    r, fall = frame.size * course.ball_radius, _fall(frame.ball, lowest)
    cubes = [(frame.ball, DIMMED * r), (frame.ball - fall * SUN, 2.0 * r + SOFT * fall)]
    rest = flag_at_rest(course)
    if not np.array_equal(frame.flag, rest):
        for foot in (rest, frame.flag):
            top = foot + np.array([0.0, 0.0, POLE_HEIGHT])
            fall = _fall(top, lowest)
            cubes += [
                (foot, CLOTH_LENGTH),
                (top, 1.2 * CLOTH_LENGTH),
                (top - fall * SUN, 1.2 * CLOTH_LENGTH + SOFT * fall),
            ]
    cubes += [(point, line.width) for line in frame.lines for point in line.points]
    middles, halves = np.array([middle for middle, _ in cubes]), np.array([[half] * 3 for _, half in cubes])
    lower, upper = seen_between(middles, halves, camera.clip_from_world(size[0] / size[1]))
    (left, top), (right, bottom) = (lower[:, 0].min(), -upper[:, 1].max()), (upper[:, 0].max(), -lower[:, 1].min())
    pixels = (0.5 + 0.5 * np.array([[left, top], [right, bottom]])) * size
    (left, top), (right, bottom) = np.clip(np.floor(pixels) + ROUND, 0, size).astype(int).tolist()
    return Box(left, top, right, bottom)


def seen_between(middles: FloatArray, halves: FloatArray, clip: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper bounds (N, 2) of where upright boxes are seen, x and y in [-1, 1] in the picture.

    Args:
        middles: (N, 3) of the boxes, m.
        halves: (N, 3) half their sizes, m.
        clip: (4, 4) to clip coordinates. A box that reaches behind the camera may be anywhere.
    """
    rows = clip[[0, 1, 3]]
    at, spread = middles @ rows[:, :3].T + rows[:, 3], halves @ np.abs(rows[:, :3]).T
    xy, w = np.stack([at - spread, at + spread])[..., :2], at[:, 2:] + spread[:, 2:] * NEAR_AND_FAR
    ends, behind = xy[:, None] / np.maximum(w, TINY), w[0] < TINY
    return np.where(behind, -np.inf, ends.min(axis=(0, 1))), np.where(behind, np.inf, ends.max(axis=(0, 1)))


@functools.lru_cache(maxsize=64)
def _lowest(course: Course) -> float:
    return min(float(part.mesh.vertices[:, 2].min()) for part in course.parts)


def _fall(place: FloatArray, lowest: float) -> float:
    """Return how far a place's shadow is from it at most, m."""
    return max(0.0, float(place[2]) - lowest) / float(SUN[2])
