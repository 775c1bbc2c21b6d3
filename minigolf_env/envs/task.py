"""The rules of the game, pure: an action becomes a launch, a shot becomes an outcome, an observation and a reward.

Every function takes one ball or many: arrays have any leading shape (...). There is no other copy of the rules.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple, cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.courses import Course, Cup
from minigolf_env.envs.holes import Holes
from minigolf_env.physics import Status, World, WorldBatch

FloatArray = NDArray[np.float64]

MAX_TIME = 30.0
"""Longest putt, s: several times what a ball on any green rolls."""

OBSERVATION = (
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

SHORTEST = 1e-9
"""Legs of a route shorter than this are points, m."""

STROKES_TO_FINISH = (1.0, 0.3)
"""Strokes still needed, as shaping guesses them: one, and 0.3 for each metre along the course."""


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

    @property
    def holed(self) -> NDArray[np.bool_]:
        """Whether the ball is in the cup."""
        return np.asarray(self.result == Result.HOLED)


def action_space() -> Space[NDArray[np.float32]]:
    """Return the space of putts (2,)."""
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (2,), np.float32))


def observation_space() -> Space[NDArray[np.float32]]:
    """Return the space of "state" observations (10,)."""
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (len(OBSERVATION),), np.float32))


@dataclass(frozen=True, eq=False)
class Game:
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
    holes: Holes
    world: World | WorldBatch
    reward: str
    max_strokes: int
    random_tee: bool
    putt_noise: tuple[float, float]

    def disturb(self, rngs: Sequence[np.random.Generator]) -> FloatArray | None:
        """Return standard normal numbers (N, 2) to disturb putts with, each from its own stream; None without noise."""
        if not any(self.putt_noise):
            return None
        return np.array([rng.standard_normal(2) for rng in rngs]).reshape(-1, 2)

    def launch(self, actions: FloatArray, draws: FloatArray | None = None) -> FloatArray:
        """Return launch velocities (..., 3), m/s, of actions (..., 2).

        An action's direction aims, its length (at most 1) is the share of the top speed. ``draws`` (..., 2) are
        standard normal numbers that disturb direction and speed by ``putt_noise``.
        """
        length = np.hypot(actions[..., 0], actions[..., 1])
        putt = actions * (self.holes.top_speed / np.maximum(length, 1.0))[..., None]
        if draws is not None:
            turn = draws[..., 0] * math.radians(self.putt_noise[0])
            cos, sin = np.cos(turn), np.sin(turn)
            x, y = putt[..., 0], putt[..., 1]
            putt = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
            putt = putt * np.maximum(0.0, 1.0 + draws[..., 1] * self.putt_noise[1])[..., None]
        return np.concatenate([putt, np.zeros_like(putt[..., :1])], axis=-1)

    def play(self, positions: FloatArray, velocities: FloatArray) -> Outcome:
        """Return what becomes of balls at positions (N, 3) launched with velocities (N, 3)."""
        shot = self.world.simulate_batch(positions, velocities, MAX_TIME)
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
        holes = self.holes
        offset = positions - holes.cup
        inside = np.hypot(offset[..., 0], offset[..., 1]) < holes.cup_radius
        rim = holes.cup[..., 2]
        below = positions[..., 2] < rim
        climb = np.sum(velocities * velocities, axis=-1) / (2.0 * holes.gravity)
        return np.asarray(inside & below & (positions[..., 2] + climb < rim + holes.ball_radius))

    def distance(self, positions: FloatArray) -> FloatArray:
        """Return the distance along the course from positions (..., 3) to the cup, m.

        Straight to the end of the nearest leg of the course's route, and on along the route.
        """
        route = self.holes.route
        starts, ends = route[..., :-1, :], route[..., 1:, :]
        legs = ends - starts
        lengths = np.hypot(legs[..., 0], legs[..., 1])
        after = np.cumsum(lengths[..., :0:-1], axis=-1)[..., ::-1]
        remaining = np.concatenate([after, np.zeros((*after.shape[:-1], 1))], axis=-1)
        offset = positions[..., None, :2] - starts
        share = np.clip(np.sum(offset * legs, axis=-1) / np.maximum(lengths, SHORTEST) ** 2, 0.0, 1.0)
        away = offset - share[..., None] * legs
        leg = np.argmin(np.sum(away * away, axis=-1), axis=-1)[..., None]
        ahead = np.take_along_axis(np.broadcast_to(ends, offset.shape), leg[..., None], axis=-2)[..., 0, :]
        left = np.take_along_axis(np.broadcast_to(remaining, share.shape), leg, axis=-1)[..., 0]
        ahead = ahead - positions[..., :2]
        return np.asarray(np.hypot(ahead[..., 0], ahead[..., 1]) + left)

    def observe(self, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return observations (..., 10) of balls at positions (..., 3) after a number of strokes (...)."""
        lower, upper = self.holes.bounds[..., 0, :], self.holes.bounds[..., 1, :]
        sides = upper - lower
        reach = np.sqrt(sides[..., 0] * sides[..., 0] + sides[..., 1] * sides[..., 1])[..., None]
        place = 2.0 * (positions - lower) / sides - 1.0
        to_cup = self.holes.cup - positions
        away = np.hypot(to_cup[..., 0], to_cup[..., 1])[..., None]
        root = np.sqrt(away / reach)
        straight = root * to_cup[..., :2] / np.maximum(away, 1e-9)
        left = np.asarray(1.0 - np.asarray(strokes) / self.max_strokes)[..., None]
        numbers = [place, to_cup / reach, straight, root, left]
        return np.asarray(np.clip(np.concatenate(numbers, axis=-1), -1.0, 1.0), dtype=np.float32)

    def rewards(self, before: FloatArray, after: FloatArray, ended: NDArray[np.bool_]) -> FloatArray:
        """Return the rewards (...) of strokes from ``before`` (..., 3) to ``after`` (..., 3).

        "strokes" is -1. "shaped" adds the change of a potential, minus the strokes still needed as a guess, that is
        zero where the episode has ended: over an episode it adds a constant, so that the best policy stays the best.
        """
        stroke = np.full(before.shape[:-1], -1.0)
        if self.reward == "strokes":
            return stroke
        return stroke + np.where(ended, 0.0, self._potential(after)) - self._potential(before)

    def _potential(self, positions: FloatArray) -> FloatArray:
        putt, metre = STROKES_TO_FINISH
        return -(putt + metre * self.distance(positions))


@dataclass(frozen=True, eq=False)
class Task(Game):
    """One course with its rules.

    Args:
        level: the number of a procedural course, or of a hole of a round; None: it has none.
    """

    world: World
    level: int | None = None

    @property
    def course(self) -> Course:
        """The course."""
        return self.courses[0]

    @property
    def cup(self) -> Cup:
        """The cup."""
        assert self.course.cup is not None  # noqa: S101 (Holes.of has refused such a course)
        return self.course.cup

    @property
    def top_speed(self) -> float:
        """Launch speed of a full putt, m/s."""
        return float(self.holes.top_speed)

    def tee_off(self, rng: np.random.Generator) -> FloatArray:
        """Return a ball's centre (3,), m, in the tee box: anywhere in it, or in its middle."""
        tee = self.course.tee
        lower, upper = np.asarray(tee.lower), np.asarray(tee.upper)
        shares = rng.random(2) if self.random_tee else 0.5
        return np.append(lower + shares * (upper - lower), tee.height + self.course.ball_radius)

    def trace(self, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the path (T, 3), m, that a ball takes from a position and velocity (3,), and its times (T,), s."""
        shot = self.world.simulate(position, velocity, MAX_TIME, record=True)
        return np.asarray(shot.path), np.asarray(shot.times)


def together(tasks: Sequence[Task]) -> Game:
    """Return N tasks of the same rules as one game in which ball i plays task i: one task if they are all the same."""
    first = tasks[0]
    if all(task is first for task in tasks):
        return first
    return Game(
        courses=tuple(task.course for task in tasks),
        holes=Holes.together([task.holes for task in tasks]),
        world=WorldBatch([task.world for task in tasks]),
        reward=first.reward,
        max_strokes=first.max_strokes,
        random_tee=first.random_tee,
        putt_noise=first.putt_noise,
    )


def of_rows(game: Game, rows: NDArray[np.int64]) -> Game:
    """Return the game of some of the balls."""
    if not isinstance(game.world, WorldBatch):
        return game
    worlds = game.world.worlds
    return replace(
        game,
        courses=tuple(game.courses[i] for i in rows),
        holes=game.holes.of_rows(rows),
        world=WorldBatch([worlds[i] for i in rows]),
    )
