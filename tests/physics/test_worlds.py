"""Worlds side by side give what each gives alone."""

from __future__ import annotations

import numpy as np
import pytest

from minigolf_env.courses import load_course
from minigolf_env.courses.procedural import GENERATOR_VERSION
from minigolf_env.physics import World, WorldBatch
from tests.physics.scenes import mesh, room

NAMES = ["dogleg", f"procedural-v{GENERATOR_VERSION}-hard-3", f"procedural-v{GENERATOR_VERSION}-easy-4", "dogleg"]


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    """Return worlds, one of them twice."""
    known = {name: load_course(name).world() for name in NAMES}
    return [known[name] for name in NAMES]


def starts() -> np.ndarray:
    """Return centres on the tees."""
    courses = [load_course(name) for name in NAMES]
    return np.array([[*course.tee.centre, course.tee.height + course.ball_radius] for course in courses])


@pytest.mark.parametrize("each", [1, 3])
def test_each_ball_is_in_its_world(worlds: list[World], each: int) -> None:
    """Runs and sweeps are bit-equal to those of the worlds one by one, however many rows each has."""
    rng = np.random.default_rng(0)
    positions = np.repeat(starts(), each, axis=0)
    velocities = np.append(rng.uniform(-3, 3, (len(positions), 2)), np.zeros((len(positions), 1)), axis=1)
    batch = WorldBatch(worlds)
    shots, hits = batch.simulate_batch(positions, velocities), batch.sweep_batch(positions, positions + velocities)
    for i, (p, v) in enumerate(zip(positions, velocities, strict=True)):
        shot, hit = worlds[i // each].simulate(p, v), worlds[i // each].sweep(p, p + v)
        assert (shots.position[i].tobytes(), shots.time[i]) == (shot.position.tobytes(), shot.time)
        assert (hits.alpha[i], hits.triangle[i], hits.normal[i].tobytes()) == (
            hit.alpha,
            hit.triangle,
            hit.normal.tobytes(),
        )


def test_no_worlds_take_no_balls() -> None:
    """As a batch of environments that all begin anew."""
    nothing = WorldBatch([]).simulate_batch(np.empty((0, 3)), np.empty((0, 3)))
    assert nothing.position.shape == (0, 3) and len(np.asarray(nothing.status)) == 0


def test_what_does_not_fit_is_refused(worlds: list[World]) -> None:
    """A ball in a surface, rows that cannot be shared out, no worlds for balls, worlds of different time steps."""
    batch, balls = WorldBatch(worlds), starts()
    balls[2, 2] -= 0.01
    with pytest.raises(ValueError, match="position 2: expected a ball in free space"):
        batch.simulate_batch(balls, np.zeros((4, 3)))
    with pytest.raises(ValueError, match="a multiple of 4 rows, as many for each world, received 3"):
        batch.simulate_batch(balls[:3], np.zeros((3, 3)))
    with pytest.raises(ValueError, match="a multiple of 0 rows"):
        WorldBatch([]).sweep_batch(balls, balls)
    with pytest.raises(ValueError, match="all of one dt"):
        WorldBatch([worlds[0], load_course("dogleg").world(dt=1 / 60)])


def test_a_refusal_names_the_radius_of_the_ball_itself() -> None:
    """Balls of a batch may differ in size; nobody is sent to a height that is still in the floor."""
    batch = WorldBatch([World([mesh(room(2.0))], ball_radius=radius) for radius in (0.02, 0.05)])
    for k in (2, 3):
        balls = np.tile([0.0, 0.0, 1.0], (4, 1))
        balls[k, 2] = 0.03
        with pytest.raises(ValueError, match=rf"position {k}: .*, 0\.02 m deep .* at least 0\.05 m from"):
            batch.simulate_batch(balls, np.zeros((4, 3)))
