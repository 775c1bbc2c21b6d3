"""Free-throw mode, in a room without a cup: the ball leaves the tee in three dimensions and bounces."""

from __future__ import annotations

import numpy as np

from minigolf_env.apps.play.aim import Aim
from minigolf_env.apps.play.stroke import HUMAN_NAME, FloatArray, PlayedStroke, path_to_first_bounce
from minigolf_env.courses import Course

MAX_THROW_TIME = 20.0
"""Longest time that a throw is simulated, s."""


class ThrowMode:
    """Throws from the tee of a course without a cup; every throw starts at the same place.

    Args:
        course: the course.
    """

    default_elevation = 30.0
    """Elevation of a throw before the player changes it, degrees above the horizon."""

    def __init__(self, course: Course) -> None:
        self.course = course
        self.top_speed = course.top_speed
        self.strokes = 0
        self.ball: FloatArray = np.array([*course.tee.centre, course.tee.height + course.ball_radius])
        self._world = course.world()

    @property
    def displayed_ball(self) -> FloatArray:
        """Centre of the ball (3,), m."""
        return self.ball

    def launch_velocity(self, aim: Aim) -> FloatArray:
        """Return the velocity (3,), m/s, at which a throw launches the ball."""
        return self.top_speed * aim.power * aim.direction

    def strike(self, aim: Aim) -> PlayedStroke:
        """Throw the ball."""
        shot = self._world.simulate(self.ball, self.launch_velocity(aim), MAX_THROW_TIME, record=True)
        self.strokes += 1
        status = shot.status.name.lower()
        return PlayedStroke(HUMAN_NAME, np.asarray(shot.path), np.asarray(shot.times), self.ball, status)

    def predict_path(self, aim: Aim) -> FloatArray:
        """Return the path (K, 3), m, to shortly after the first bounce."""
        return path_to_first_bounce(self._world, self.ball, self.launch_velocity(aim))
