"""The observation "bounce_rays": rays are reflected off walls and follow the ground."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.observations.bounce_rays import (
    FEATURES_PER_SEGMENT,
    HIT_STANDOFF,
    MAX_BOUNCE_RAY_LENGTH,
    NUM_BOUNCE_RAYS,
    NUM_SEGMENTS,
    RAY_STEP_LENGTH,
)
from minigolf_env.envs.observations.rays import MAX_RAY_LENGTH, NUM_RAYS

BALL_RADIUS = 0.02135


def segments_of(env: MiniGolfEnv, **options: Any) -> NDArray[np.float64]:
    """Return the segments (NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT), m, of a ball's rays."""
    features = env.reset(seed=0, options=options)[0][16:].astype(np.float64)
    features = features.reshape(NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT)
    features[..., :2] *= MAX_BOUNCE_RAY_LENGTH
    return np.asarray(features)


@pytest.mark.parametrize("position", [(0.5, 0.4, BALL_RADIUS), (2.9, 1.7, BALL_RADIUS)], ids=str)
def test_first_segment_equals_a_ray(position: tuple[float, float, float]) -> None:
    """On flat felt it is as long as the ray of "rays", less the standoff from walls."""
    rays = MiniGolfEnv(observation="rays").reset(options={"position": position})[0][10 : 10 + NUM_RAYS] * MAX_RAY_LENGTH
    first = segments_of(MiniGolfEnv(observation="bounce_rays"), position=position)[:: NUM_BOUNCE_RAYS // NUM_RAYS, 0]
    near = rays < 0.999 * MAX_RAY_LENGTH
    np.testing.assert_allclose(np.hypot(*first[near, :2].T), rays[near] - HIT_STANDOFF, atol=1e-5)


def test_rays_are_reflected_off_walls() -> None:
    """The direction's part along the wall's normal is reversed, and nothing else."""
    segments = segments_of(MiniGolfEnv(observation="bounce_rays"), position=(0.5, 0.4, BALL_RADIUS))
    directions = np.diff(segments[..., :2], axis=1, prepend=0.0)
    sizes = np.hypot(directions[..., 0], directions[..., 1])
    directions /= np.maximum(sizes, 1e-9)[..., None]
    normals = segments[..., 2:4]
    compared = 0
    for k in range(NUM_SEGMENTS - 1):
        long = np.minimum(sizes[:, k], sizes[:, k + 1]) > 0.05
        expected = directions[:, k] - 2.0 * (directions[:, k] * normals[:, k]).sum(-1)[:, None] * normals[:, k]
        np.testing.assert_allclose(directions[long, k + 1], expected[long], atol=1e-3)
        compared += int(long.sum())
    assert compared > 200
    np.testing.assert_allclose(segments[..., 4:], 0.0, atol=1e-6)  # The felt is flat, and rays pass over the cup.


def test_bounce_rays_climb_a_hill() -> None:
    """Bounce rays reach the walls behind the hill, where "rays" end at its foot, and report its height."""
    env = MiniGolfEnv("hill", observation="bounce_rays", tee="fixed")
    segments = segments_of(env)
    rays = MiniGolfEnv("hill", observation="rays", tee="fixed").reset(seed=0)[0][10 : 10 + NUM_RAYS] * MAX_RAY_LENGTH
    first = segments[:: NUM_BOUNCE_RAYS // NUM_RAYS, 0]
    further = np.hypot(*first[:, :2].T) > rays + 0.5
    assert further.any() and (first[further, 5] > 0.03).all()
    assert (segments[..., 5] >= segments[..., 4] - 1e-6).all() and (np.diff(segments[..., 5], axis=1) >= -1e-6).all()


def test_bounce_rays_do_not_fall_into_the_cup() -> None:
    """A ray that is brought down above the cup stays level."""
    env = MiniGolfEnv(observation="bounce_rays")
    x, y, _ = env.task.cup.position
    segments = segments_of(env, position=(x, y - RAY_STEP_LENGTH, BALL_RADIUS))
    np.testing.assert_allclose(segments[NUM_BOUNCE_RAYS // 4, :, 4:], 0.0, atol=1e-6)


@pytest.mark.parametrize("course", ["dogleg", "loop", "islands", "volcano", "tunnel"])
def test_features_are_finite_on_every_hole(course: str) -> None:
    """Features under roofs and next to water are finite; normals have length 1, or 0 where a segment hits no wall."""
    segments = segments_of(MiniGolfEnv(course, observation="bounce_rays"))
    assert np.isfinite(segments).all()
    sizes = np.hypot(segments[..., 2], segments[..., 3])
    assert np.minimum(np.abs(sizes - 1.0), sizes).max() < 1e-5
