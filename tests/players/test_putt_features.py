"""What a ball foresees of a putt: lines go off walls as light off mirrors, and a hole that is turned looks the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.courses.procedural.features import ROLLING
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.observations.bounce_rays import FEATURES_PER_SEGMENT, MAX_BOUNCE_RAY_LENGTH, NUM_BOUNCE_RAYS
from minigolf_env.envs.observations.rays import CUP_DISTANCE_SCALE
from minigolf_env.players.network import Layer, Network
from minigolf_env.players.putt_features import (
    ECHOED,
    MIRROR,
    NUM_SEGMENTS,
    NUMBERS,
    SHARE,
    SLOPE,
    STRAIGHT,
    TOP_ROLL,
    Effort,
    actions,
    best,
    foresee,
    lines,
)

ROOM = np.array([[-0.7, 1.1], [-0.4, 0.9]])
"""Walls of a room around the ball: least and largest x, y."""


def echoes_of_room() -> NDArray[np.float32]:
    """Return the legs (1, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT) of rays in the room, m."""
    legs = np.zeros((1, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT), np.float32)
    for k, turn in enumerate(2.0 * np.pi * np.arange(NUM_BOUNCE_RAYS) / NUM_BOUNCE_RAYS):
        place, way = np.zeros(2), np.array([np.cos(turn), np.sin(turn)])
        for leg in legs[0, k]:
            far = np.abs((np.where(way > 0.0, ROOM[:, 1], ROOM[:, 0]) - place) / np.where(way == 0.0, 1e-12, way))
            wall = int(far.argmin())
            place = place + far[wall] * way
            leg[:2], leg[2 + wall] = place, -np.sign(way[wall])
            way[wall] *= -1.0
    return legs


def observations(n: int) -> NDArray[np.float32]:
    """Return n random observations of echoes."""
    rng = np.random.default_rng(0)
    echoes = rng.uniform(-0.2, 0.2, (n, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT))
    normal = rng.uniform(0.0, 2.0 * np.pi, (n, NUM_BOUNCE_RAYS, NUM_SEGMENTS))
    echoes[..., 2], echoes[..., 3] = np.cos(normal), np.sin(normal)
    return np.concatenate([rng.uniform(-0.5, 0.5, (n, ECHOED)), echoes.reshape(n, -1)], axis=1).astype(np.float32)


def echoes_in(seen: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a view (N, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT) of the echoes in observations."""
    return seen[:, ECHOED:].reshape(len(seen), NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT)


def judge(seed: int = 0) -> Network:
    """Return a judge with random weights."""
    rng = np.random.default_rng(seed)
    sizes = ((NUMBERS, 16), (16, 2))
    layers = tuple(Layer(*(rng.normal(size=s).astype(np.float32) for s in (size, size[1:]))) for size in sizes)
    return Network(layers, "relu", judges=True)


def test_lines_go_on_behind_mirrors() -> None:
    """Unfolded, a line is straight: while it is sure, its legs end where it meets the room's mirror images."""
    directions = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, 200)
    legs = lines(echoes_of_room(), directions[None].astype(np.float32))
    sure = np.array([leg.sure[0] for leg in legs])
    assert (sure.mean(axis=1) > [0.9, 0.8, 0.7, 0.6]).all() and not sure[-1].all()
    for k, direction in enumerate(directions):
        way = np.array([np.cos(direction), np.sin(direction)])
        size = ROOM[:, 1] - ROOM[:, 0]
        first = np.where(way > 0.0, ROOM[:, 1], ROOM[:, 0]) / way
        crossings = [first[i] + np.arange(NUM_SEGMENTS) * size[i] / abs(way[i]) for i in (0, 1)]
        met = np.sort(np.concatenate(crossings))[:NUM_SEGMENTS]
        found = np.cumsum([leg.length[0, k] for leg in legs])
        np.testing.assert_allclose(found[sure[:, k]], met[sure[:, k]], rtol=1e-3)


def test_a_turned_hole_looks_the_same() -> None:
    """Putts that are turned with it have the same sight."""
    seen, rng = observations(20), np.random.default_rng(1)
    directions, rolls = rng.uniform(0.0, 6.0, (20, 5)), rng.uniform(0.3, 30.0, (20, 5, 2))
    expected = foresee(seen, directions, rolls)
    assert expected.shape == (20, 5, 2, NUMBERS) and np.isfinite(expected).all()
    for steps in (1, 8, 61):
        angle = 2.0 * np.pi * steps / NUM_BOUNCE_RAYS
        rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        turned = seen.copy()
        echoes = echoes_in(turned)
        echoes[:] = np.roll(echoes_in(seen), steps, axis=1)
        for first in (0, 2):  # A leg's end, and its wall's normal.
            echoes[..., first : first + 2] = echoes[..., first : first + 2] @ rotation
        for first in (0, SLOPE, STRAIGHT):  # The place, the slope, the cup.
            turned[:, first : first + 2] = seen[:, first : first + 2] @ rotation
        error = np.abs(foresee(turned, directions + angle, rolls) - expected)
        assert np.quantile(error, 0.95) < 1e-3  # A line that all but misses a wall may go either way.


def test_a_mirrored_hole_looks_mirrored() -> None:
    """Left and right are exchanged, and nothing else: x stays, y is turned."""
    seen, rng = observations(20), np.random.default_rng(1)
    directions, rolls = rng.uniform(0.0, 6.0, (20, 5)), rng.uniform(0.3, 30.0, (20, 5, 2))
    mirrored = seen.copy()
    echoes = echoes_in(mirrored)
    echoes[:] = echoes_in(seen)[:, -np.arange(NUM_BOUNCE_RAYS)]
    echoes[..., [1, 3]] *= -1.0
    for first in (0, SLOPE, STRAIGHT):  # The place, the slope, the cup.
        mirrored[:, first + 1] *= -1.0
    error = np.abs(foresee(mirrored, -directions, rolls) - MIRROR * foresee(seen, directions, rolls))
    assert np.quantile(error, 0.95, axis=(0, 1, 2)).max() < 1e-3  # A line that all but misses a wall may go either way.


@pytest.mark.parametrize(("difficulty", "level", "bounces"), [("easy", 5, 2), ("medium", 3, 3)])
def test_balls_do_what_was_foreseen(difficulty: str, level: int, bounces: int) -> None:
    """On a level, with few bounces: most putts rest where they were foreseen to, from the cup, to millimetres."""
    env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed", observation="bounce_rays")
    seen, _ = env.reset(options={"level": level})
    rng = np.random.default_rng(0)
    directions, rolls = rng.uniform(0.0, 2.0 * np.pi, 300), rng.uniform(0.2, 3.0, 300)
    foreseen = 4.0 * foresee(seen[None], directions[None], rolls[None, :, None])[0, :, 0, -2]
    outcome = env.what_if(actions(directions, rolls))
    rest = np.hypot(*(outcome.position - np.asarray(env.task.cup.position)).T[:2])
    plain = ~outcome.holed & (outcome.bounces <= bounces) & (foreseen < 4.0)
    assert (outcome.bounces[plain] == bounces).sum() > 5
    assert np.quantile(np.abs(rest - foreseen)[plain], 0.75) < 0.003


def test_a_putt_straight_at_the_cup_drops() -> None:
    """Its sight says so: nothing to the left, the cup under the first leg, unless the roll ends before it."""
    seen, cup = observations(1), np.array([0.8, 0.2])
    away, direction = float(np.hypot(*cup)), float(np.arctan2(*cup[::-1]))
    echoes_in(seen)[:] = echoes_of_room() / [MAX_BOUNCE_RAY_LENGTH, MAX_BOUNCE_RAY_LENGTH, 1.0, 1.0, 1.0, 1.0]
    seen[:, STRAIGHT : STRAIGHT + 2] = cup / np.sqrt(CUP_DISTANCE_SCALE * away)
    sight = foresee(seen, np.array([[direction]]), np.array([[[away + 0.2, away - 0.2]]]))[0, 0]
    np.testing.assert_allclose(sight[:, 7:9] * 4.0, away, rtol=1e-5)
    np.testing.assert_allclose(sight[:, 9:13], 0.0, atol=1e-5)
    drops = 20 + 11 * NUM_SEGMENTS
    assert sight[0, drops] > 0.9 and sight[1, drops] == 0.0
    # Aimed to the right of it, the cup is to the left: of the putt, and of the first leg.
    aside = foresee(seen, np.array([[direction - 0.1]]), np.array([[[away]]]))[0, 0, 0]
    np.testing.assert_allclose([aside[11], aside[15]], [away * np.sin(0.1), away * np.sin(0.1) / 2.0], rtol=1e-3)


def test_a_climb_takes_its_share_of_the_roll() -> None:
    """A rise of 5 cm before the wall, told in units of 10 cm, takes the roll whose energy it takes."""
    seen = observations(1)
    seen[:, STRAIGHT : STRAIGHT + 2] = [0.5, 0.0]  # The cup is behind the wall, where the second leg comes from.
    sights = []
    for height in (0.0, 0.05):
        room = echoes_of_room()
        room[..., 4:] = height
        echoes_in(seen)[:] = room / [MAX_BOUNCE_RAY_LENGTH, MAX_BOUNCE_RAY_LENGTH, 1.0, 1.0, 1.0, 1.0]
        sights.append(foresee(seen, np.array([[0.0]]), np.array([[[3.0]]]))[0, 0, 0])
    level, risen = sights
    np.testing.assert_allclose(risen[[22, 23]], [0.5, 0.5], rtol=1e-5)
    left = 18 + 11 * NUM_SEGMENTS + 3  # The roll where the second leg passes the cup, 1 is a metre.
    np.testing.assert_allclose(
        [level[left], risen[left]], SHARE * (3.0 - 1.1 - np.array([0.0, 0.05]) / ROLLING), rtol=1e-4
    )


def test_the_best_putt_is_found() -> None:
    """Of a cost with one hill, to the step of the last refinement; and drawn first putts find it as well."""
    seen = observations(3)
    seen[:, STRAIGHT : STRAIGHT + 2] = [0.5, 0.0]  # 2 m along x.

    def cost(sights: NDArray[Any]) -> NDArray[np.float32]:
        ahead, roll = sights[..., 8] * 4.0, sights[..., 14 + 11 * NUM_SEGMENTS] * TOP_ROLL
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
    envs = MiniGolfVectorEnv(32, "procedural", difficulty="hard", num_levels=8, observation="bounce_rays")
    seen, _ = envs.reset(seed=0)
    for _ in range(3):
        putts = best(seen, judge().cost, Effort(8, 3, 1))
        assert np.isfinite(putts.cost).all() and np.isfinite(putts.actions).all()
        seen, *_ = envs.step(putts.actions)
