"""No step of a ball at ordinary speed runs out of sub-steps: faults that the soak found, in small scenes."""

import math

import numpy as np
import pytest

from minigolf_env.physics import Status, Surface, World
from minigolf_env.physics.step import FORCE_RESTING_AFTER
from tests.physics.scenes import BALL_RADIUS, G, grid, mesh, rotation, rotation_about_y


@pytest.mark.parametrize("motion", ["along a wall", "on a floor"])
def test_ball_as_deep_as_allowed_is_not_stopped_by_a_seam(motion: str) -> None:
    """A ball that rolls or falls along two coplanar triangles, 0.6e-12 of the scale deep, crosses their seam."""
    num_exhausted = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        rot = rotation(rng)
        gravity = rot @ ([G, 0, 0] if motion == "along a wall" else [0, 0, -G])
        world = World([mesh(grid(2.0, 1), Surface(0.0, tangential=1.0), rot)], 0.05, gravity, 1 / 60)
        start = rot @ [-0.6, 0.02, 0.05 - 6e-13 * world.coordinate_scale]
        shot = world.simulate(start, rot @ [rng.uniform(0, 3), rng.uniform(-1, 1), 0], max_time=1.0)
        num_exhausted += shot.exhausted
    assert num_exhausted == 0


@pytest.mark.parametrize("c", [0.05, 0.3])
def test_ball_on_a_slope_of_c_over_sqrt_2_stops_within_its_sub_steps(c: float) -> None:
    """On this slope a ball stops again and again, and starts at a right angle to its last motion.

    It comes to rest before a step has used up its sub-steps, and in half of the runs after few of them.
    """
    rot = rotation_about_y(math.atan(c * math.sqrt(0.5)))
    world = World([mesh(grid(10.0, 1), Surface(rolling=c), rot)])
    num_exhausted = 0
    max_substeps = []
    for angle in np.radians(np.arange(0, 360, 5)):
        for speed in (1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0):
            direction = rot @ [math.cos(angle), math.sin(angle), 0.0]
            shot = world.simulate(rot @ [0, 0, BALL_RADIUS], speed * direction, max_time=60.0, record=True)
            assert shot.status == Status.REST
            assert shot.num_substeps is not None
            num_exhausted += shot.exhausted
            max_substeps.append(shot.num_substeps.max())
    assert num_exhausted == 0
    assert np.median(max_substeps) < 0.5 * FORCE_RESTING_AFTER
