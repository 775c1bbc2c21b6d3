"""No step of a sane ball runs out of sub-steps: faults that the soak found, each in its smallest scene."""

import math

import numpy as np
import pytest

from minigolf_env.physics import Status, Surface, World
from minigolf_env.physics.step import FORCE_RESTING_AFTER
from tests.physics.scenes import BALL, G, about_y, grid, mesh, rotation


@pytest.mark.parametrize("way", ["along a wall", "on a floor"])
def test_ball_as_deep_as_the_door_allows_is_not_stopped_by_a_seam(way: str) -> None:
    """Rolling or falling along two coplanar triangles at a depth of 0.6e-12 of the scale, a ball crosses their seam."""
    lost = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        turn = rotation(rng)
        pull = turn @ ([G, 0, 0] if way == "along a wall" else [0, 0, -G])
        world = World([mesh(grid(2.0, 1), Surface(0.0, tangential=1.0), turn)], 0.05, pull, 1 / 60)
        start = turn @ [-0.6, 0.02, 0.05 - 6e-13 * world.coordinate_scale]
        shot = world.simulate(start, turn @ [rng.uniform(0, 3), rng.uniform(-1, 1), 0], max_time=1.0)
        lost += shot.exhausted
    assert lost == 0


@pytest.mark.parametrize("c", [0.05, 0.3])
def test_slope_of_seven_tenths_of_the_friction_stops_a_ball_in_time(c: float) -> None:
    """Where tan(beta) = c / sqrt(2) each stop turns a ball by a right angle; it stops for good, mostly soon."""
    turn = about_y(math.atan(c * math.sqrt(0.5)))
    world = World([mesh(grid(10.0, 1), Surface(rolling=c), turn)])
    lost, pieces = 0, []
    for angle in np.radians(np.arange(0, 360, 5)):
        for speed in (1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0):
            way = turn @ [math.cos(angle), math.sin(angle), 0.0]
            shot = world.simulate(turn @ [0, 0, BALL], speed * way, max_time=60.0, record=True)
            assert shot.status == Status.REST
            assert shot.num_substeps is not None
            lost += shot.exhausted
            pieces.append(shot.num_substeps.max())
    assert lost == 0
    assert np.median(pieces) < 0.5 * FORCE_RESTING_AFTER
