"""The replay of a putt: poses of ball, flag and camera at any time."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera, make_camera
from minigolf_env.rendering.props import flag_rest_position
from minigolf_env.rendering.scene_state import Color, Line, SceneState

FloatArray = NDArray[np.float64]

PAUSE_AFTER_PUTT = 0.6
"""Time for which the end of a putt is shown, s; meanwhile the following camera turns to the next putt."""

TRAIL_DURATION = 1.2
"""Time that the trail behind the ball covers, s."""

TRAIL_WIDTH = 0.5
"""Width of the trail, in diameters of the ball."""

FOLLOW_SAMPLE_RATE = 60
"""Samples per second of the following camera's path."""

FOLLOW_TIME_CONSTANT = 0.16
"""Time constant of the two low-pass filters that smooth the following camera's path, s."""

FLAG_LIFT_RADIUS = 0.7
"""Distance of the ball to the cup below which the flag is lifted, m."""

FLAG_LIFT_HEIGHT = 0.45
"""Height by which the flag is lifted when the ball is at the cup, m."""


def static_view(
    course: Course, camera: str, aspect: float, ball: FloatArray, time: float = 0.0
) -> tuple[Camera, SceneState]:
    """Return camera and scene state of a ball (3,) at rest, after ``time`` seconds of play."""
    state = SceneState(ball, np.eye(3), flag_position(course, ball))
    return make_camera(camera, course, ball, aspect, time), state


class Replay:
    """Replay of one putt, from time 0 to ``duration`` (s).

    Args:
        course: the course on which it was played.
        path: centre of the ball (T, 3) at ``times``, m.
        times: (T,) increasing from 0, s.
        camera: one of CAMERA_NAMES.
        aspect: width / height of the images.
        rotation: rotation matrix (3, 3) of the ball before the putt; None: the identity.
        start_time: seconds of play before the putt.
        next_position: position (3,) of the ball for the next putt, to which a following camera turns at the end; None:
            the end of the path. The two differ after a ball out of bounds.
        previous_camera: the camera at the end of the previous putt, from which a following camera starts.
    """

    def __init__(
        self,
        course: Course,
        path: FloatArray,
        times: FloatArray,
        camera: str,
        aspect: float,
        *,
        rotation: FloatArray | None = None,
        start_time: float = 0.0,
        next_position: FloatArray | None = None,
        previous_camera: Camera | None = None,
    ) -> None:
        self.course = course
        self.shot_time = float(times[-1])
        """Time for which the ball moves, s."""
        self.duration = self.shot_time + PAUSE_AFTER_PUTT
        """Length of the replay, s."""
        self._path = path
        self._times = times
        self._rotations = _rolling_rotations(path, course.ball_radius, np.eye(3) if rotation is None else rotation)
        self._camera_name = camera
        self._aspect = aspect
        self._start_time = start_time
        self._next_position = path[-1] if next_position is None else next_position
        self._previous_camera = previous_camera

    @property
    def final_rotation(self) -> FloatArray:
        """Return the ball's rotation matrix (3, 3) at the end."""
        return np.asarray(self._rotations[-1])

    @property
    def final_camera(self) -> Camera:
        """Return the camera at the end."""
        return self.camera(self.duration)

    def frame_times(self, fps: int) -> FloatArray:
        """Return the times of the frames of a video, s."""
        return np.arange(frame_count(self.shot_time, fps)) / fps

    def view(self, time: float) -> tuple[Camera, SceneState]:
        """Return camera and scene state at a time, s."""
        return self.camera(time), self.scene_state(time)

    def scene_state(self, time: float) -> SceneState:
        """Return the poses of ball and flag, and the trail, at a time, s."""
        ball = self._ball_position(time)
        step = int(np.searchsorted(self._times, time, side="right")) - 1
        return SceneState(ball, self._rotations[step], flag_position(self.course, ball), self._trail(time))

    def camera(self, time: float) -> Camera:
        """Return the camera at a time, s."""
        if self._camera_name != "follow":
            ball = self._ball_position(time)
            return make_camera(self._camera_name, self.course, ball, self._aspect, self._start_time + time)
        # Interpolate linearly between the samples of the smoothed path.
        poses = self._follow_poses
        sample = min(time * FOLLOW_SAMPLE_RATE, len(poses) - 1.0)
        k = min(int(sample), len(poses) - 2)
        eye, target = (poses[k] + (sample - k) * (poses[k + 1] - poses[k])).tolist()
        return Camera(tuple(eye), tuple(target))

    def path_line(self, num_points: int) -> Line:
        """Return the whole path of the ball as a line of ``num_points`` points."""
        times = np.linspace(0.0, self.shot_time, num_points)
        return self._line(times, (1.0, 1.0, 1.0, 0.15), (1.0, 1.0, 1.0, 0.45))

    def _ball_position(self, time: float) -> FloatArray:
        """Return the centre of the ball (3,) at a time, s."""
        return np.array([np.interp(time, self._times, self._path[:, k]) for k in range(3)])

    @functools.cached_property
    def _follow_poses(self) -> FloatArray:
        """Return eye and target (K, 2, 3) of the following camera, FOLLOW_SAMPLE_RATE per second.

        The path is smooth, also across putts: it starts at the previous putt's camera.
        """
        times = np.arange(math.ceil(self.duration * FOLLOW_SAMPLE_RATE) + 1) / FOLLOW_SAMPLE_RATE
        balls = [self._ball_position(time) if time <= self.shot_time else self._next_position for time in times]
        cameras = [make_camera("follow", self.course, ball, self._aspect) for ball in balls]
        poses = np.array([(camera.eye, camera.target) for camera in cameras])
        if self._previous_camera is not None:
            poses[0] = self._previous_camera.eye, self._previous_camera.target
        # Two first-order low-pass filters in a row.
        gain = 1.0 - math.exp(-1.0 / (FOLLOW_SAMPLE_RATE * FOLLOW_TIME_CONSTANT))
        for _ in range(2):
            for k in range(1, len(poses)):
                poses[k] = poses[k - 1] + gain * (poses[k] - poses[k - 1])
        return poses

    def _trail(self, time: float) -> tuple[Line, ...]:
        """Return the most recent part of the ball's path, which fades after the end of the putt; none when faded."""
        end = min(time, self.shot_time)
        opacity = 1.0 - (time - end) / PAUSE_AFTER_PUTT
        if opacity <= 0.0 or end == 0.0:
            return ()
        times = np.linspace(max(0.0, end - TRAIL_DURATION), end, 40)
        return (self._line(times, (1.0, 1.0, 1.0, 0.0), (1.0, 1.0, 1.0, 0.45 * opacity)),)

    def _line(self, times: FloatArray, start_color: Color, end_color: Color) -> Line:
        """Return the path at some times as a line just above the ground."""
        points = np.stack([np.interp(times, self._times, self._path[:, k]) for k in range(3)], axis=-1)
        points[:, 2] -= 0.9 * self.course.ball_radius
        return Line(points, 2.0 * TRAIL_WIDTH * self.course.ball_radius, start_color, end_color)


def frame_count(shot_time: float, fps: int) -> int:
    """Return the number of frames of a putt whose ball moves for ``shot_time`` seconds, at ``fps`` per second."""
    return math.ceil((shot_time + PAUSE_AFTER_PUTT) * fps)


def flag_position(course: Course, ball: FloatArray) -> FloatArray:
    """Return the foot (3,) of the flag's pole for a ball (3,), m: in the cup, or lifted while the ball is near."""
    foot = flag_rest_position(course)
    closeness = 1.0 - min(1.0, math.hypot(ball[0] - foot[0], ball[1] - foot[1]) / FLAG_LIFT_RADIUS)
    lift = FLAG_LIFT_HEIGHT * closeness * closeness * (3.0 - 2.0 * closeness)
    return np.asarray(foot + np.array([0.0, 0.0, lift]))


def _rolling_rotations(path: FloatArray, radius: float, start: FloatArray) -> FloatArray:
    """Return the rotations (T, 3, 3) of a ball that rolls along a path (T, 3) without slipping, from ``start`` on."""
    # Axis and angle of each step; the axis is horizontal.
    steps = np.diff(path, axis=0)
    lengths = np.linalg.norm(steps[:, :2], axis=1)
    x, y = (-steps[:, 1], steps[:, 0]) / np.maximum(lengths, 1e-12)
    sine = np.sin(lengths / radius)
    versine = 1.0 - np.cos(lengths / radius)
    # Rodrigues' formula.
    zero = np.zeros_like(x)
    cross = np.stack([zero, zero, y, zero, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    increments = np.eye(3) + sine[:, None, None] * cross + versine[:, None, None] * (cross @ cross)
    rotations = np.empty((len(path), 3, 3))
    rotations[0] = start
    for k, increment in enumerate(increments):
        rotations[k + 1] = increment @ rotations[k]
    return np.asarray(rotations)
