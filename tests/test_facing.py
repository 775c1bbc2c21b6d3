"""The view with the cup ahead: a hole that is turned looks the same, and putts come back into its frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.rays import RAYS
from minigolf_env.facing import DEPTH, FIRST_RAY, SLOPE, STRAIGHT, VIEW, face_cup, turn


def seen(n: int) -> NDArray[np.float32]:
    """Return n random observations of rays."""
    rng = np.random.default_rng(0)
    return rng.uniform(-0.7, 0.7, (n, DEPTH + 6)).astype(np.float32)


def turned(observations: NDArray[Any], steps: int) -> NDArray[np.float32]:
    """Return what is seen of the same holes turned by a number of rays, counter-clockwise."""
    angle = 2.0 * np.pi * steps / RAYS
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    result = observations.astype(np.float64)
    result[:, FIRST_RAY:DEPTH] = np.roll(observations[:, FIRST_RAY:DEPTH], steps, axis=1)
    for first in (SLOPE, STRAIGHT):
        result[:, first : first + 2] = result[:, first : first + 2] @ rotation
    return result.astype(np.float32)


def test_a_turned_hole_looks_the_same() -> None:
    """Whatever the turn; the direction to the cup turns with it, and so do putts."""
    before, ahead = face_cup(seen(50))
    putts = np.random.default_rng(1).uniform(-1, 1, (50, 2)).astype(np.float32)
    for steps in (1, 8, 21):
        after, then = face_cup(turned(seen(50), steps))
        np.testing.assert_allclose(after, before, atol=2e-5)
        angle = 2.0 * np.pi * steps / RAYS
        rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        np.testing.assert_allclose(turn(putts, then), turn(putts, ahead) @ rotation, atol=2e-6)


def test_straight_ahead_is_towards_the_cup() -> None:
    """A putt along x goes to the cup; the first ray is the way that is free there."""
    env = MiniGolfEnv("straight", observation="rays")
    observation, _ = env.reset(seed=0)
    view, ahead = face_cup(observation[None])
    way = np.asarray(env.task.cup.position)[:2] - env.get_state()["position"][:2]
    np.testing.assert_allclose(turn(np.array([[1.0, 0.0]]), ahead)[0], way / np.hypot(*way), atol=1e-6)
    assert view.shape == (1, VIEW) and (np.abs(view) <= 1.0).all()
    np.testing.assert_allclose(view[0, 0] ** 2 * 8.0, np.hypot(*way), rtol=1e-5)
    np.testing.assert_array_equal(view[0, 0] ** 2, view[0, 1])


def test_a_ball_over_the_cup_has_some_view() -> None:
    """No direction is the direction to it: x is taken."""
    observations = seen(1)
    observations[:, STRAIGHT : STRAIGHT + 2] = 0.0
    view, ahead = face_cup(observations)
    np.testing.assert_array_equal(ahead, [[1.0, 0.0]])
    assert np.isfinite(view).all()
