"""Contacts: the cone that lasting ones leave the ball, when one lasts, and the two parts of a response."""

import math

import numpy as np
import pytest

from minigolf_env.physics import Surface, World
from minigolf_env.physics.contact import MAX_CONTACTS, add_contact, project_onto_cone
from minigolf_env.physics.types import Vec3
from tests.physics.scenes import BALL, FloatArray, G, about_y, box, floor_world, grid, mesh, rotation

DT = 1 / 120


def projected(normals: FloatArray, x: FloatArray) -> FloatArray:
    """Return x projected on the cone that contacts with these normals leave."""
    contacts, num_contacts = np.empty((MAX_CONTACTS, 4)), 0
    for n in normals:
        num_contacts = add_contact(contacts, num_contacts, Vec3(*n), 0.0)
    return np.array(project_onto_cone(contacts, num_contacts, Vec3(*x)))


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_projection_is_the_closest_vector_of_the_cone(count: int) -> None:
    """Against every normal the result does not sink, and no vector of the cone is closer to the original."""
    rng = np.random.default_rng(count)
    for _ in range(300):
        normals = rng.normal(size=(count, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        x = rng.normal(size=3)
        y = projected(normals, x)
        assert (normals @ y >= -1e-14).all()
        # Moreau: y is the projection on a cone just when x - y is square to y and obtuse to all of the cone.
        assert abs(y @ (x - y)) < 1e-13
        others = rng.normal(size=(200, 3))
        others = others[(others @ normals.T >= 0.0).all(axis=1)]
        assert (others @ (x - y) <= 1e-13).all()
        assert projected(normals, y) == pytest.approx(y, abs=1e-14)


def test_projection_of_nearly_parallel_contacts_keeps_sliding() -> None:
    """Two contacts that differ by a hair act as one plane: sliding along it goes on."""
    x = np.array([1.0, 2.0, -3.0])
    for tilt in 10.0 ** np.arange(-17.0, -5.0):
        for sign in (-1.0, 1.0):
            normals = np.array([[0, 0, 1], [sign * tilt, 0, 1]]) / math.hypot(1.0, tilt)
            assert projected(normals, x) == pytest.approx([1, 2, 0], abs=1e-5)


def bounces(world: World, position: FloatArray, velocity: FloatArray) -> int:
    """Return the bounces within one time step."""
    return world.simulate(position, velocity, max_time=world.dt).bounces


@pytest.mark.parametrize("dt", [1 / 60, 1 / 120, 1 / 240])
@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("e", [0.25, 0.5, 0.9])
def test_a_contact_lasts_up_to_the_speed_that_is_gone_within_the_step(dt: float, slope: float, e: float) -> None:
    """The rebound e u, with u = u0 + g dt / 2, lasts up to g dt / 2 along the normal: half for half of dt."""
    turn = about_y(slope)
    world = World([mesh(grid(10.0, 1), Surface(restitution=e), turn)], dt=dt)
    normal = turn @ [0, 0, 1]
    press = 0.5 * G * math.cos(slope) * dt
    limit = press / e - press
    assert bounces(world, BALL * normal, -limit * (1 - 1e-6) * normal) == 0
    assert bounces(world, BALL * normal, -limit * (1 + 1e-6) * normal) == 1


def test_the_limit_is_the_same_late_in_a_step() -> None:
    """A ball that meets the floor after a wall, with 0.6 dt left, is held up to the same speed: g dt / 2."""
    floor, wall = mesh(grid(10.0, 1), Surface(restitution=0.5)), mesh(box([0, -5, -1], [1, 5, 1]), Surface(damping=1.0))
    world = World([floor, wall])
    # It falls at 0.6 g dt for 0.4 dt up to the wall, then at 0.9 g dt: the rebound of 0.45 g dt is held.
    for share, count in ((0.1, 1), (0.3, 2)):
        gap = 0.4 * (share + 0.5) + 0.3 * (share + 0.8)
        start = [-BALL - 0.4 * DT, 0.0, BALL + gap * G * DT**2]
        assert bounces(world, np.array(start), np.array([1.0, 0.0, -share * G * DT])) == count


@pytest.mark.parametrize("impact", ["average", "conservative"])
@pytest.mark.parametrize("speed", [1e-9, 1e-6, 1e-3, 1.0])
def test_walls_do_not_hold_a_slow_ball(speed: float, impact: str) -> None:
    """A ball on a level floor rebounds from a vertical wall with e times its speed, however slow it is."""
    floor = mesh(grid(10.0, 1), Surface(damping=0.5, rolling=0.0))
    wall = mesh(box([0.0, -5.0, -1.0], [1.0, 5.0, 1.0]), Surface(damping=0.6))
    world = World([floor, wall], impact=impact)
    p, v = world.step([-BALL - 0.5 * speed * DT, 0.0, BALL], [speed, 0.0, 0.0])
    assert v == pytest.approx([-0.6 * speed, 0.0, 0.0], abs=1e-12 * speed)
    assert p[0] == pytest.approx(-BALL - 0.3 * speed * DT, abs=1e-13)


def test_a_surface_splits_its_response() -> None:
    """Restitution scales the normal velocity, tangential the rest; the damping stands for those not given."""
    way = np.array([3.0, 0.0, -4.0])
    cases = {(0.5, None, None): (1.5, 2.0), (0.5, 0.25, None): (1.5, 1.0), (0.5, None, 1.0): (3.0, 2.0)}
    cases[0.5, 1.0, 0.0] = (0.0, 4.0)
    for (d, e, t), (along, up) in cases.items():
        world = floor_world(Surface(damping=d, restitution=e, tangential=t), gravity=(0, 0, 0))
        _, v = world.step([0.0, 0.0, BALL], way)
        assert v == pytest.approx([along, 0.0, up], abs=1e-15)


@pytest.mark.parametrize("seed", range(5))
def test_response_is_the_seeds_reflection(seed: int) -> None:
    """Without gravity v' = d (v - 2 (v . n) n) off a plane of any direction."""
    rng = np.random.default_rng(seed)
    turn, d = rotation(rng), rng.random()
    world = World([mesh(grid(10.0, 1), Surface(damping=d), turn)], gravity=(0, 0, 0))
    n = turn @ [0, 0, 1]
    v = rng.normal(size=3)
    v -= (v @ n + 1.0) * n
    _, after = world.step((BALL + 1e-3) * n, v)
    assert after == pytest.approx(d * (v - 2 * (v @ n) * n), abs=1e-14)
