"""Features of putts: lines are reflected off walls, and the features of a turned hole are the same."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.courses.procedural.lane_features import FELT_ROLLING_RESISTANCE
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.observations.bounce_rays import FEATURES_PER_SEGMENT, NUM_BOUNCE_RAYS
from minigolf_env.envs.observations.rays import CUP_DISTANCE_SCALE
from minigolf_env.players.putt_features import (
    CUP_INDEX,
    FIRST_RAY_INDEX,
    NUM_FEATURES,
    NUM_SEGMENTS,
    RAY_UNITS,
    REFLECTION_SIGNS,
    ROLL_KEPT_PER_BOUNCE,
    SLOPE_INDEX,
    putt_actions,
    putt_features,
    trace_lines,
)
from tests.players.samples import random_observations

ROOM_WALLS = np.array([[-0.7, 1.1], [-0.4, 0.9]])
"""Walls of a room around the ball: least and greatest x, then y."""


def bounce_rays_of_room() -> NDArray[np.float32]:
    """Return the segments (1, R, NUM_SEGMENTS, FEATURES_PER_SEGMENT) of the R bounce rays in the room, m."""
    segments = np.zeros((1, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT), np.float32)
    for k, angle in enumerate(2.0 * np.pi * np.arange(NUM_BOUNCE_RAYS) / NUM_BOUNCE_RAYS):
        position = np.zeros(2)
        direction = np.array([np.cos(angle), np.sin(angle)])
        for segment in segments[0, k]:
            wall_position = np.where(direction > 0.0, ROOM_WALLS[:, 1], ROOM_WALLS[:, 0])
            distance = np.abs((wall_position - position) / np.where(direction == 0.0, 1e-12, direction))
            wall = int(distance.argmin())
            position = position + distance[wall] * direction
            segment[:2] = position
            segment[2 + wall] = -np.sign(direction[wall])
            direction[wall] *= -1.0
    return segments


def bounce_rays_in(observations: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a view (N, R, NUM_SEGMENTS, FEATURES_PER_SEGMENT) of the R bounce rays in observations."""
    return observations[:, FIRST_RAY_INDEX:].reshape(
        len(observations), NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT
    )


def test_lines_follow_mirror_images_of_room() -> None:
    """A reflected line, unfolded, is straight: exact segments end at the mirror images of the room's walls."""
    directions = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, 200)
    segments = trace_lines(bounce_rays_of_room(), directions[None].astype(np.float32))
    is_exact = np.array([segment.is_exact[0] for segment in segments])
    assert (is_exact.mean(axis=1) > [0.9, 0.8, 0.7, 0.6]).all() and not is_exact[-1].all()
    size = ROOM_WALLS[:, 1] - ROOM_WALLS[:, 0]
    for k, angle in enumerate(directions):
        direction = np.array([np.cos(angle), np.sin(angle)])
        first = np.where(direction > 0.0, ROOM_WALLS[:, 1], ROOM_WALLS[:, 0]) / direction
        wall_distances = [first[i] + np.arange(NUM_SEGMENTS) * size[i] / abs(direction[i]) for i in (0, 1)]
        expected = np.sort(np.concatenate(wall_distances))[:NUM_SEGMENTS]
        traced = np.cumsum([segment.length[0, k] for segment in segments])
        np.testing.assert_allclose(traced[is_exact[:, k]], expected[is_exact[:, k]], rtol=1e-3)


def test_features_are_invariant_under_rotation_of_hole() -> None:
    """Turning the hole and the putts together does not change the features."""
    observations, rng = random_observations(20), np.random.default_rng(1)
    directions, rolls = rng.uniform(0.0, 6.0, (20, 5)), rng.uniform(0.3, 30.0, (20, 5, 2))
    expected = putt_features(observations, directions, rolls)
    assert expected.shape == (20, 5, 2, NUM_FEATURES) and np.isfinite(expected).all()
    for steps in (1, 8, 61):
        angle = 2.0 * np.pi * steps / NUM_BOUNCE_RAYS
        rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        turned = observations.copy()
        rays = bounce_rays_in(turned)
        rays[:] = np.roll(bounce_rays_in(observations), steps, axis=1)
        for first in (0, 2):  # The end of a segment, and the normal of its wall.
            rays[..., first : first + 2] = rays[..., first : first + 2] @ rotation
        for first in (0, SLOPE_INDEX, CUP_INDEX):  # The position, the slope, the cup.
            turned[:, first : first + 2] = observations[:, first : first + 2] @ rotation
        error = np.abs(putt_features(turned, directions + angle, rolls) - expected)
        assert np.quantile(error, 0.95) < 1e-3  # Rounding decides whether a line that grazes a wall hits it.


def test_reflection_of_hole_changes_signs_of_left_components() -> None:
    """Mirroring the hole and the putts (y becomes -y) multiplies the features by REFLECTION_SIGNS."""
    observations, rng = random_observations(20), np.random.default_rng(1)
    directions, rolls = rng.uniform(0.0, 6.0, (20, 5)), rng.uniform(0.3, 30.0, (20, 5, 2))
    mirrored = observations.copy()
    rays = bounce_rays_in(mirrored)
    rays[:] = bounce_rays_in(observations)[:, -np.arange(NUM_BOUNCE_RAYS)]
    rays[..., [1, 3]] *= -1.0
    for first in (0, SLOPE_INDEX, CUP_INDEX):  # The position, the slope, the cup.
        mirrored[:, first + 1] *= -1.0
    expected = REFLECTION_SIGNS * putt_features(observations, directions, rolls)
    error = np.abs(putt_features(mirrored, -directions, rolls) - expected)
    # Rounding decides whether a line that grazes a wall hits it.
    assert np.quantile(error, 0.95, axis=(0, 1, 2)).max() < 1e-3


@pytest.mark.parametrize(("difficulty", "level", "bounces"), [("easy", 5, 2), ("medium", 3, 3)])
def test_predicted_distance_to_cup_matches_simulation(difficulty: str, level: int, bounces: int) -> None:
    """On a level, most putts with few bounces rest at the predicted distance from the cup, to 3 mm."""
    env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed", observation="bounce_rays")
    observation, _ = env.reset(options={"level": level})
    rng = np.random.default_rng(0)
    directions, rolls = rng.uniform(0.0, 2.0 * np.pi, 300), rng.uniform(0.2, 3.0, 300)
    predicted = 4.0 * putt_features(observation[None], directions[None], rolls[None, :, None])[0, :, 0, -2]
    outcome = env.what_if(putt_actions(directions, rolls))
    simulated = np.hypot(*(outcome.position - np.asarray(env.task.cup.position)).T[:2])
    selected = ~outcome.holed & (outcome.bounces <= bounces) & (predicted < 4.0)
    assert (outcome.bounces[selected] == bounces).sum() > 5
    assert np.quantile(np.abs(simulated - predicted)[selected], 0.75) < 0.003


def test_features_of_straight_putt_say_that_it_drops() -> None:
    """The cup is straight ahead on the first segment; the ball drops unless its roll ends before the cup."""
    observations, cup = random_observations(1), np.array([0.8, 0.2])
    distance, direction = float(np.hypot(*cup)), float(np.arctan2(*cup[::-1]))
    bounce_rays_in(observations)[:] = bounce_rays_of_room() / RAY_UNITS
    observations[:, CUP_INDEX : CUP_INDEX + 2] = cup / np.sqrt(CUP_DISTANCE_SCALE * distance)
    rolls = np.array([[[distance + 0.2, distance - 0.2]]])
    features = putt_features(observations, np.array([[direction]]), rolls)[0, 0]
    np.testing.assert_allclose(features[:, 7:9] * 4.0, distance, rtol=1e-5)
    np.testing.assert_allclose(features[:, 9:13], 0.0, atol=1e-5)
    drops = 20 + 11 * NUM_SEGMENTS
    assert features[0, drops] > 0.9 and features[1, drops] == 0.0
    # Of a putt aimed to the right of the cup, the cup is on the left of the putt and of its first segment.
    aimed_right = putt_features(observations, np.array([[direction - 0.1]]), np.array([[[distance]]]))[0, 0, 0]
    miss = distance * np.sin(0.1)
    np.testing.assert_allclose([aimed_right[11], aimed_right[15]], [miss, miss / 2.0], rtol=1e-3)


def test_climb_takes_roll_of_equal_energy() -> None:
    """A rise of 5 cm before a wall, in units of 10 cm, takes the roll distance with the energy of the climb."""
    observations = random_observations(1)
    # The cup is behind the wall where the second segment starts.
    observations[:, CUP_INDEX : CUP_INDEX + 2] = [0.5, 0.0]
    features = []
    for height in (0.0, 0.05):
        room = bounce_rays_of_room()
        room[..., 4:] = height
        bounce_rays_in(observations)[:] = room / RAY_UNITS
        features.append(putt_features(observations, np.array([[0.0]]), np.array([[[3.0]]]))[0, 0, 0])
    flat, climb = features
    np.testing.assert_allclose(climb[[22, 23]], [0.5, 0.5], rtol=1e-5)
    roll_left = 18 + 11 * NUM_SEGMENTS + 3  # The roll left where the second segment passes the cup, in metres.
    expected = ROLL_KEPT_PER_BOUNCE * (3.0 - 1.1 - np.array([0.0, 0.05]) / FELT_ROLLING_RESISTANCE)
    np.testing.assert_allclose([flat[roll_left], climb[roll_left]], expected, rtol=1e-4)
