"""What moves in a picture and what of the picture it may change. Numpy only; the light is the shaders'."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.frame import Frame
from minigolf_env.rendering.models import CLOTH_LENGTH, POLE_HEIGHT

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

CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
"""Of a cube (8, 3)."""


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
    middles, halves = np.array([cube[0] for cube in cubes]), np.array([cube[1] for cube in cubes])
    points = (middles[:, None] + halves[:, None, None] * CORNERS).reshape(-1, 3)
    at = np.append(points, np.ones((len(points), 1)), axis=1) @ camera.clip_from_world(size[0] / size[1]).T
    if at[:, 3].min() <= 0.0:
        return Box(0, 0, *size)  # Something is behind the camera: it has no place in the picture.
    x, y = at[:, 0] / at[:, 3], -at[:, 1] / at[:, 3]
    pixels = 0.5 * np.array([[x.min() + 1.0, y.min() + 1.0], [x.max() + 1.0, y.max() + 1.0]]) * size
    (left, top), (right, bottom) = np.clip(np.floor(pixels) + ROUND, 0, size).astype(int).tolist()
    return Box(left, top, right, bottom)


@functools.lru_cache(maxsize=64)
def _lowest(course: Course) -> float:
    return min(float(part.mesh.vertices[:, 2].min()) for part in course.parts)


def _fall(place: FloatArray, lowest: float) -> float:
    """Return how far a place's shadow is from it at most, m."""
    return max(0.0, float(place[2]) - lowest) / float(SUN[2])
