"""The observation "bounce_rays": what a ball can feel of a hole around its corners, by rays that go on."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.envs.observations.rays import (
    MIN_DIRECTION_LENGTH,
    NUM_CUP_FEATURES,
    NUM_GROUND_FEATURES,
    append_to_state,
    ground_and_cup_features,
    raised_origins,
)
from minigolf_env.envs.task import STATE_FEATURES, FloatArray, TaskBatch

NUM_BOUNCE_RAYS = 96
"""Horizontal directions, the first along x, counter-clockwise."""

NUM_SEGMENTS = 4
"""Straight parts of a ray, seen from above: it goes on off three walls."""

RAY_STEP_LENGTH, MAX_RAY_STEPS = 0.8, 20
"""How far a ray goes before it is let down to the ground, m, and how often; a wall or a slope ends a step early."""

MAX_BOUNCE_RAY_LENGTH = RAY_STEP_LENGTH * MAX_RAY_STEPS
"""How far a ray goes at most, m."""

MAX_WALL_NORMAL_Z = 0.7
"""A surface whose normal has a smaller upward part is a wall; a ray follows others up."""

MAX_DROP_PER_STEP = 0.3
"""How far down the ground is looked for, m."""

HIT_STANDOFF = 1e-4
"""How far before what it meets a ray stops, m."""

FEATURES_PER_SEGMENT = 6
"""Numbers of a leg: x and y of its end and of the wall's normal there, the height of its end, the greatest so far."""


def bounce_ray_space() -> Space[NDArray[np.float32]]:
    """Return the space of "bounce_rays" observations (2320,)."""
    ray_features = NUM_BOUNCE_RAYS * NUM_SEGMENTS * FEATURES_PER_SEGMENT
    numbers = len(STATE_FEATURES) + NUM_GROUND_FEATURES + NUM_CUP_FEATURES + ray_features
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (numbers,), np.float32))


def observe_bounce_rays(game: TaskBatch, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return observations (N, 2320) of balls at positions (N, 3), m, after a number of strokes (N,)."""
    echoes = trace_bounce_rays(game, positions)
    echoes[..., :2] /= MAX_BOUNCE_RAY_LENGTH
    felt = np.concatenate([ground_and_cup_features(game, positions), echoes.reshape(len(positions), -1)], axis=1)
    return append_to_state(game, positions, strokes, felt)


def trace_bounce_rays(game: TaskBatch, positions: FloatArray) -> FloatArray:
    """Return the segments (N, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT), m, of rays from balls (N, 3).

    A ray is the way of the ball itself, lifted, by exact sweeps: over the ground, and off walls as light off mirrors. A
    leg that meets no wall has a normal of 0, and so have those after it, which are where it ends.
    """
    n, sweep = len(positions), game.world.sweep_batch
    radius, cup_radius = (
        np.repeat(np.broadcast_to(r, n), NUM_BOUNCE_RAYS) for r in (game.params.ball_radius, game.params.cup_radius)
    )
    cup = np.repeat(np.broadcast_to(game.params.cup, (n, 3)), NUM_BOUNCE_RAYS, axis=0)
    turns = 2.0 * math.pi * np.arange(NUM_BOUNCE_RAYS) / NUM_BOUNCE_RAYS
    ahead = np.tile(np.stack([np.cos(turns), np.sin(turns)], axis=-1), (n, 1))
    place = np.repeat(raised_origins(game, positions), NUM_BOUNCE_RAYS, axis=0)
    begun, climb, leg = place.copy(), np.zeros(len(place)), np.zeros(len(place), dtype=np.int64)
    top, legs = place[:, 2].copy(), np.zeros((len(place), NUM_SEGMENTS, FEATURES_PER_SEGMENT))

    def end(rows: NDArray[np.int64], number: NDArray[np.int64] | int, normal: FloatArray) -> None:
        """Write down where legs end."""
        way, height = place[rows] - begun[rows], top[rows] - begun[rows, 2]
        legs[rows, number] = np.column_stack([way[:, :2], normal, way[:, 2], height])

    for _ in range(MAX_RAY_STEPS):
        goes = leg < NUM_SEGMENTS
        step = np.where(goes[:, None], RAY_STEP_LENGTH * np.column_stack([ahead, climb]), 0.0)
        met = sweep(place, place + step)
        hit, normal = np.asarray(met.hit) & goes, np.asarray(met.normal)
        place += np.maximum(np.asarray(met.alpha) - hit * (HIT_STANDOFF / RAY_STEP_LENGTH), 0.0)[:, None] * step
        top = np.maximum(top, place[:, 2])
        walls = hit & (normal[:, 2] < MAX_WALL_NORMAL_Z)
        climbs = hit & ~walls
        # Down to the ground, but not into the cup.
        looks = goes & ~climbs
        below = sweep(place, place + looks[:, None] * np.array([0.0, 0.0, -MAX_DROP_PER_STEP]))
        falls = np.asarray(below.hit) & looks
        falls &= np.hypot(place[:, 0] - cup[:, 0], place[:, 1] - cup[:, 1]) >= cup_radius + 0.5 * radius
        place[:, 2] -= np.where(falls, np.maximum(MAX_DROP_PER_STEP * np.asarray(below.alpha) - radius, 0.0), 0.0)
        rows, aside = np.flatnonzero(walls), normal[walls, :2]
        aside /= np.maximum(np.hypot(aside[:, 0], aside[:, 1]), MIN_DIRECTION_LENGTH)[:, None]  # A ceiling has none.
        end(rows, leg[rows], aside)
        ahead[rows] -= 2.0 * (ahead[rows] * aside).sum(-1)[:, None] * aside
        leg[rows] += 1
        climb = np.where(climbs, -(ahead * normal[:, :2]).sum(-1) / np.maximum(normal[:, 2], MAX_WALL_NORMAL_Z), 0.0)
    for k in range(NUM_SEGMENTS):
        rows = np.flatnonzero(leg <= k)
        end(rows, k, np.zeros((len(rows), 2)))
    return legs.reshape(n, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT)
