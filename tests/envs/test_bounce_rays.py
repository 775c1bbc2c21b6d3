"""What a ball feels around corners: rays that obey the law of mirrors, and follow the ground."""

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

BALL = 0.02135


def legs_of(env: MiniGolfEnv, **options: Any) -> NDArray[np.float64]:
    """Return the legs (ECHOES, LEGS, ECHO), m, that a ball feels."""
    seen = env.reset(seed=0, options=options)[0][16:].astype(np.float64)
    seen = seen.reshape(NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT)
    seen[..., :2] *= MAX_BOUNCE_RAY_LENGTH
    return np.asarray(seen)


@pytest.mark.parametrize("position", [(0.5, 0.4, BALL), (2.9, 1.7, BALL)], ids=str)
def test_first_segment_equals_a_ray(position: tuple[float, float, float]) -> None:
    """On level felt it is as long as the ray of "rays", less the standoff from walls."""
    rays = MiniGolfEnv(observation="rays").reset(options={"position": position})[0][10 : 10 + NUM_RAYS] * MAX_RAY_LENGTH
    first = legs_of(MiniGolfEnv(observation="bounce_rays"), position=position)[:: NUM_BOUNCE_RAYS // NUM_RAYS, 0]
    near = rays < 0.999 * MAX_RAY_LENGTH
    np.testing.assert_allclose(np.hypot(*first[near, :2].T), rays[near] - HIT_STANDOFF, atol=1e-5)


def test_rays_are_reflected_off_walls() -> None:
    """At a wall the direction's part along the normal is reversed, and nothing else."""
    legs = legs_of(MiniGolfEnv(observation="bounce_rays"), position=(0.5, 0.4, BALL))
    ways = np.diff(legs[..., :2], axis=1, prepend=0.0)
    sizes = np.hypot(ways[..., 0], ways[..., 1])
    ways /= np.maximum(sizes, 1e-9)[..., None]
    normals = legs[..., 2:4]
    compared = 0
    for k in range(NUM_SEGMENTS - 1):
        long = np.minimum(sizes[:, k], sizes[:, k + 1]) > 0.05
        expected = ways[:, k] - 2.0 * (ways[:, k] * normals[:, k]).sum(-1)[:, None] * normals[:, k]
        np.testing.assert_allclose(ways[long, k + 1], expected[long], atol=1e-3)
        compared += int(long.sum())
    assert compared > 200
    np.testing.assert_allclose(legs[..., 4:], 0.0, atol=1e-6)  # The felt is level, and the cup is no part of it.


def test_bounce_rays_climb_a_hill() -> None:
    """Where "rays" end at its foot, bounce rays reach the walls behind, and report its height."""
    env = MiniGolfEnv("hill", observation="bounce_rays", tee="fixed")
    legs = legs_of(env)
    rays = MiniGolfEnv("hill", observation="rays", tee="fixed").reset(seed=0)[0][10 : 10 + NUM_RAYS] * MAX_RAY_LENGTH
    first = legs[:: NUM_BOUNCE_RAYS // NUM_RAYS, 0]
    further = np.hypot(*first[:, :2].T) > rays + 0.5
    assert further.any() and (first[further, 5] > 0.03).all()
    assert (legs[..., 5] >= legs[..., 4] - 1e-6).all() and (np.diff(legs[..., 5], axis=1) >= -1e-6).all()


def test_bounce_rays_do_not_fall_into_the_cup() -> None:
    """A ray that is brought down above the cup stays level."""
    env = MiniGolfEnv(observation="bounce_rays")
    x, y, _ = env.task.cup.position
    legs = legs_of(env, position=(x, y - RAY_STEP_LENGTH, BALL))
    np.testing.assert_allclose(legs[NUM_BOUNCE_RAYS // 4, :, 4:], 0.0, atol=1e-6)


@pytest.mark.parametrize("course", ["dogleg", "loop", "islands", "volcano", "tunnel"])
def test_features_are_finite_on_every_hole(course: str) -> None:
    """Also under roofs and next to water; normals have length 1, or 0 where a segment hits no wall."""
    legs = legs_of(MiniGolfEnv(course, observation="bounce_rays"))
    assert np.isfinite(legs).all()
    sizes = np.hypot(legs[..., 2], legs[..., 3])
    assert np.minimum(np.abs(sizes - 1.0), sizes).max() < 1e-5
