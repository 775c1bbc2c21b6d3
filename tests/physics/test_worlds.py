"""A WorldBatch gives each ball the result of its own world."""

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
    worlds_by_name = {name: load_course(name).world() for name in NAMES}
    return [worlds_by_name[name] for name in NAMES]


def starts() -> np.ndarray:
    """Return ball positions on the tees."""
    courses = [load_course(name) for name in NAMES]
    return np.array([[*course.tee.centre, course.tee.height + course.ball_radius] for course in courses])


@pytest.mark.parametrize("rows_per_world", [1, 3])
def test_batch_of_worlds_equals_single_worlds_bitwise(worlds: list[World], rows_per_world: int) -> None:
    """Runs and sweeps equal those of the worlds one by one, however many rows each has."""
    rng = np.random.default_rng(0)
    positions = np.repeat(starts(), rows_per_world, axis=0)
    velocities = np.append(rng.uniform(-3, 3, (len(positions), 2)), np.zeros((len(positions), 1)), axis=1)
    batch = WorldBatch(worlds)
    shots = batch.simulate_batch(positions, velocities)
    hits = batch.sweep_batch(positions, positions + velocities)
    for i, (p, v) in enumerate(zip(positions, velocities, strict=True)):
        shot = worlds[i // rows_per_world].simulate(p, v)
        hit = worlds[i // rows_per_world].sweep(p, p + v)
        assert (shots.position[i].tobytes(), shots.time[i]) == (shot.position.tobytes(), shot.time)
        assert (hits.alpha[i], hits.triangle[i], hits.normal[i].tobytes()) == (
            hit.alpha,
            hit.triangle,
            hit.normal.tobytes(),
        )


def test_empty_batch_of_worlds_accepts_no_balls() -> None:
    """A vector environment makes such a batch when all its episodes restart."""
    nothing = WorldBatch([]).simulate_batch(np.empty((0, 3)), np.empty((0, 3)))
    assert nothing.position.shape == (0, 3) and len(np.asarray(nothing.status)) == 0


def test_rejects_batches_that_do_not_fit(worlds: list[World]) -> None:
    """Overlapping balls, row counts that do not fit the worlds, and different time steps are refused."""
    batch = WorldBatch(worlds)
    positions = starts()
    positions[2, 2] -= 0.01
    with pytest.raises(ValueError, match="position 2: expected a ball in free space"):
        batch.simulate_batch(positions, np.zeros((4, 3)))
    with pytest.raises(
        ValueError, match="positions: expected a multiple of 4 rows, received 3; give each world as many"
    ):
        batch.simulate_batch(positions[:3], np.zeros((3, 3)))
    with pytest.raises(ValueError, match="a multiple of 0 rows"):
        WorldBatch([]).sweep_batch(positions, positions)
    with pytest.raises(ValueError, match="all of one dt"):
        WorldBatch([worlds[0], load_course("dogleg").world(dt=1 / 60)])


def test_overlap_error_has_the_radius_of_the_ball_concerned() -> None:
    """Balls of a batch may have different radii; the error's height is that of the ball concerned."""
    batch = WorldBatch([World([mesh(room(2.0))], ball_radius=radius) for radius in (0.02, 0.05)])
    for k in (2, 3):
        positions = np.tile([0.0, 0.0, 1.0], (4, 1))
        positions[k, 2] = 0.03
        with pytest.raises(ValueError, match=rf"position {k}: .*, 0\.02 m deep .* at least 0\.05 m from"):
            batch.simulate_batch(positions, np.zeros((4, 3)))
