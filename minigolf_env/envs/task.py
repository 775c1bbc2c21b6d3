"""The rules of the game, pure: an action becomes a launch, a shot becomes an outcome, an observation and a reward.

Every function takes one ball or many: arrays have any leading shape (...). There is no other copy of the rules.
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
from minigolf_env.envs.hole_params import HoleParams, RouteSegment
from minigolf_env.physics import Status, World, WorldBatch

FloatArray = NDArray[np.float64]

MAX_PUTT_TIME = 30.0
"""Longest putt, s: several times what a ball on any green rolls."""

STATE_FEATURES = (
    "ball x",
    "ball y",
    "ball z",
    "to cup x",
    "to cup y",
    "to cup z",
    "straight putt x",
    "straight putt y",
    "root of cup distance",
    "strokes left",
)
"""What the numbers of a "state" observation mean; MiniGolfEnv's docstring gives their scales."""

REWARDS = ("strokes", "shaped")

MIN_STROKES_TO_FINISH = 1.0
"""Strokes still needed next to the cup, as the shaped reward estimates them."""

STROKES_PER_METRE = 0.3
"""Further strokes still needed for each metre along the course to the cup, as the shaped reward estimates them."""


class Result(IntEnum):
    """What became of a stroke: the physics' Status, and holed."""

    REST = Status.REST
    OUT_OF_BOUNDS = Status.OUT_OF_BOUNDS
    TIME_LIMIT = Status.TIME_LIMIT
    HOLED = 3


class Outcome(NamedTuple):
    """What strokes led to; each field has the leading shape (...) of the strokes."""

    position: FloatArray
    """(..., 3) where the ball lies for the next stroke, m: where it rests, or where it was struck if it did not."""
    result: NDArray[np.int8]
    """Values of Result."""
    time: FloatArray
    """How long the ball moved, s."""
    bounces: NDArray[np.int64]
    """Impacts that did not become lasting contacts."""

    def reshape(self, *shape: int) -> Outcome:
        """Return the same strokes in another leading shape."""
        position, result, time, bounces = self
        return Outcome(position.reshape(*shape, 3), result.reshape(shape), time.reshape(shape), bounces.reshape(shape))

    @property
    def holed(self) -> NDArray[np.bool_]:
        """Whether the ball is in the cup."""
        return np.asarray(self.result == Result.HOLED)


def action_space() -> Space[NDArray[np.float32]]:
    """Return the space of putts (2,)."""
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (2,), np.float32))


def observation_space() -> Space[NDArray[np.float32]]:
    """Return the space of "state" observations (10,)."""
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (len(STATE_FEATURES),), np.float32))


def components(array: FloatArray) -> tuple[FloatArray, ...]:
    """Return x, y and z (...) of vectors (..., 3), for arithmetic with whole columns: rows of three take ten times."""
    return tuple(array[..., k] for k in range(array.shape[-1]))


@dataclass(frozen=True, eq=False)
class TaskBatch:
    """The rules, for balls that play one hole, or each its own.

    Args:
        courses: one course, or one a ball, with cups.
        holes: what the rules know of them.
        world: the compiled physics of the one, or of all.
        reward: one of ``REWARDS``.
        max_strokes: strokes after which an episode is over.
        random_tee: whether the ball starts anywhere in the tee box, or in its middle.
        putt_noise: standard deviations of a putt's direction (degrees) and speed (share of it).
    """

    courses: tuple[Course, ...]
    params: HoleParams
    world: World | WorldBatch
    reward: str
    max_strokes: int
    random_tee: bool
    putt_noise: tuple[float, float]

    def sample_start(self, rngs: Collection[np.random.Generator]) -> FloatArray:
        """Return balls' centres (N, 3), m, in the tee box: in its middle, or anywhere, each by its own stream."""
        lower, upper = self.params.tee[..., 0, :], self.params.tee[..., 1, :]
        shares = np.full((len(rngs), 3), 0.5)
        if self.random_tee:
            for rng, share in zip(rngs, shares[:, :2], strict=True):
                rng.random(out=share)
        return np.asarray(lower + shares * (upper - lower))

    @property
    def is_noisy(self) -> bool:
        """Whether putts are disturbed."""
        return any(self.putt_noise)

    def sample_noise(self, rngs: Collection[np.random.Generator]) -> FloatArray:
        """Return standard normal numbers (N, 2) to disturb putts with, each from its own stream."""
        draws = np.empty((len(rngs), 2))
        for rng, draw in zip(rngs, draws, strict=True):
            rng.standard_normal(out=draw)
        return draws

    def launch_velocity(self, actions: FloatArray, draws: FloatArray | None = None) -> FloatArray:
        """Return launch velocities (..., 3), m/s, of actions (..., 2).

        An action's direction aims, its length (at most 1) is the share of the top speed. ``draws`` (..., 2) are
        standard normal numbers that disturb direction and speed by ``putt_noise``.
        """
        length = np.hypot(actions[..., 0], actions[..., 1])
        putt = actions * (self.params.top_speed / np.maximum(length, 1.0))[..., None]
        if draws is not None:
            turn = draws[..., 0] * math.radians(self.putt_noise[0])
            cos, sin = np.cos(turn), np.sin(turn)
            x, y = putt[..., 0], putt[..., 1]
            putt = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
            putt = putt * np.maximum(0.0, 1.0 + draws[..., 1] * self.putt_noise[1])[..., None]
        return np.concatenate([putt, np.zeros_like(putt[..., :1])], axis=-1)

    def simulate(self, positions: FloatArray, velocities: FloatArray) -> Outcome:
        """Return what becomes of balls at positions (N, 3) launched with velocities (N, 3)."""
        shot = self.world.simulate_batch(positions, velocities, MAX_PUTT_TIME)
        holed = self.is_holed(shot.position, shot.velocity)
        result = np.where(holed, np.int8(Result.HOLED), shot.status)
        # A ball that left the course, or never came to rest, goes back: the stroke counts.
        stays = holed | (result == Result.REST)
        position = np.where(stays[:, None], shot.position, positions)
        return Outcome(position, result, np.asarray(shot.time), np.asarray(shot.bounces))

    def is_holed(self, positions: FloatArray, velocities: FloatArray) -> NDArray[np.bool_]:
        """Return whether balls (..., 3) are in the cup for good: below the rim, without the energy to come out.

        To leave, a ball must pass over the rim's edge, its centre one radius above it.
        """
        (x, y, z), (u, v, w) = components(positions), components(velocities)
        cup_x, cup_y, rim = components(self.params.cup)
        inside = np.hypot(x - cup_x, y - cup_y) < self.params.cup_radius
        climb = (u * u + v * v + w * w) / (2.0 * self.params.gravity)
        return np.asarray(inside & (z < rim) & (z + climb < rim + self.params.ball_radius))

    def distance_to_cup(self, positions: FloatArray) -> FloatArray:
        """Return the distance along the course from positions (..., 3) to the cup, m.

        Straight to the end of the nearest leg of the course's route, and on along the route.
        """
        x, y, _ = components(positions)
        nearest, distance = np.asarray(np.inf), np.asarray(0.0)
        for segment in self._route_segments:
            dx, dy = x - segment.start[0], y - segment.start[1]
            share = (dx * segment.vector[0] + dy * segment.vector[1]) / segment.length_sq
            share = np.minimum(np.maximum(share, 0.0), 1.0)
            dx, dy = dx - share * segment.vector[0], dy - share * segment.vector[1]
            away = dx * dx + dy * dy
            left = np.hypot(segment.end[0] - x, segment.end[1] - y) + segment.remaining
            nearest, distance = np.minimum(nearest, away), np.where(away < nearest, left, distance)
        return distance

    @cached_property
    def _route_segments(self) -> list[RouteSegment]:
        return self.params.route_segments()

    def observe(self, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return observations (..., 10) of balls at positions (..., 3) after a number of strokes (...)."""
        ball, lower, upper = components(positions), *(components(self.params.bounds[..., k, :]) for k in (0, 1))
        sides = [high - low for high, low in zip(upper, lower, strict=True)]
        reach = np.sqrt(sides[0] * sides[0] + sides[1] * sides[1])
        place = [2.0 * (p - low) / side - 1.0 for p, low, side in zip(ball, lower, sides, strict=True)]
        to_cup = [c - p for c, p in zip(components(self.params.cup), ball, strict=True)]
        away = np.hypot(to_cup[0], to_cup[1])
        root = np.sqrt(away / reach)
        straight = [root * way / np.maximum(away, 1e-9) for way in to_cup[:2]]
        left = np.asarray(1.0 - np.asarray(strokes) / self.max_strokes)
        numbers = np.stack([*place, *(way / reach for way in to_cup), *straight, root, left], axis=-1)
        return np.clip(numbers, -1.0, 1.0, out=numbers).astype(np.float32)

    def potential(self, positions: FloatArray) -> FloatArray:
        """Return the potential (...) of balls at positions (..., 3): minus the strokes still needed, as a guess.

        Zero with the reward "strokes".
        """
        if self.reward == "strokes":
            return np.zeros(positions.shape[:-1])
        return -(MIN_STROKES_TO_FINISH + STROKES_PER_METRE * self.distance_to_cup(positions))

    def rewards(self, before: FloatArray, after: FloatArray, ended: NDArray[np.bool_]) -> FloatArray:
        """Return the rewards (...) of strokes between places of the potentials ``before`` and ``after`` (...).

        "strokes" is -1. "shaped" adds the change of the potential, which is zero where the episode has ended: over an
        episode it adds a constant, so that the best policy stays the best.
        """
        return np.asarray(-1.0 + np.where(ended, 0.0, after) - before)


@dataclass(frozen=True, eq=False)
class Task(TaskBatch):
    """One course with its rules.

    Args:
        index: the number of a procedural course, or of a hole of a round; None: it has none.
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
        assert self.course.cup is not None  # noqa: S101 (HoleParams.from_course has refused such a course)
        return self.course.cup

    @property
    def top_speed(self) -> float:
        """Launch speed of a full putt, m/s."""
        return float(self.params.top_speed)

    def simulate_path(self, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the path (T, 3), m, that a ball takes from a position and velocity (3,), and its times (T,), s."""
        shot = self.world.simulate(position, velocity, MAX_PUTT_TIME, record=True)
        return np.asarray(shot.path), np.asarray(shot.times)


def stack_tasks(tasks: Sequence[Task]) -> TaskBatch:
    """Return N tasks of the same rules as one game in which ball i plays task i: one task if they are all the same."""
    first = tasks[0]
    if all(task is first for task in tasks):
        return first
    return TaskBatch(
        courses=tuple(task.course for task in tasks),
        params=HoleParams.stack([task.params for task in tasks]),
        world=WorldBatch([task.world for task in tasks]),
        reward=first.reward,
        max_strokes=first.max_strokes,
        random_tee=first.random_tee,
        putt_noise=first.putt_noise,
    )


def take(game: TaskBatch, rows: NDArray[np.int64]) -> TaskBatch:
    """Return the game of some of the balls, each as often as it is among the rows."""
    if not isinstance(game.world, WorldBatch):
        return game
    worlds = game.world.worlds
    return replace(
        game,
        courses=tuple(game.courses[i] for i in rows),
        params=game.params.take(rows),
        world=WorldBatch([worlds[i] for i in rows]),
    )
