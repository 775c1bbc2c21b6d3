"""Tasks: a course with its rules, for one ball or for N. The rules themselves are compiled, see ``rules.py``."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple, cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.courses import Course, Cup
from minigolf_env.envs.holes import FloatArray, Holes, stack_holes
from minigolf_env.envs.rules import (
    NUM_STATE_FEATURES,
    RESULT_HOLED,
    distance_rows,
    holed_rows,
    launch_rows,
    play_range,
    state_rows,
)
from minigolf_env.physics import Status, World
from minigolf_env.physics.batch import NO_LOG, NO_PATH, for_each_range, thread_scratch
from minigolf_env.physics.jit import notify_if_compiling
from minigolf_env.physics.step import RunBatch
from minigolf_env.physics.types import RESULT_DTYPE

MAX_PUTT_TIME = 30.0
"""Longest duration of a putt, s: several times as long as a ball rolls on any green."""

NO_NOISE = np.empty((0, 3))
"""Noise of putts that have none."""


class Result(IntEnum):
    """Result of a stroke: a Status of the physics, or HOLED."""

    REST = Status.REST
    OUT_OF_BOUNDS = Status.OUT_OF_BOUNDS
    TIME_LIMIT = Status.TIME_LIMIT
    HOLED = RESULT_HOLED


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
        return np.asarray(self.result == RESULT_HOLED)


class PlayedPutts(NamedTuple):
    """Putts of N balls, from action to observation."""

    velocity: FloatArray
    """(N, 3) launch velocities, m/s, with the noise of the putts."""
    outcome: Outcome
    """Outcome of the strokes."""
    state: NDArray[np.float32]
    """(N, NUM_STATE_FEATURES) observations "state" after the strokes."""


def action_space() -> Space[NDArray[np.float32]]:
    """Return the space of one environment's putts (2,)."""
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (2,), np.float32))


class TaskBatch:
    """The tasks of N balls: one that all of them play, or one for each.

    Args:
        tasks: one task, or N tasks of the same rules.
    """

    def __init__(self, tasks: Sequence[Task]) -> None:
        self.tasks = tuple(tasks)
        self.holes = stack_holes([task.holes for task in tasks])

    @property
    def is_noisy(self) -> bool:
        """True if putts have noise."""
        return any(self.tasks[0].putt_noise)

    @property
    def max_strokes(self) -> int:
        """Number of strokes after which an episode ends."""
        return int(self.holes.params["max_strokes"][0])

    def sample_start(self, rngs: Collection[np.random.Generator]) -> FloatArray:
        """Return centres (N, 3), m, of balls in the tee box: random, each from its own generator, or the middle."""
        lower, upper = self.holes.params["tee"].swapaxes(0, 1)
        fractions = np.full((len(rngs), 3), 0.5)
        if self.tasks[0].random_tee:
            for rng, horizontal in zip(rngs, fractions[:, :2], strict=True):
                rng.random(out=horizontal)
        return np.asarray(lower + fractions * (upper - lower))

    def sample_noise(self, rngs: Collection[np.random.Generator]) -> FloatArray:
        """Return standard normal numbers (N, 2) for the noise of putts, each ball's from its own generator."""
        noise = np.empty((len(rngs), 2))
        for rng, row in zip(rngs, noise, strict=True):
            rng.standard_normal(out=row)
        return noise

    def launch_velocity(self, actions: FloatArray, noise: FloatArray | None = None) -> FloatArray:
        """Return launch velocities (..., 3), m/s, of actions (..., 2).

        Args:
            actions: the putts.
            noise: (..., 2) standard normal numbers, which ``putt_noise`` scales to a turn and to a change of speed;
                None: no noise.
        """
        putts = actions.reshape(-1, 2)
        launches = np.empty((len(putts), 3))
        launch_rows(self.holes.params, self._rows_per_hole(len(putts)), putts, self._scale_noise(noise), launches)
        return launches.reshape(*actions.shape[:-1], 3)

    def play(
        self,
        positions: FloatArray,
        actions: FloatArray,
        strokes: NDArray[np.int64] | None = None,
        noise: FloatArray | None = None,
    ) -> PlayedPutts:
        """Play putts of N balls at once, on all threads.

        Args:
            positions: (N, 3) the balls' centres, m, in free space and within the bounds.
            actions: (N, 2) the putts.
            strokes: (N,) number of strokes of the episodes before these; None: 0.
            noise: (N, 2), see ``launch_velocity``.
        """
        n = len(positions)
        counts = np.zeros(n, np.int64) if strokes is None else strokes
        scaled_noise = self._scale_noise(noise)
        runs = RunBatch(positions.copy(), np.empty((n, 3)), np.zeros(n, RESULT_DTYPE))
        launches = np.empty((n, 3))
        state = np.empty((n, NUM_STATE_FEATURES), np.float32)

        with notify_if_compiling("play"):
            self.for_each_hole(
                play_range, actions, scaled_noise, positions, counts, runs, NO_PATH, NO_LOG, launches, state
            )
        results = runs.results
        outcome = Outcome(
            runs.positions, results["status"].astype(np.int8), results["time"].copy(), results["bounces"].copy()
        )
        return PlayedPutts(launches, outcome, state)

    def is_holed(self, positions: FloatArray, velocities: FloatArray) -> NDArray[np.bool_]:
        """Return whether balls (...) cannot leave the cup: below its rim, and without the energy to come out.

        Args:
            positions: (..., 3), m.
            velocities: (..., 3), m/s.
        """
        p = positions.reshape(-1, 3)
        v = velocities.reshape(-1, 3)
        holed = np.empty(len(p), np.bool_)
        holed_rows(self.holes.params, self._rows_per_hole(len(p)), p, v, holed)
        return holed.reshape(positions.shape[:-1])

    def distance_to_cup(self, positions: FloatArray) -> FloatArray:
        """Return the distance (...) along the course from positions (..., 3) to the cup, m.

        It is the straight distance to the end of the nearest segment of the course's route, plus the rest of the route.
        With a task for each ball the first axis of the positions is that of the balls.
        """
        p = positions.reshape(-1, 3)
        distances = np.empty(len(p))
        distance_rows(self.holes.params, self._rows_per_hole(len(p)), self.holes.route, p, distances)
        return distances.reshape(positions.shape[:-1])

    def observe_state(self, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return observations "state" (N, 10) of balls at positions (N, 3), m, after a number of strokes (N,)."""
        state = np.empty((len(positions), NUM_STATE_FEATURES), np.float32)
        state_rows(self.holes.params, self._rows_per_hole(len(positions)), positions, strokes, state)
        return state

    def take(self, rows: NDArray[np.int64]) -> TaskBatch:
        """Return the tasks of some balls, in the order of the rows, which may repeat; itself if it has one hole."""
        return self if len(self.tasks) == 1 else TaskBatch([self.tasks[i] for i in rows])

    def _scale_noise(self, noise: FloatArray | None) -> FloatArray:
        """Return cosine and sine of a turn and a factor of the speed (N, 3) for standard normal numbers (..., 2)."""
        if noise is None:
            return NO_NOISE
        degrees, speed_deviation = self.tasks[0].putt_noise
        turn = noise[..., 0].ravel() * math.radians(degrees)
        speed_factor = np.maximum(0.0, 1.0 + noise[..., 1].ravel() * speed_deviation)
        return np.stack([np.cos(turn), np.sin(turn), speed_factor], axis=-1)

    def for_each_hole(self, kernel: Callable[..., None], rows: NDArray[Any], *arguments: Any) -> None:
        """Call a kernel for ranges of rows that share a scene, on all threads.

        Args:
            kernel: called as kernel(first, last, scene, scratch, params, rows_per_hole, rows, *arguments).
            rows: an array with a row for each ball.
            arguments: further arguments of the kernel.
        """
        params, rows_per_hole = self.holes.params, self._rows_per_hole(len(rows))

        def process_rows(first: int, last: int, task: Task) -> None:
            kernel(first, last, task.world.scene, thread_scratch(), params, rows_per_hole, rows, *arguments)

        for_each_range(self.tasks, len(rows), process_rows)

    def _rows_per_hole(self, n: int) -> int:
        """Return the number of rows of each hole among n rows."""
        return max(1, n // len(self.tasks))


@dataclass(frozen=True, eq=False)
class Task(TaskBatch):
    """One hole with its rules.

    Args:
        course: the course, with a cup.
        holes: the parameters of the hole that the rules read.
        world: the compiled physics of the course.
        random_tee: start at a uniformly random place in the tee box; otherwise in its middle.
        putt_noise: standard deviations of a putt's direction (degrees) and speed (fraction of it).
        index: the number of a procedural level, or of a hole of a round; None: it has none.
    """

    course: Course
    holes: Holes
    world: World
    random_tee: bool
    putt_noise: tuple[float, float]
    index: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "tasks", (self,))

    @property
    def cup(self) -> Cup:
        """The cup."""
        assert self.course.cup is not None  # noqa: S101 (build_task refuses a course without a cup)
        return self.course.cup

    @property
    def top_speed(self) -> float:
        """Launch speed of a full putt, m/s."""
        return float(self.holes.params["top_speed"][0])

    def simulate_path(self, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the path (T, 3), m, of a ball from a position and velocity (3,), and its times (T,), s."""
        shot = self.world.simulate(position, velocity, MAX_PUTT_TIME, record=True)
        return np.asarray(shot.path), np.asarray(shot.times)


def stack_tasks(tasks: Sequence[Task]) -> TaskBatch:
    """Return N tasks of the same rules as one batch, in which ball i plays task i; one task if all are the same."""
    first = tasks[0]
    return first if all(task is first for task in tasks) else TaskBatch(tasks)
