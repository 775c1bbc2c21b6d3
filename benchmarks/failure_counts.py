"""Count putts that fail: at the time limit, exhausted, inside a solid, or stuck where no putt moves the ball."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv, Task
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.task import MAX_PUTT_TIME, Outcome, PlayedPutts
from minigolf_env.physics import Status

PENETRATION_TOLERANCE = 1e-12
"""Depth beyond which a ball counts as inside a solid, as a fraction of the world's coordinate scale."""

NUM_ESCAPE_PUTTS = 16
"""Number of putts that try to move a ball: in evenly spaced directions, at 1 and 0.15 of the top speed by turns."""

MIN_ESCAPE_DISTANCE = 0.3
"""Distance by which a putt has to move a ball that is not stuck, m."""


@dataclass
class FailureCounts:
    """Numbers of putts, and of failures among them."""

    putts: int = 0
    """Number of putts."""
    timed_out: int = 0
    """Number of balls that were still moving at the time limit."""
    exhausted: int = 0
    """Number of time steps that needed more sub-steps than the limit."""
    inside: int = 0
    """Number of balls that ended inside a solid."""


@dataclass(frozen=True, eq=False)
class CountingTask(Task):
    """Task that counts the failures among its putts, each of which it simulates a second time.

    Args:
        counts: receives the numbers.
    """

    counts: FailureCounts = field(default_factory=FailureCounts)

    def play(
        self,
        positions: FloatArray,
        actions: FloatArray,
        strokes: NDArray[np.int64] | None = None,
        noise: FloatArray | None = None,
    ) -> PlayedPutts:
        """Return the result of ``Task.play``."""
        played = super().play(positions, actions, strokes, noise)
        shot = self.world.simulate_batch(positions, played.velocity, MAX_PUTT_TIME)
        min_clearance = -PENETRATION_TOLERANCE * self.world.coordinate_scale
        self.counts.putts += len(positions)
        self.counts.timed_out += int((np.asarray(shot.status) == Status.TIME_LIMIT).sum())
        self.counts.exhausted += int(np.asarray(shot.exhausted).sum())
        self.counts.inside += int((self.world.clearance(shot.position) < min_clearance).sum())
        return played


def count_failures(env: MiniGolfEnv) -> FailureCounts:
    """Count the failures of an environment's putts until its task changes; return the counts, which grow."""
    task = CountingTask(**{field.name: getattr(env.task, field.name) for field in fields(Task)})
    env.task = task
    return task.counts


def random_putts(task: Task, balls: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, Outcome]:
    """Return the launch velocities (N, 3) and outcomes of random putts, uniform over the disc of actions."""
    angles = rng.uniform(0.0, 2.0 * np.pi, len(balls))
    speeds = rng.random(len(balls)) ** 0.5
    actions = np.stack([speeds * np.cos(angles), speeds * np.sin(angles)], axis=-1)
    played = task.play(balls, actions)
    return played.velocity, played.outcome


def count_stuck(task: Task, balls: FloatArray) -> int:
    """Return the number of balls (N, 3) that no putt moves away or holes out."""
    index = np.arange(NUM_ESCAPE_PUTTS)
    angles = 2.0 * np.pi * index / NUM_ESCAPE_PUTTS
    speeds = np.where(index[:, None] % 2, 0.15, 1.0)
    actions = speeds * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    starts = np.repeat(balls, NUM_ESCAPE_PUTTS, axis=0)
    outcome = task.play(starts, np.tile(actions, (len(balls), 1))).outcome
    distances = np.linalg.norm(outcome.position - starts, axis=1).reshape(-1, NUM_ESCAPE_PUTTS)
    has_moved = distances.max(axis=1) > MIN_ESCAPE_DISTANCE
    has_holed = outcome.holed.reshape(-1, NUM_ESCAPE_PUTTS).any(axis=1)
    return int((~(has_moved | has_holed)).sum())
