"""The observation "rays": exact free distances, the ground and the cup."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.observations.rays import MAX_RAY_LENGTH, NUM_RAYS, RAY_ANGLES

BALL_RADIUS = 0.02135


def ray_features(x: float, y: float) -> NDArray[Any]:
    """Return the 38 numbers that "rays" adds, for a ball on the dogleg's felt."""
    env = MiniGolfEnv(observation="rays")
    return np.asarray(env.reset(options={"position": (x, y, BALL_RADIUS)})[0][10:])


def test_rays_end_at_the_borders() -> None:
    """On the dogleg's first part their lengths are the distances to the borders, less the ball's radius."""
    features = ray_features(0.5, 0.4)[:NUM_RAYS] * MAX_RAY_LENGTH
    np.testing.assert_allclose(features[NUM_RAYS // 4], 1.25 - 0.4 - BALL_RADIUS, atol=1e-6)
    np.testing.assert_allclose(features[NUM_RAYS // 2], 0.5 - BALL_RADIUS, atol=1e-6)
    np.testing.assert_allclose(features[3 * NUM_RAYS // 4], 0.4 - BALL_RADIUS, atol=1e-6)
    np.testing.assert_allclose(features[5 * NUM_RAYS // 8], (0.4 - BALL_RADIUS) * np.sqrt(2.0), atol=1e-6)


def test_ball_moved_along_its_ray_touches() -> None:
    """The ball's clearance is zero at the end of a ray."""
    env = MiniGolfEnv(observation="rays")
    world = env.task.world
    rng = np.random.default_rng(0)
    for x, y in rng.uniform((0.1, 0.1), (2.5, 1.1), (40, 2)):
        position = np.array([x, y, BALL_RADIUS])
        if world.clearance(position) < 0:
            continue
        features = env.reset(options={"position": tuple(position)})[0][10:].astype(np.float64)
        for angle, share in zip(RAY_ANGLES, features[:NUM_RAYS], strict=True):
            if share < 1.0:
                touching = (
                    position
                    + [0, 0, BALL_RADIUS]
                    + share * MAX_RAY_LENGTH * np.array([np.cos(angle), np.sin(angle), 0.0])
                )
                assert abs(world.clearance(touching)) < 1e-6


def test_ground_features_are_depth_and_slope() -> None:
    """Flat felt has no depth and no slope. Above the cup the ground is further down."""
    np.testing.assert_array_equal(ray_features(1.0, 0.3)[NUM_RAYS : NUM_RAYS + 3], [0.0, 0.0, 0.0])
    assert ray_features(3.45, 2.1)[NUM_RAYS] > 0.1


def test_cup_features_have_the_same_scale_on_every_hole() -> None:
    """They are the direction, as long as the root of the distance in units of 8 m, and the height above the ball, m."""
    for name in ("dogleg", "hill"):
        env = MiniGolfEnv(name, observation="rays", tee="fixed")
        observed = np.asarray(env.reset(seed=0)[0][-3:], dtype=np.float64)
        to_cup = np.asarray(env.task.cup.position) - env.get_state()["position"]
        np.testing.assert_allclose(np.hypot(*observed[:2]) ** 2 * 8.0, np.hypot(*to_cup[:2]), rtol=1e-5)
        np.testing.assert_allclose(observed[1] / observed[0], to_cup[1] / to_cup[0], rtol=1e-5)
        np.testing.assert_allclose(observed[2], to_cup[2], atol=1e-6)


@pytest.mark.parametrize("observation", ["rays", "bounce_rays"])
@pytest.mark.parametrize("course", ["dogleg", "procedural"])
def test_batch_observes_what_single_environments_do_bitwise(course: str, observation: str) -> None:
    """Observations of "rays" and "bounce_rays" have the same bits."""
    batch = MiniGolfVectorEnv(5, course, observation=observation)
    singles = [MiniGolfEnv(course, observation=observation) for _ in range(5)]
    observed = batch.reset(seed=3)[0]
    np.testing.assert_array_equal(observed, [env.reset(seed=3 + i)[0] for i, env in enumerate(singles)])
    putts = np.random.default_rng(0).uniform(-1, 1, (5, 2)).astype(np.float32)
    np.testing.assert_array_equal(
        batch.step(putts)[0], [env.step(putt)[0] for env, putt in zip(singles, putts, strict=True)]
    )


@pytest.mark.parametrize("observation", ["rays", "bounce_rays"])
def test_checker_accepts_ray_observations(observation: str) -> None:
    """Gymnasium's checker, without rendering: there is no display here."""
    check_env(gym.make("MiniGolf-v0", observation=observation).unwrapped, skip_render_check=True)
