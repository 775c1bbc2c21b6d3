"""Known faults of other engines do not occur: tunnelling, ghost hits, endless loops, sticking to walls.

Numbers after an engine's name, as in PhysX 501, are those of issues in its tracker.
"""

import numpy as np
import pytest

from minigolf_env.physics import Status, Surface, TriangleMesh, World, sweep_sphere
from tests.physics.oracle import Sweep
from tests.physics.scenes import BALL_RADIUS, box, grid, mesh, room, rotation


def test_degenerate_triangle_makes_no_ghost_hit() -> None:
    """A triangle without area is hit where its segment is, and nowhere else (Jolt Physics 886)."""
    segment = np.array([[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, 0.0, 0.0]]])
    for x in (-3.0, -1.2, 1.2, 3.0):
        assert not sweep_sphere([x, -1.0, 0.0], [x, 1.0, 0.0], 0.1, segment).hit
    for x in (-1.0, 0.0, 0.3, 1.0):
        assert sweep_sphere([x, -1.0, 0.0], [x, 1.0, 0.0], 0.1, segment).alpha == pytest.approx(0.45, abs=1e-12)
    assert not sweep_sphere([0.0, -1.0, 0.1], [0.0, 1.0, 0.1], 0.1, segment).hit


def test_obtuse_corner_is_not_missed() -> None:
    """Next to an obtuse corner, where region heuristics choose the wrong edge, the hit is exact (PhysX 501, 597)."""
    rng = np.random.default_rng(1)
    obtuse = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.9, 1e-3, 0.0]])
    for x in np.r_[rng.uniform(-1.02, 1.02, 300), -1.0, 0.9, 1.0]:
        for y in (-0.04, 0.0, 5e-4, 0.04):
            start, end = np.array([x, y, 1.0]), np.array([x + 0.01, y, -1.0])
            hit = sweep_sphere(start, end, 0.05, obtuse[None])
            assert hit.hit
            assert not Sweep(start, end, 0.05, obtuse).fault(hit.hit, hit.alpha, 1e-11)


def test_separating_contact_does_not_hide_the_next_hit() -> None:
    """A ball in contact with a face that it leaves still hits the next one (PhysX 505)."""
    left = np.array([[[0.0, -9, -9], [0.0, 9, -9], [0.0, 0, 9]]])
    for order in ([0, 1], [1, 0]):
        walls = np.concatenate([left, left + np.array([1.0, 0, 0])])[order]
        hit = sweep_sphere([0.1, 0, 0], [2.1, 0, 0], 0.1, walls)
        assert hit.alpha == pytest.approx(0.4, abs=1e-12)
        assert hit.triangle == order.index(1)


@pytest.mark.parametrize("speed", [1e-42, 1e-160, 1e-170, 5e-324, 0.0])
def test_speeds_whose_squares_underflow_end_the_step(speed: float) -> None:
    """Speeds that vanish when squared end a step and the run, without a loop, a sudden speed or NaN (Parry 123)."""
    corner = World([mesh(room(2.0), Surface(damping=0.7, rolling=0.05))])
    slope = World([mesh(grid(10.0, 1), Surface(rolling=0.2))], gravity=(1.0, 0.5, -9.8))
    for world, p in (
        (corner, [0.0, 0.0, BALL_RADIUS]),
        (corner, [1 - BALL_RADIUS, 1 - BALL_RADIUS, BALL_RADIUS]),
        (slope, [0.0, 0.0, BALL_RADIUS]),
    ):
        for direction in ([1, 0, 0], [1, 1, 0], [-0.3, 0.8, -0.5], [0.1, 0.2, 1.0]):
            shot = world.simulate(p, speed * np.array(direction), max_time=1.0)
            assert (shot.status, shot.exhausted) == (Status.REST, 0)
            assert shot.position == pytest.approx(p, abs=1e-12)
            assert not shot.velocity.any()


def test_short_path_does_not_miss_an_edge() -> None:
    """A path of 5 mm, or of a micrometre, onto an edge of 0.1 m is as exact as one of a metre."""
    triangle = np.array([[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.05, 0.1, 0.0]]])
    for move in (1.0, 5e-3, 1e-4, 1e-6):
        y = -0.02 - 0.5 * move
        hit = sweep_sphere([0.05, y, 0.0], [0.05, y + move, 0.0], 0.02, triangle)
        assert hit.alpha == pytest.approx(0.5, abs=1e-11 / move)
        assert hit.normal.tolist() == pytest.approx([0, -1, 0], abs=1e-9)


@pytest.mark.parametrize("speed", [1e-6, 1e-3, 0.01, 0.04])
def test_slow_ball_does_not_stick_to_a_wall(speed: float) -> None:
    """Between two vertical elastic walls a ball rolls back and forth at full speed."""
    floor = Surface(damping=0.5, rolling=0.0)
    wall = Surface(damping=1.0)
    gap = 2 * BALL_RADIUS + 0.5 * speed
    walls = [mesh(box([gap / 2, -1, -1], [1, 1, 1]), wall), mesh(box([-1, -1, -1], [-gap / 2, 1, 1]), wall)]
    shot = World([mesh(grid(10.0, 1), floor), *walls]).simulate([0, 0, BALL_RADIUS], [speed, 0, 0], max_time=10.25)
    assert shot.bounces == 20
    assert abs(shot.velocity[0]) == pytest.approx(speed, rel=1e-9)


def test_resting_ball_does_not_sink() -> None:
    """A ball that rests or slides for 1,500 steps is exactly as high at the end as at the start."""
    world = World([mesh(grid(100.0, 3), Surface(damping=0.0, rolling=0.0))])
    for v in ([0, 0, 0], [0.5, 0.1, 0.0]):
        p, v = np.array([0.1, 0.2, BALL_RADIUS]), np.array(v)
        for _ in range(1500):
            p, v = world.step(p, v)
        assert p[2] == BALL_RADIUS


def test_duplicate_triangles_change_nothing() -> None:
    """A floor given three times, once with reversed winding, gives the same bits as the floor."""
    once = grid(4.0, 2)
    faces = np.concatenate([once[1], once[1], once[1][:, ::-1]])
    surface = Surface(damping=0.6, rolling=0.1)
    shots = [
        World([TriangleMesh(once[0], faces, surface, two_sided=True)]).simulate([0.1, 0.2, 0.5], [1, 0.3, 0])
        for faces in (once[1], faces)
    ]
    assert np.array_equal(shots[0].position, shots[1].position)
    assert shots[0].time == shots[1].time


@pytest.mark.parametrize("short", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("first", [0, 1, 2])
def test_short_edge_of_a_needle_is_solid(first: int, short: float) -> None:
    """A step head-on into the short edge of a needle, whichever corner comes first, ends outside it."""
    rng = np.random.default_rng(3)
    for _ in range(40):
        rot = rotation(rng)
        place = rng.uniform(-0.5, 0.5, 3)
        needle = np.roll([[0, 0, 0], [1, 0, 0], [1, short, 0]], first, axis=0) @ rot.T + place
        world = World([TriangleMesh(needle, [[0, 1, 2]], Surface(damping=0.9))], 0.02, gravity=(0, 0, 0))
        gap, deep = 10.0 ** rng.uniform([-10, -12], [-3, -3])
        p, _ = world.step(place + rot @ [1.02 + gap, 0, 0], -rot[:, 0] * (gap + deep) / world.dt)
        assert world.clearance(p) >= -1e-12 * world.coordinate_scale
