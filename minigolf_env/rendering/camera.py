"""Cameras: position, direction and projection of a view, and the cameras that users choose by name.

World coordinates are in metres with z up; a camera looks along ``target - eye``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.props import POLE_HEIGHT

FloatArray = NDArray[np.float64]

CAMERA_NAMES = ("follow", "top", "tee", "orbit")
"""Names of the cameras: behind the ball; above the course; behind the tee; circling around the course."""

DEFAULT_FOV = 40.0
"""Vertical field of view, degrees."""

TOP_FOV = 16.0
"""Vertical field of view of the top camera, degrees; narrow and far away, so that borders hide little behind them."""

FIT_MARGIN = 1.06
"""Width of a fitted view as a multiple of the width of its content."""

ORBIT_RATE = 12.0
"""Angular speed of the orbiting camera, degrees per second of simulated time."""

MIN_HEADING_DISTANCE = 0.2
"""Distance to the end of the route below which the following camera looks along its last segment, m.

Without it the camera would turn around when the ball rolls past the cup."""

NEAR_PLANE, FAR_PLANE = 0.02, 60.0
"""Distances of the clipping planes from the camera, m; both are larger for a camera that is far away."""


@dataclass(frozen=True)
class Camera:
    """A perspective camera."""

    eye: tuple[float, float, float]
    """Position of the camera, m."""
    target: tuple[float, float, float]
    """Point in the centre of the image, m."""
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Upward direction in the image; not parallel to the line of sight."""
    fov: float = DEFAULT_FOV
    """Vertical field of view, degrees."""
    near: float = 0.0
    """Distance from the camera, m, below which there is nothing to see: the depth buffer is the more precise."""

    def axes(self) -> FloatArray:
        """Return the unit vectors (3, 3) to the right, up, and along the line of sight."""
        forward = np.subtract(self.target, self.eye)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right = right / np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])

    @lru_cache(maxsize=64)  # noqa: B019 (cameras are small, and 64 of them are kept)
    def clip_from_world(self, aspect: float) -> FloatArray:
        """Return the matrix (4, 4) from world to OpenGL's clip coordinates; ``aspect`` is width / height."""
        right, up, forward = self.axes()
        view = np.eye(4)
        view[:3, :3] = right, up, -forward
        view[:3, 3] = -view[:3, :3] @ self.eye
        scale = 1.0 / math.tan(math.radians(self.fov) / 2.0)
        near, far = self.clipping_planes()
        projection = np.zeros((4, 4))
        projection[0, 0] = scale / aspect
        projection[1, 1] = scale
        projection[2, 2] = (far + near) / (near - far)
        projection[2, 3] = 2.0 * far * near / (near - far)
        projection[3, 2] = -1.0
        matrix = projection @ view
        matrix.flags.writeable = False
        return matrix

    def clipping_planes(self) -> tuple[float, float]:
        """Return the distances of the near and of the far clipping plane from the camera, m."""
        # A camera that fits a course into a long or narrow image is far away: both clipping planes move with it.
        depth_scale = max(1.0, 3.0 * math.dist(self.eye, self.target) / FAR_PLANE)
        return max(self.near, depth_scale * NEAR_PLANE), depth_scale * FAR_PLANE

    def pixels_per_metre(self, distance: float, height: int) -> float:
        """Return the size in pixels of a metre at a distance (m) in an image of a height (pixels)."""
        return height / (2.0 * math.tan(math.radians(self.fov) / 2.0) * max(distance, NEAR_PLANE))

    def ray(self, x: float, y: float, aspect: float) -> tuple[FloatArray, FloatArray]:
        """Return start and unit direction (3,) of the ray through a point of the image; x, y in [-1, 1], y up."""
        right, up, forward = self.axes()
        half_height = math.tan(math.radians(self.fov) / 2.0)
        direction = forward + x * half_height * aspect * right + y * half_height * up
        return np.asarray(self.eye), direction / np.linalg.norm(direction)


def make_camera(name: str, course: Course, ball: ArrayLike, aspect: float, time: float = 0.0) -> Camera:
    """Return the camera with a name in CAMERA_NAMES for a ball (3,) at a time (s); ``aspect`` is width / height."""
    if name == "top":
        return top_camera(course, aspect)
    if name == "tee":
        return tee_camera(course, aspect)
    if name == "orbit":
        return orbit_camera(course, aspect, time)
    return follow_camera(course, ball, aspect)


def top_camera(course: Course, aspect: float) -> Camera:
    """Return the camera above the course; x to the right, y up."""
    camera = _fit_course(course, (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), TOP_FOV, aspect)
    flag_top = course.cup.position[2] + POLE_HEIGHT if course.cup is not None else -math.inf
    return replace(camera, near=0.5 * (camera.eye[2] - max(course.bounds[1][2], flag_top)))


def tee_camera(course: Course, aspect: float) -> Camera:
    """Return the camera behind the tee that sees the whole course along the first segment of its route."""
    heading = np.append(_heading(course, course.tee.centre, 0.5), 0.0)
    return _fit_course(course, _triple(heading + np.array([0.0, 0.0, -0.75])), (0.0, 0.0, 1.0), DEFAULT_FOV, aspect)


def orbit_camera(course: Course, aspect: float, time: float = 0.0) -> Camera:
    """Return the camera that circles around the course and sees all of it, after ``time`` seconds."""
    azimuth = math.radians(60.0 + ORBIT_RATE * time)
    direction = (math.cos(azimuth), math.sin(azimuth), -0.8)
    return _fit_course(course, direction, (0.0, 0.0, 1.0), DEFAULT_FOV, aspect)


def follow_camera(course: Course, ball: ArrayLike, aspect: float) -> Camera:
    """Return the camera behind the ball (3,), m, that looks along the route towards the cup.

    The closer the cup, the closer the camera. On a course without a cup it is the orbiting camera at time 0.
    """
    x, y, z = (float(c) for c in np.asarray(ball, dtype=np.float64))
    if course.cup is None:
        return orbit_camera(course, aspect)
    heading = _heading(course, (x, y), 1.2)
    cup_distance = math.hypot(course.cup.position[0] - x, course.cup.position[1] - y)
    if cup_distance < course.cup.radius:
        z = max(z, course.cup.position[2] + course.ball_radius)  # The camera does not follow the ball into the cup.
    distance_factor = min(1.0, cup_distance / 2.0)
    distance_behind = 0.55 + 0.55 * distance_factor
    height = 0.42 + 0.4 * distance_factor
    distance_ahead = 0.25 + 0.4 * distance_factor
    eye = (x - distance_behind * heading[0], y - distance_behind * heading[1], z + height)
    target = (x + distance_ahead * heading[0], y + distance_ahead * heading[1], z)
    return Camera(eye, target)


def fit_camera(points: FloatArray, direction: ArrayLike, up: ArrayLike, fov: float, aspect: float) -> Camera:
    """Return the closest camera that looks along ``direction`` and has all points (N, 3) in its image, centred.

    A point x to the right and z ahead of the origin is inside the image's right border of slope t for a camera at
    (s, -d) if (x - s) / t - z <= d; the left, upper and lower borders alike. Each pair of borders gives the smallest d
    and its s in closed form.
    """
    forward = np.asarray(direction, dtype=np.float64)
    right, above, forward = Camera((0.0, 0.0, 0.0), _triple(forward), _triple(up)).axes()
    slope = math.tan(math.radians(fov) / 2.0) / FIT_MARGIN
    ahead = points @ forward
    eye = np.zeros(3)
    distance = -math.inf
    for axis, t in ((right, slope * aspect), (above, slope)):
        upper = (points @ axis / t - ahead).max()
        lower = (-(points @ axis) / t - ahead).max()
        eye += axis * (t * (upper - lower) / 2.0)
        distance = max(distance, (upper + lower) / 2.0)
    eye -= forward * distance
    return Camera(_triple(eye), _triple(eye + forward * (distance + float(ahead.mean()))), _triple(up), fov)


def interpolate_cameras(a: Camera, b: Camera, fraction: float) -> Camera:
    """Return the camera at a fraction of the way from a to b."""

    def mix(x: tuple[float, float, float], y: tuple[float, float, float]) -> tuple[float, float, float]:
        return _triple(np.asarray(x) + fraction * np.subtract(y, x))

    return Camera(mix(a.eye, b.eye), mix(a.target, b.target), mix(a.up, b.up), a.fov + fraction * (b.fov - a.fov))


@lru_cache(maxsize=64)
def _fit_course(
    course: Course, direction: tuple[float, float, float], up: tuple[float, float, float], fov: float, aspect: float
) -> Camera:
    """Return the fitted camera of a whole course with its flag."""
    points = [part.mesh.vertices for part in course.parts]
    if course.cup is not None:
        points.append(np.add(course.cup.position, [(0.0, 0.0, POLE_HEIGHT)]))
    return fit_camera(np.concatenate(points), direction, up, fov, aspect)


def _heading(course: Course, position: tuple[float, float], lookahead: float) -> FloatArray:
    """Return the unit vector (2,) from a position to the point ``lookahead`` metres further along the route."""
    # The closest point of the route.
    route = np.asarray(course.route) if course.route else np.array([position, np.add(position, (1.0, 0.0))])
    starts = route[:-1]
    segments = np.diff(route, axis=0)
    lengths = np.hypot(*segments.T)
    fractions = np.clip(np.sum((position - starts) * segments, axis=1) / lengths**2, 0.0, 1.0)
    projections = starts + fractions[:, None] * segments
    closest = int(np.argmin(np.hypot(*(projections - position).T)))
    # The point further along the route.
    arc_lengths = np.concatenate([[0.0], np.cumsum(lengths)])
    arc_length = float(arc_lengths[closest] + fractions[closest] * lengths[closest]) + lookahead
    goal = np.array([np.interp(arc_length, arc_lengths, route[:, k]) for k in (0, 1)])
    delta = goal - position
    distance = float(np.hypot(*delta))
    return delta / distance if distance > MIN_HEADING_DISTANCE else segments[-1] / lengths[-1]


def _triple(vector: ArrayLike) -> tuple[float, float, float]:
    """Return a vector (3,) as a tuple of floats."""
    x, y, z = np.asarray(vector, dtype=np.float64).tolist()
    return x, y, z
