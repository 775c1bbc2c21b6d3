"""A putt as something to watch: where ball, flag and camera are at any time of it. Numpy only."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera, view
from minigolf_env.rendering.dirty_rect import flag_at_rest
from minigolf_env.rendering.scene_state import Color, Frame, Line

FloatArray = NDArray[np.float64]

PAUSE = 0.6
"""How long the end of a putt is shown before the next, s: the camera turns to the next putt meanwhile."""

TRAIL = 1.2
"""How much of its way the ball draws behind itself, s."""

TRAIL_WIDTH = 0.5
"""In diameters of the ball."""

CAMERA_RATE = 60
"""Places a second through which a following camera moves."""

CAMERA_LAG = 0.16
"""Time constant of its two smoothing filters, s."""

FLAG_NEAR, FLAG_LIFT = 0.7, 0.45
"""The flag is lifted when the ball is nearer than this to the cup, and how far, m."""


def still(course: Course, camera: str, aspect: float, ball: FloatArray, time: float = 0.0) -> tuple[Camera, Frame]:
    """Return the picture of a ball (3,) that lies still, after ``time`` seconds of play."""
    return view(camera, course, ball, aspect, time), Frame(ball, np.eye(3), flag_foot(course, ball))


class Replay:
    """One putt, to be looked at from a camera at any time from 0 to ``duration`` (s).

    Args:
        course: where it was played.
        path: (T, 3) the ball's centre at ``times``, m.
        times: (T,) rising from 0, s.
        camera: one of CAMERAS.
        aspect: width / height of the pictures.
        turn: (3, 3) how the ball had rolled before.
        clock: seconds of play before the putt.
        lies: (3,) where the ball lies for the next putt, to which a following camera turns at the end.
        before: the camera at the end of the putt before, from which a following camera starts.
    """

    def __init__(
        self,
        course: Course,
        path: FloatArray,
        times: FloatArray,
        camera: str,
        aspect: float,
        *,
        turn: FloatArray | None = None,
        clock: float = 0.0,
        lies: FloatArray | None = None,
        before: Camera | None = None,
    ) -> None:
        self.course = course
        self.time = float(times[-1])
        """How long the ball moves, s."""
        self.duration = self.time + PAUSE
        self._path, self._times = path, times
        self._turns = _rolling(path, course.ball_radius, np.eye(3) if turn is None else turn)
        self._camera, self._aspect, self._clock = camera, aspect, clock
        self._lies, self._before = path[-1] if lies is None else lies, before

    @property
    def last_turn(self) -> FloatArray:
        """How the ball has rolled in the end (3, 3)."""
        return np.asarray(self._turns[-1])

    @property
    def last_camera(self) -> Camera:
        """The camera in the end."""
        return self.camera(self.duration)

    def at(self, time: float) -> tuple[Camera, Frame]:
        """Return what is seen at a time, s."""
        return self.camera(time), self.frame(time)

    def moments(self, fps: int) -> FloatArray:
        """Return the times of the pictures of a video, s."""
        return np.arange(picture_count(self.time, fps)) / fps

    def frame(self, time: float) -> Frame:
        """Return where things are at a time, s."""
        ball = self._ball(time)
        step = int(np.searchsorted(self._times, time, side="right")) - 1
        return Frame(ball, self._turns[step], flag_foot(self.course, ball), self._trail(time))

    def camera(self, time: float) -> Camera:
        """Return the camera at a time, s."""
        if self._camera != "follow":
            return view(self._camera, self.course, self._ball(time), self._aspect, self._clock + time)
        at = min(time * CAMERA_RATE, len(self._eyes) - 1.0)
        k = min(int(at), len(self._eyes) - 2)
        eye, target = (self._eyes[k] + (at - k) * (self._eyes[k + 1] - self._eyes[k])).tolist()
        return Camera(tuple(eye), tuple(target))

    def way(self, points: int) -> Line:
        """Return the whole way of the ball, as a line of so many points."""
        moments = np.linspace(0.0, self.time, points)
        return self._band(moments, (1.0, 1.0, 1.0, 0.15), (1.0, 1.0, 1.0, 0.45))

    def _ball(self, time: float) -> FloatArray:
        return np.array([np.interp(time, self._times, self._path[:, k]) for k in range(3)])

    @functools.cached_property
    def _eyes(self) -> FloatArray:
        """Return eye and target (K, 2, 3) of a following camera, CAMERA_RATE a second: smooth from the putt before."""
        moments = np.arange(math.ceil(self.duration * CAMERA_RATE) + 1) / CAMERA_RATE
        balls = [self._ball(time) if time <= self.time else self._lies for time in moments]
        aims = [view("follow", self.course, ball, self._aspect) for ball in balls]
        poses = np.array([(aim.eye, aim.target) for aim in aims])
        if self._before is not None:
            poses[0] = self._before.eye, self._before.target
        share = 1.0 - math.exp(-1.0 / (CAMERA_RATE * CAMERA_LAG))
        for _ in range(2):
            for k in range(1, len(poses)):
                poses[k] = poses[k - 1] + share * (poses[k] - poses[k - 1])
        return poses

    def _trail(self, time: float) -> tuple[Line, ...]:
        """Return the last of the way, which fades at the end of the putt."""
        now = min(time, self.time)
        fade = 1.0 - (time - now) / PAUSE
        if fade <= 0.0 or now == 0.0:
            return ()
        moments = np.linspace(max(0.0, now - TRAIL), now, 40)
        return (self._band(moments, (1.0, 1.0, 1.0, 0.0), (1.0, 1.0, 1.0, 0.45 * fade)),)

    def _band(self, moments: FloatArray, start: Color, end: Color) -> Line:
        points = np.stack([np.interp(moments, self._times, self._path[:, k]) for k in range(3)], axis=-1)
        points[:, 2] -= 0.9 * self.course.ball_radius
        return Line(points, 2.0 * TRAIL_WIDTH * self.course.ball_radius, start, end)


def picture_count(time: float, fps: int) -> int:
    """Return how many pictures a putt has whose ball moves for a time, s, at ``fps`` a second."""
    return math.ceil((time + PAUSE) * fps)


def flag_foot(course: Course, ball: FloatArray) -> FloatArray:
    """Return the foot of the flag's pole (3,), m: on the cup's bottom, or lifted while the ball is near."""
    foot = flag_at_rest(course)
    near = 1.0 - min(1.0, math.hypot(ball[0] - foot[0], ball[1] - foot[1]) / FLAG_NEAR)
    return np.asarray(foot + np.array([0.0, 0.0, FLAG_LIFT * near * near * (3.0 - 2.0 * near)]))


def _rolling(path: FloatArray, radius: float, turn: FloatArray) -> FloatArray:
    """Return how a ball that rolls along a path without slipping has turned (T, 3, 3), from ``turn`` on."""
    way = np.diff(path, axis=0)
    length = np.linalg.norm(way[:, :2], axis=1)
    x, y = (-way[:, 1], way[:, 0]) / np.maximum(length, 1e-12)
    sin, cos = np.sin(length / radius), 1.0 - np.cos(length / radius)
    zero = np.zeros_like(x)
    # Rodrigues' formula for a level axis.
    axis = np.stack([zero, zero, y, zero, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    steps = np.eye(3) + sin[:, None, None] * axis + cos[:, None, None] * (axis @ axis)
    turns = np.empty((len(path), 3, 3))
    turns[0] = turn
    for k, step in enumerate(steps):
        turns[k + 1] = step @ turns[k]
    return np.asarray(turns)
