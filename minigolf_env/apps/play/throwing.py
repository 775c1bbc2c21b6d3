"""A room without golf: a ball is thrown from the tee, and bounces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from minigolf_env.apps.play.aim import Aim
from minigolf_env.apps.play.game import YOU, Stroke, foreseen
from minigolf_env.courses import Course

FloatArray = NDArray[np.float64]

LONGEST = 20.0
"""Of a throw, s: some balls tremble for ever."""


class Throwing:
    """Throws from the tee of a course without cup, each from the same place.

    Args:
        course: the course.
    """

    elevation = 30.0
    """Of throws above the horizon at first, degrees."""

    def __init__(self, course: Course) -> None:
        self.course = course
        self.top_speed = course.top_speed
        self.strokes = 0
        self.ball: FloatArray = np.array([*course.tee.centre, course.tee.height + course.ball_radius])
        self._world = course.world()

    @property
    def shown(self) -> FloatArray:
        """The ball (3,), m."""
        return self.ball

    def velocity(self, aim: Aim) -> FloatArray:
        """Return what a throw launches the ball with (3,), m/s."""
        return self.top_speed * aim.power * aim.direction

    def strike(self, aim: Aim) -> Stroke:
        """Throw the ball."""
        shot = self._world.simulate(self.ball, self.velocity(aim), LONGEST, record=True)
        self.strokes += 1
        return Stroke(YOU, np.asarray(shot.path), np.asarray(shot.times), self.ball, shot.status.name.lower())

    def foresee(self, aim: Aim) -> FloatArray:
        """Return the way (K, 3), m, up to the first bounce and a little on."""
        return foreseen(self._world, self.ball, self.velocity(aim))
