"""The observation "echoes": what a ball can feel of a hole around its corners, by rays that go on."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from minigolf_env.envs.observations.rays import CUP, GROUND, SHORTEST, after_state, feel_ground_and_cup, lift
from minigolf_env.envs.task import OBSERVATION, FloatArray, Game

ECHOES = 96
"""Horizontal directions, the first along x, counter-clockwise."""

LEGS = 4
"""Straight parts of a ray, seen from above: it goes on off three walls."""

STEP, STEPS = 0.8, 20
"""How far a ray goes before it is let down to the ground, m, and how often; a wall or a slope ends a step early."""

FAR = STEP * STEPS
"""How far a ray goes at most, m."""

WALL = 0.7
"""A surface whose normal has a smaller upward part is a wall; a ray follows others up."""

FALL = 0.3
"""How far down the ground is looked for, m."""

APART = 1e-4
"""How far before what it meets a ray stops, m."""

ECHO = 6
"""Numbers of a leg: x and y of its end and of the wall's normal there, the height of its end, the greatest so far."""


def echo_space() -> Space[NDArray[np.float32]]:
    """Return the space of "echoes": "state"'s 10 numbers, GROUND and CUP numbers, ECHO numbers of each ray's legs."""
    numbers = len(OBSERVATION) + GROUND + CUP + ECHOES * LEGS * ECHO
    return cast(Space[NDArray[np.float32]], Box(-1.0, 1.0, (numbers,), np.float32))


def observe_echoes(game: Game, positions: FloatArray, strokes: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return observations (N, 2320) of balls at positions (N, 3), m, after a number of strokes (N,)."""
    echoes = trace(game, positions)
    echoes[..., :2] /= FAR
    felt = np.concatenate([feel_ground_and_cup(game, positions), echoes.reshape(len(positions), -1)], axis=1)
    return after_state(game, positions, strokes, felt)


def trace(game: Game, positions: FloatArray) -> FloatArray:
    """Return the legs (N, ECHOES, LEGS, ECHO), m, of rays from balls at positions (N, 3); places are from the ball.

    A ray is the way of the ball itself, lifted, by exact sweeps: over the ground, and off walls as light off mirrors. A
    leg that meets no wall has a normal of 0, and so have those after it, which are where it ends.
    """
    n, sweep = len(positions), game.world.sweep_batch
    radius, cup_radius = (
        np.repeat(np.broadcast_to(r, n), ECHOES) for r in (game.holes.ball_radius, game.holes.cup_radius)
    )
    cup = np.repeat(np.broadcast_to(game.holes.cup, (n, 3)), ECHOES, axis=0)
    turns = 2.0 * math.pi * np.arange(ECHOES) / ECHOES
    ahead = np.tile(np.stack([np.cos(turns), np.sin(turns)], axis=-1), (n, 1))
    place = np.repeat(lift(game, positions), ECHOES, axis=0)
    begun, climb, leg = place.copy(), np.zeros(len(place)), np.zeros(len(place), dtype=np.int64)
    top, legs = place[:, 2].copy(), np.zeros((len(place), LEGS, ECHO))

    def end(rows: NDArray[np.int64], number: NDArray[np.int64] | int, normal: FloatArray) -> None:
        """Write down where legs end."""
        way, height = place[rows] - begun[rows], top[rows] - begun[rows, 2]
        legs[rows, number] = np.column_stack([way[:, :2], normal, way[:, 2], height])

    for _ in range(STEPS):
        goes = leg < LEGS
        step = np.where(goes[:, None], STEP * np.column_stack([ahead, climb]), 0.0)
        met = sweep(place, place + step)
        hit, normal = np.asarray(met.hit) & goes, np.asarray(met.normal)
        place += np.maximum(np.asarray(met.alpha) - hit * (APART / STEP), 0.0)[:, None] * step
        top = np.maximum(top, place[:, 2])
        walls = hit & (normal[:, 2] < WALL)
        climbs = hit & ~walls
        # Down to the ground, but not into the cup.
        looks = goes & ~climbs
        below = sweep(place, place + looks[:, None] * np.array([0.0, 0.0, -FALL]))
        falls = np.asarray(below.hit) & looks
        falls &= np.hypot(place[:, 0] - cup[:, 0], place[:, 1] - cup[:, 1]) >= cup_radius + 0.5 * radius
        place[:, 2] -= np.where(falls, np.maximum(FALL * np.asarray(below.alpha) - radius, 0.0), 0.0)
        rows, aside = np.flatnonzero(walls), normal[walls, :2]
        aside /= np.maximum(np.hypot(aside[:, 0], aside[:, 1]), SHORTEST)[:, None]  # A ceiling has none.
        end(rows, leg[rows], aside)
        ahead[rows] -= 2.0 * (ahead[rows] * aside).sum(-1)[:, None] * aside
        leg[rows] += 1
        climb = np.where(climbs, -(ahead * normal[:, :2]).sum(-1) / np.maximum(normal[:, 2], WALL), 0.0)
    for k in range(LEGS):
        rows = np.flatnonzero(leg <= k)
        end(rows, k, np.zeros((len(rows), 2)))
    return legs.reshape(n, ECHOES, LEGS, ECHO)
