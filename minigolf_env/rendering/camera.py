"""Cameras: where a picture is taken from, and the views of a course that users name.

Numpy only. World coordinates are metres with z up; a camera looks along ``target - eye``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.props import POLE_HEIGHT

FloatArray = NDArray[np.float64]

CAMERAS = ("follow", "top", "tee", "orbit")
"""The views: behind the ball; from above; from behind the tee; turning around the course."""

FOV = 40.0
"""Vertical field of view, degrees."""

TOP_FOV = 16.0
"""The same from above: from so far that borders hide nothing behind them, degrees."""

MARGIN = 1.06
"""A fitted view is this much wider than what it shows."""

ORBIT_RATE = 12.0
"""How fast the orbiting camera turns, degrees a second of the time shown."""

NEAR_END = 0.2
"""Nearer to the cup a following camera looks along the last leg of the route: the ball may roll past the cup, m."""

NEAR, FAR = 0.02, 60.0
"""Planes between which things are drawn, m."""


@dataclass(frozen=True)
class Camera:
    """A place to look from."""

    eye: tuple[float, float, float]
    """m."""
    target: tuple[float, float, float]
    """The point in the middle of the picture, m."""
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """What is up in the picture; not along the line of sight."""
    fov: float = FOV
    """Vertical field of view, degrees."""

    def axes(self) -> FloatArray:
        """Return the unit vectors (3, 3) to the right, up, and along the line of sight."""
        forward = np.subtract(self.target, self.eye)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right = right / np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])

    @lru_cache(maxsize=64)  # noqa: B019 (cameras are small, and 64 of them are kept)
    def clip_from_world(self, aspect: float) -> FloatArray:
        """Return OpenGL's matrix (4, 4) from points (x, y, z, 1) to clip coordinates; ``aspect`` is width / height."""
        right, up, forward = self.axes()
        view = np.eye(4)
        view[:3, :3] = right, up, -forward
        view[:3, 3] = -view[:3, :3] @ self.eye
        scale = 1.0 / math.tan(math.radians(self.fov) / 2.0)
        projection = np.zeros((4, 4))
        projection[0, 0], projection[1, 1] = scale / aspect, scale
        away = max(1.0, 3.0 * math.dist(self.eye, self.target) / FAR)  # From afar, as above a long or narrow picture.
        near, far = away * NEAR, away * FAR
        projection[2, 2] = (far + near) / (near - far)
        projection[2, 3] = 2.0 * far * near / (near - far)
        projection[3, 2] = -1.0
        matrix = projection @ view
        matrix.flags.writeable = False
        return matrix

    def pixels_a_metre(self, distance: float, height: int) -> float:
        """Return how large a metre is at a distance (m) in a picture of a height (pixels)."""
        return height / (2.0 * math.tan(math.radians(self.fov) / 2.0) * max(distance, NEAR))

    def ray(self, x: float, y: float, aspect: float) -> tuple[FloatArray, FloatArray]:
        """Return start and unit direction (3,) of the ray through a point of the picture; x, y in [-1, 1], y up."""
        right, up, forward = self.axes()
        half = math.tan(math.radians(self.fov) / 2.0)
        direction = forward + x * half * aspect * right + y * half * up
        return np.asarray(self.eye), direction / np.linalg.norm(direction)


def fit(points: FloatArray, direction: ArrayLike, up: ArrayLike, fov: float, aspect: float) -> Camera:
    """Return the nearest camera that looks along ``direction`` and has all points (N, 3) in its picture, centred.

    A point x to the right and z ahead of the origin is inside the picture's right border of slope t for a camera at
    (s, -d) if (x - s) / t - z <= d; the left, upper and lower borders alike. Each pair of borders gives the smallest d
    and its s in closed form.
    """
    forward = np.asarray(direction, dtype=np.float64)
    right, above, forward = Camera((0.0, 0.0, 0.0), _triple(forward), _triple(up)).axes()
    slope = math.tan(math.radians(fov) / 2.0) / MARGIN
    ahead = points @ forward
    eye = np.zeros(3)
    away = -math.inf
    for axis, t in ((right, slope * aspect), (above, slope)):
        beyond, before = (points @ axis / t - ahead).max(), (-(points @ axis) / t - ahead).max()
        eye += axis * (t * (beyond - before) / 2.0)
        away = max(away, (beyond + before) / 2.0)
    eye -= forward * away
    return Camera(_triple(eye), _triple(eye + forward * (away + float(ahead.mean()))), _triple(up), fov)


def top_view(course: Course, aspect: float) -> Camera:
    """Return the view from above; x to the right, y up."""
    return _fitted(course, (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), TOP_FOV, aspect)


def tee_view(course: Course, aspect: float) -> Camera:
    """Return the view of the whole course from behind the tee, along the first leg of the route."""
    heading = np.append(_heading(course, course.tee.centre, 0.5), 0.0)
    return _fitted(course, _triple(heading + np.array([0.0, 0.0, -0.75])), (0.0, 0.0, 1.0), FOV, aspect)


def orbit_view(course: Course, aspect: float, time: float = 0.0) -> Camera:
    """Return the view of the whole course from a place that goes round it, after ``time`` seconds."""
    turn = math.radians(60.0 + ORBIT_RATE * time)
    direction = (math.cos(turn), math.sin(turn), -0.8)
    return _fitted(course, direction, (0.0, 0.0, 1.0), FOV, aspect)


def follow_view(course: Course, ball: ArrayLike, aspect: float) -> Camera:
    """Return the view from behind the ball (3,), m, towards where the course goes on from there.

    The nearer the cup, the closer the camera. In a course without cup it is the orbiting camera's first view.
    """
    x, y, z = (float(c) for c in np.asarray(ball, dtype=np.float64))
    if course.cup is None:
        return orbit_view(course, aspect)
    ahead = _heading(course, (x, y), 1.2)
    away = math.hypot(course.cup.position[0] - x, course.cup.position[1] - y)
    if away < course.cup.radius:
        z = max(z, course.cup.position[2] + course.ball_radius)  # Not down into the cup.
    near = min(1.0, away / 2.0)
    back, height, reach = 0.55 + 0.55 * near, 0.42 + 0.4 * near, 0.25 + 0.4 * near
    eye = (x - back * ahead[0], y - back * ahead[1], z + height)
    target = (x + reach * ahead[0], y + reach * ahead[1], z)
    return Camera(eye, target)


def view(name: str, course: Course, ball: ArrayLike, aspect: float, time: float = 0.0) -> Camera:
    """Return the camera of one of ``CAMERAS`` for a ball (3,) at a time (s)."""
    if name == "top":
        return top_view(course, aspect)
    if name == "tee":
        return tee_view(course, aspect)
    if name == "orbit":
        return orbit_view(course, aspect, time)
    return follow_view(course, ball, aspect)


def blend(a: Camera, b: Camera, share: float) -> Camera:
    """Return the camera a share of the way from a to b."""

    def mix(x: tuple[float, float, float], y: tuple[float, float, float]) -> tuple[float, float, float]:
        return _triple(np.asarray(x) + share * np.subtract(y, x))

    return Camera(mix(a.eye, b.eye), mix(a.target, b.target), mix(a.up, b.up), a.fov + share * (b.fov - a.fov))


@lru_cache(maxsize=64)
def _fitted(
    course: Course, direction: tuple[float, float, float], up: tuple[float, float, float], fov: float, aspect: float
) -> Camera:
    points = [part.mesh.vertices for part in course.parts]
    if course.cup is not None:
        points.append(np.add(course.cup.position, [(0.0, 0.0, POLE_HEIGHT)]))
    return fit(np.concatenate(points), direction, up, fov, aspect)


def _heading(course: Course, place: tuple[float, float], ahead: float) -> FloatArray:
    """Return the unit vector (2,) from a place to the point ``ahead`` metres further along the route."""
    route = np.asarray(course.route) if course.route else np.array([place, np.add(place, (1.0, 0.0))])
    starts, legs = route[:-1], np.diff(route, axis=0)
    lengths = np.hypot(*legs.T)
    share = np.clip(np.sum((place - starts) * legs, axis=1) / lengths**2, 0.0, 1.0)
    feet = starts + share[:, None] * legs
    leg = int(np.argmin(np.hypot(*(feet - place).T)))
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    along = float(ends[leg] + share[leg] * lengths[leg]) + ahead
    goal = np.array([np.interp(along, ends, route[:, k]) for k in (0, 1)])
    way = goal - place
    length = float(np.hypot(*way))
    return way / length if length > NEAR_END else legs[-1] / lengths[-1]


def _triple(vector: ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(vector, dtype=np.float64).tolist()
    return x, y, z
