"""The rules of the game: from an action to a launch velocity, and from a simulated shot to an outcome.

The rules have no state, and there is no other copy of them. Functions take arrays of any leading shape (...), one ball
or many; those that draw random numbers or simulate take N balls.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.courses import Course, Cup
from minigolf_env.envs.hole_params import FloatArray, HoleParams, RouteSegment
from minigolf_env.physics import Status, World, WorldBatch

MAX_PUTT_TIME = 30.0
"""Longest duration of a putt, s: several times as long as a ball rolls on any green."""


class Result(IntEnum):
    """Result of a stroke: a Status of the physics, or HOLED."""

    REST = Status.REST
    OUT_OF_BOUNDS = Status.OUT_OF_BOUNDS
    TIME_LIMIT = Status.TIME_LIMIT
    HOLED = 3


class Outcome(NamedTuple):
    """Outcome of strokes; each field has the leading shape (...) of the strokes."""

    position: FloatArray
    """(..., 3) the ball's centre for the next stroke, m: its resting place, or its old place if it is put back."""
    result: NDArray[np.int8]
    """(...) the Result of each stroke, as a number."""
    time: FloatArray
    """(...) duration of the ball's motion, s."""
    bounces: NDArray[np.int64]
    """(...) number of impacts that did not become resting contacts."""

    def reshape(self, *shape: int) -> Outcome:
        """Return the same strokes in another leading shape."""
        return Outcome(
            self.position.reshape(*shape, 3),
            self.result.reshape(shape),
            self.time.reshape(shape),
            self.bounces.reshape(shape),
        )

    @property
    def holed(self) -> NDArray[np.bool_]:
        """(...) bool: the ball is in the cup."""
        return np.asarray(self.result == Result.HOLED)


def action_space() -> Space[NDArray[np.float32]]:
    """Return the space of one environment's putts (2,)."""
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (2,), np.float32))


def components(array: FloatArray) -> tuple[FloatArray, ...]:
    """Return x, y and z, each (...), of vectors (..., 3).

    Arithmetic with whole components takes a tenth of the time of arithmetic with rows of three.
    """
    return tuple(array[..., k] for k in range(array.shape[-1]))


@dataclass(frozen=True, eq=False)
class TaskBatch:
    """The rules of the game for N balls, on one hole or each on its own.

    Args:
        courses: one course for all balls, or N courses, with cups.
        params: parameters of the holes: cups, tees, bounds and routes.
        world: the compiled physics of the one course, or of all.
        max_strokes: number of strokes after which an episode ends.
        random_tee: start at a uniformly random place in the tee box; otherwise in its middle.
        putt_noise: standard deviations of a putt's direction (degrees) and speed (fraction of it).
    """

    courses: tuple[Course, ...]
    params: HoleParams
    world: World | WorldBatch
    max_strokes: int
    random_tee: bool
    putt_noise: tuple[float, float]

    def sample_start(self, rngs: Collection[np.random.Generator]) -> FloatArray:
        """Return centres (N, 3), m, of balls in the tee box: random, each from its own generator, or the middle."""
        lower = self.params.tee[..., 0, :]
        upper = self.params.tee[..., 1, :]
        fractions = np.full((len(rngs), 3), 0.5)
        if self.random_tee:
            for rng, horizontal in zip(rngs, fractions[:, :2], strict=True):
                rng.random(out=horizontal)
        return np.asarray(lower + fractions * (upper - lower))

    @property
    def is_noisy(self) -> bool:
        """True if putts have noise."""
        return any(self.putt_noise)

    def sample_noise(self, rngs: Collection[np.random.Generator]) -> FloatArray:
        """Return standard normal numbers (N, 2) for the noise of putts, each ball's from its own generator."""
        noise = np.empty((len(rngs), 2))
        for rng, row in zip(rngs, noise, strict=True):
            rng.standard_normal(out=row)
        return noise

    def launch_velocity(self, actions: FloatArray, noise: FloatArray | None = None) -> FloatArray:
        """Return launch velocities (..., 3), m/s, of actions (..., 2).

        The direction of an action is that of the putt; its length, clipped to 1, is the fraction of the top speed.

        Args:
            actions: the putts.
            noise: (..., 2) standard normal numbers, which ``putt_noise`` scales to a turn and to a change of speed;
                None: no noise.
        """
        length = np.hypot(actions[..., 0], actions[..., 1])
        putt = actions * (self.params.top_speed / np.maximum(length, 1.0))[..., None]
        if noise is not None:
            turn = noise[..., 0] * math.radians(self.putt_noise[0])
            cos, sin = np.cos(turn), np.sin(turn)
            x, y = putt[..., 0], putt[..., 1]
            putt = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
            putt = putt * np.maximum(0.0, 1.0 + noise[..., 1] * self.putt_noise[1])[..., None]
        return np.concatenate([putt, np.zeros_like(putt[..., :1])], axis=-1)

    def simulate(self, positions: FloatArray, velocities: FloatArray) -> Outcome:
        """Return the outcome of balls at positions (N, 3), m, launched with velocities (N, 3), m/s."""
        shot = self.world.simulate_batch(positions, velocities, MAX_PUTT_TIME)
        holed = self.is_holed(shot.position, shot.velocity)
        result = np.where(holed, np.int8(Result.HOLED), shot.status)
        # A ball that left the course, or did not come to rest, is put back where it was struck; the stroke counts.
        keeps_position = holed | (result == Result.REST)
        position = np.where(keeps_position[:, None], shot.position, positions)
        return Outcome(position, result, np.asarray(shot.time), np.asarray(shot.bounces))

    def is_holed(self, positions: FloatArray, velocities: FloatArray) -> NDArray[np.bool_]:
        """Return whether balls (...) cannot leave the cup: below its rim, and without the energy to come out.

        To leave the cup, a ball must pass over the edge of the rim with its centre one radius above it.

        Args:
            positions: (..., 3), m.
            velocities: (..., 3), m/s.
        """
        x, y, z = components(positions)
        u, v, w = components(velocities)
        cup_x, cup_y, rim = components(self.params.cup)
        inside = np.hypot(x - cup_x, y - cup_y) < self.params.cup_radius
        climb = (u * u + v * v + w * w) / (2.0 * self.params.gravity)
        return np.asarray(inside & (z < rim) & (z + climb < rim + self.params.ball_radius))

    def distance_to_cup(self, positions: FloatArray) -> FloatArray:
        """Return the distance (...) along the course from positions (..., 3) to the cup, m.

        It is the straight distance to the end of the nearest segment of the course's route, plus the rest of the route.
        """
        x, y, _ = components(positions)
        smallest_sq = np.asarray(np.inf)
        distance = np.asarray(0.0)
        for segment in self._route_segments:
            # Find the nearest point of the segment.
            dx, dy = x - segment.start[0], y - segment.start[1]
            fraction = (dx * segment.vector[0] + dy * segment.vector[1]) / segment.length_sq
            fraction = np.minimum(np.maximum(fraction, 0.0), 1.0)
            dx, dy = dx - fraction * segment.vector[0], dy - fraction * segment.vector[1]
            offset_sq = dx * dx + dy * dy
            # Keep the distance along the nearest segment.
            along = np.hypot(segment.end[0] - x, segment.end[1] - y) + segment.remaining
            distance = np.where(offset_sq < smallest_sq, along, distance)
            smallest_sq = np.minimum(smallest_sq, offset_sq)
        return distance

    @cached_property
    def _route_segments(self) -> list[RouteSegment]:
        return self.params.route_segments()

    def take(self, rows: NDArray[np.int64]) -> TaskBatch:
        """Return the tasks of some balls, in the order of the rows, which may repeat; itself if it has one hole."""
        if not isinstance(self.world, WorldBatch):
            return self
        worlds = self.world.worlds
        return replace(
            self,
            courses=tuple(self.courses[i] for i in rows),
            params=self.params.take(rows),
            world=WorldBatch([worlds[i] for i in rows]),
        )


@dataclass(frozen=True, eq=False)
class Task(TaskBatch):
    """One course with its rules.

    Args:
        index: the number of a procedural level, or of a hole of a round; None: it has none.
    """

    world: World
    index: int | None = None

    @property
    def course(self) -> Course:
        """The course."""
        return self.courses[0]

    @property
    def cup(self) -> Cup:
        """The cup."""
        assert self.course.cup is not None  # noqa: S101 (HoleParams.from_course refuses a course without a cup)
        return self.course.cup

    @property
    def top_speed(self) -> float:
        """Launch speed of a full putt, m/s."""
        return float(self.params.top_speed)

    def simulate_path(self, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the path (T, 3), m, of a ball from a position and velocity (3,), and its times (T,), s."""
        shot = self.world.simulate(position, velocity, MAX_PUTT_TIME, record=True)
        return np.asarray(shot.path), np.asarray(shot.times)


def stack_tasks(tasks: Sequence[Task]) -> TaskBatch:
    """Return N tasks of the same rules as one batch, in which ball i plays task i; one task if all are the same."""
    first = tasks[0]
    if all(task is first for task in tasks):
        return first
    return TaskBatch(
        courses=tuple(task.course for task in tasks),
        params=HoleParams.stack([task.params for task in tasks]),
        world=WorldBatch([task.world for task in tasks]),
        max_strokes=first.max_strokes,
        random_tee=first.random_tee,
        putt_noise=first.putt_noise,
    )
