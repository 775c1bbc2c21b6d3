"""What a ball foresees of a putt: lines go off walls as light off mirrors, and a hole that is turned looks the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.rays import AWAY, RAYS, REACH
from minigolf_env.network import Layer, Network
from minigolf_env.sight import (
    DEPTH,
    HEIGHT,
    LEGS,
    MIRROR,
    NUMBERS,
    RAY,
    SLOPE,
    STRAIGHT,
    TOP_ROLL,
    WAYS,
    Effort,
    actions,
    best,
    foresee,
    lines,
    outline,
)

ROOM = np.array([[-0.7, 1.1], [-0.4, 0.9]])
"""Walls of a room around the ball: least and largest x, y."""


def rays_of_room() -> NDArray[np.float64]:
    """Return the shares (1, RAYS) of their reach that rays go in the room."""
    with np.errstate(divide="ignore"):
        sides = np.where(WAYS > 0.0, ROOM[:, 1], ROOM[:, 0]) / np.where(WAYS == 0.0, 1e-12, WAYS)
    return np.asarray(np.abs(sides).min(axis=1)[None] / REACH)


def observations(n: int) -> NDArray[np.float32]:
    """Return n random observations of rays."""
    rng = np.random.default_rng(0)
    seen = rng.uniform(-0.5, 0.5, (n, HEIGHT + 1))
    seen[:, RAY:DEPTH] = rng.uniform(0.02, 1.0, (n, RAYS))
    return seen.astype(np.float32)


def judge(seed: int = 0) -> Network:
    """Return a judge with random weights."""
    rng = np.random.default_rng(seed)
    sizes = ((NUMBERS, 16), (16, 2))
    layers = tuple(Layer(*(rng.normal(size=s).astype(np.float32) for s in (size, size[1:]))) for size in sizes)
    return Network(layers, "relu", judges=True)


def test_rays_find_the_corners_of_a_room() -> None:
    """All four, where they are, though no ray ends in one."""
    corners, fits = outline(rays_of_room().astype(np.float32))
    found = corners[0][fits[0]]
    for x in ROOM[0]:
        for y in ROOM[1]:
            assert np.hypot(*(found - [x, y]).T).min() < 1e-4


def test_lines_go_on_behind_mirrors() -> None:
    """Unfolded, a line is straight: its legs end where it meets the walls of the room's mirror images."""
    directions = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, 200)
    legs = lines(outline(rays_of_room().astype(np.float32))[0], directions[None].astype(np.float32))
    for k, direction in enumerate(directions):
        way = np.array([np.cos(direction), np.sin(direction)])
        size = ROOM[:, 1] - ROOM[:, 0]
        first = np.where(way > 0.0, ROOM[:, 1], ROOM[:, 0]) / way
        met = np.sort(np.concatenate([first[i] + np.arange(LEGS) * size[i] / abs(way[i]) for i in (0, 1)]))[:LEGS]
        if np.diff(met, prepend=0.0).min() > 0.01:  # Not into a corner.
            np.testing.assert_allclose(np.cumsum([leg.length[0, k] for leg in legs]), met, rtol=1e-3)


def test_a_turned_hole_looks_the_same() -> None:
    """Putts that are turned with it have the same sight."""
    seen, rng = observations(20), np.random.default_rng(1)
    directions, rolls = rng.uniform(0.0, 6.0, (20, 5)), rng.uniform(0.3, 30.0, (20, 5, 2))
    expected = foresee(seen, directions, rolls)
    assert expected.shape == (20, 5, 2, NUMBERS) and np.abs(expected).max() <= 4.0
    for steps in (1, 8, 21):
        angle = 2.0 * np.pi * steps / RAYS
        rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        turned = seen.copy()
        turned[:, RAY:DEPTH] = np.roll(seen[:, RAY:DEPTH], steps, axis=1)
        for first in (0, SLOPE, STRAIGHT):  # The place, the slope, the cup.
            turned[:, first : first + 2] = seen[:, first : first + 2] @ rotation
        error = np.abs(foresee(turned, directions + angle, rolls) - expected)
        assert np.quantile(error, 0.99) < 1e-3  # A line that meets a corner may go either way.


def test_a_mirrored_hole_looks_mirrored() -> None:
    """Left and right are exchanged, and nothing else: x stays, y is turned."""
    seen, rng = observations(20), np.random.default_rng(1)
    directions, rolls = rng.uniform(0.0, 6.0, (20, 5)), rng.uniform(0.3, 30.0, (20, 5, 2))
    mirrored = seen.copy()
    mirrored[:, RAY:DEPTH] = seen[:, RAY:DEPTH][:, -np.arange(RAYS)]
    for first in (0, SLOPE, STRAIGHT):  # The place, the slope, the cup.
        mirrored[:, first + 1] *= -1.0
    error = np.abs(foresee(mirrored, -directions, rolls) - MIRROR * foresee(seen, directions, rolls))
    assert np.quantile(error, 0.95, axis=(0, 1, 2)).max() < 1e-3  # A line that meets a corner may go either way.


def test_balls_do_what_was_foreseen() -> None:
    """On a level, with few bounces: most putts rest where they were foreseen to, from the cup, to millimetres."""
    env = MiniGolfEnv("procedural", difficulty="easy", tee="fixed", observation="rays")
    seen, _ = env.reset(options={"level": 5})
    rng = np.random.default_rng(0)
    directions, rolls = rng.uniform(0.0, 2.0 * np.pi, 300), rng.uniform(0.2, 3.0, 300)
    foreseen = 4.0 * foresee(seen[None], directions[None], rolls[None, :, None])[0, :, 0, -2]
    outcome = env.what_if(actions(directions, rolls))
    rest = np.hypot(*(outcome.position - np.asarray(env.task.cup.position)).T[:2])
    plain = ~outcome.holed & (outcome.bounces <= 2)
    assert (outcome.bounces[plain] == 2).sum() > 30
    assert np.quantile(np.abs(rest - foreseen)[plain], 0.75) < 0.003


def test_a_putt_straight_at_the_cup_drops() -> None:
    """Its sight says so: nothing to the left, the cup under the first leg, unless the roll ends before it."""
    seen, cup = observations(1), np.array([0.8, 0.2])
    away, direction = float(np.hypot(*cup)), float(np.arctan2(*cup[::-1]))
    seen[:, RAY:DEPTH], seen[:, STRAIGHT : STRAIGHT + 2] = rays_of_room(), cup / np.sqrt(AWAY * away)
    sight = foresee(seen, np.array([[direction]]), np.array([[[away + 0.2, away - 0.2]]]))[0, 0]
    np.testing.assert_allclose(sight[:, 7:9] * 4.0, away, rtol=1e-5)
    np.testing.assert_allclose(sight[:, 9:13], 0.0, atol=1e-5)
    drops = 20 + 9 * LEGS
    assert sight[0, drops] > 0.9 and sight[1, drops] == 0.0
    # Aimed to the right of it, the cup is to the left: of the putt, and of the first leg.
    aside = foresee(seen, np.array([[direction - 0.1]]), np.array([[[away]]]))[0, 0, 0]
    np.testing.assert_allclose([aside[11], aside[15]], [away * np.sin(0.1), away * np.sin(0.1) / 2.0], rtol=1e-3)


def test_the_best_putt_is_found() -> None:
    """Of a cost with one hill, to the step of the last refinement; and drawn first putts find it as well."""
    seen = observations(3)
    seen[:, STRAIGHT : STRAIGHT + 2] = [0.5, 0.0]  # 2 m along x.

    def cost(sights: NDArray[Any]) -> NDArray[np.float32]:
        ahead, roll = sights[..., 8] * 4.0, sights[..., 14 + 9 * LEGS] * TOP_ROLL
        return np.asarray(np.square(4.0 * ahead - 8.0 * np.cos(0.4)) + np.square(np.log(roll / 3.0)), dtype=np.float32)

    for rng in (None, np.random.default_rng(0)):
        putts = best(seen, cost, Effort(48, 6, 3), rng)
        np.testing.assert_allclose(np.abs((putts.direction + np.pi) % (2.0 * np.pi) - np.pi), 0.4, atol=0.03)
        np.testing.assert_allclose(putts.roll, 3.0, rtol=0.1)
        np.testing.assert_allclose(np.square(np.hypot(*putts.actions.T)) * TOP_ROLL, putts.roll, rtol=1e-5)


@pytest.mark.parametrize("n", [1, 2, 33, 70])
def test_a_putt_has_the_same_bits_in_any_batch(n: int) -> None:
    """Whatever the number of balls that are looked at together."""
    seen, cost = observations(70), judge().cost
    together = best(seen, cost)
    for first in (0, 70 - n):
        some = best(seen[first : first + n], cost)
        for part, whole in zip(some, together, strict=True):
            assert part.tobytes() == whole[first : first + n].tobytes()


def test_every_view_of_levels_can_be_judged() -> None:
    """From the tees and from wherever putts lead, all numbers are finite."""
    envs = MiniGolfVectorEnv(32, "procedural", difficulty="hard", num_levels=8, observation="rays")
    seen, _ = envs.reset(seed=0)
    for _ in range(3):
        putts = best(seen, judge().cost, Effort(8, 3, 1))
        assert np.isfinite(putts.cost).all() and np.isfinite(putts.actions).all()
        seen, *_ = envs.step(putts.actions)
