"""Resting contacts: the cone of allowed velocities, when a contact becomes resting, and the impact response."""

import math

import numpy as np
import pytest

from minigolf_env.physics import Surface, World
from minigolf_env.physics.contact import MAX_CONTACTS, add_contact, project_onto_cone
from minigolf_env.physics.types import Vec3
from tests.physics.scenes import BALL_RADIUS, FloatArray, G, box, floor_world, grid, mesh, rotation, rotation_about_y

DT = 1 / 120


def project(normals: FloatArray, x: FloatArray) -> FloatArray:
    """Return the projection of x onto the contact cone of these normals."""
    contacts = np.empty((MAX_CONTACTS, 4))
    num_contacts = 0
    for n in normals:
        num_contacts = add_contact(contacts, num_contacts, Vec3(*n), 0.0)
    return np.array(project_onto_cone(contacts, num_contacts, Vec3(*x)))


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_projection_is_the_closest_vector_of_the_cone(count: int) -> None:
    """The projection penetrates no contact, and no vector of the cone is closer to the original."""
    rng = np.random.default_rng(count)
    for _ in range(300):
        normals = rng.normal(size=(count, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        x = rng.normal(size=3)
        y = project(normals, x)
        assert (normals @ y >= -1e-14).all()
        # Moreau: y is the projection onto a cone exactly if x - y is orthogonal to y and obtuse to the whole cone.
        assert abs(y @ (x - y)) < 1e-13
        others = rng.normal(size=(200, 3))
        others = others[(others @ normals.T >= 0.0).all(axis=1)]
        assert (others @ (x - y) <= 1e-13).all()
        assert project(normals, y) == pytest.approx(y, abs=1e-14)


def test_projection_onto_nearly_parallel_contacts_keeps_the_tangential_part() -> None:
    """Two contacts whose normals differ by rounding act as one plane: sliding along it continues."""
    x = np.array([1.0, 2.0, -3.0])
    for tilt in 10.0 ** np.arange(-17.0, -5.0):
        for sign in (-1.0, 1.0):
            normals = np.array([[0, 0, 1], [sign * tilt, 0, 1]]) / math.hypot(1.0, tilt)
            assert project(normals, x) == pytest.approx([1, 2, 0], abs=1e-5)


def bounces_in_one_step(world: World, position: FloatArray, velocity: FloatArray) -> int:
    """Return the number of bounces within one time step."""
    return world.simulate(position, velocity, max_time=world.dt).bounces


@pytest.mark.parametrize("dt", [1 / 60, 1 / 120, 1 / 240])
@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("e", [0.25, 0.5, 0.9])
def test_contact_is_resting_up_to_the_speed_that_gravity_stops_within_the_step(
    dt: float, slope: float, e: float
) -> None:
    """A contact is resting up to the rebound speed g_n dt / 2, g_n the normal part of gravity, and bounces above it.

    The approach speed of a touching ball is the average velocity's, its speed plus g_n dt / 2, but its speed alone
    where that rebound would be a short hop.
    """
    rot = rotation_about_y(slope)
    world = World([mesh(grid(10.0, 1), Surface(restitution=e), rot)], dt=dt)
    normal = rot @ [0, 0, 1]
    press = 0.5 * G * math.cos(slope) * dt
    max_short_hop = 2.0 * press / (1.0 - e**2) - press
    limit = max(press / e - press, min(press / e, max_short_hop))
    assert bounces_in_one_step(world, BALL_RADIUS * normal, -limit * (1 - 1e-6) * normal) == 0
    assert bounces_in_one_step(world, BALL_RADIUS * normal, -limit * (1 + 1e-6) * normal) == 1


def test_resting_speed_limit_is_the_same_late_in_a_step() -> None:
    """A ball that hits the floor after a wall, with 0.6 dt left, has the same speed limit: g dt / 2."""
    floor = mesh(grid(10.0, 1), Surface(restitution=0.5))
    wall = mesh(box([0, -5, -1], [1, 5, 1]), Surface(damping=1.0))
    world = World([floor, wall])
    # The ball falls at 0.6 g dt for 0.4 dt until the wall, then at 0.9 g dt: the rebound of 0.45 g dt is resting.
    for fraction, count in ((0.1, 1), (0.3, 2)):
        gap = 0.4 * (fraction + 0.5) + 0.3 * (fraction + 0.8)
        start = [-BALL_RADIUS - 0.4 * DT, 0.0, BALL_RADIUS + gap * G * DT**2]
        assert bounces_in_one_step(world, np.array(start), np.array([1.0, 0.0, -fraction * G * DT])) == count


@pytest.mark.parametrize("impact", ["average", "conservative"])
@pytest.mark.parametrize("speed", [1e-9, 1e-6, 1e-3, 1.0])
def test_vertical_wall_makes_no_resting_contact(speed: float, impact: str) -> None:
    """A ball on a level floor rebounds from a vertical wall with e times its speed, however slow it is."""
    floor = mesh(grid(10.0, 1), Surface(damping=0.5, rolling=0.0))
    wall = mesh(box([0.0, -5.0, -1.0], [1.0, 5.0, 1.0]), Surface(damping=0.6))
    world = World([floor, wall], impact=impact)
    p, v = world.step([-BALL_RADIUS - 0.5 * speed * DT, 0.0, BALL_RADIUS], [speed, 0.0, 0.0])
    assert v == pytest.approx([-0.6 * speed, 0.0, 0.0], abs=1e-12 * speed)
    assert p[0] == pytest.approx(-BALL_RADIUS - 0.3 * speed * DT, abs=1e-13)


def test_restitution_and_tangential_scale_their_parts_of_the_velocity() -> None:
    """Restitution scales the normal velocity, tangential the rest; damping stands for those not given."""
    velocity = np.array([3.0, 0.0, -4.0])
    cases = {(0.5, None, None): (1.5, 2.0), (0.5, 0.25, None): (1.5, 1.0), (0.5, None, 1.0): (3.0, 2.0)}
    cases[0.5, 1.0, 0.0] = (0.0, 4.0)
    for (d, e, t), (along, up) in cases.items():
        world = floor_world(Surface(damping=d, restitution=e, tangential=t), gravity=(0, 0, 0))
        _, v = world.step([0.0, 0.0, BALL_RADIUS], velocity)
        assert v == pytest.approx([along, 0.0, up], abs=1e-15)


@pytest.mark.parametrize("seed", range(5))
def test_impact_response_is_the_damped_reflection(seed: int) -> None:
    """Without gravity v' = d (v - 2 (v . n) n) off a plane of any direction, as in the CS121 notes."""
    rng = np.random.default_rng(seed)
    rot = rotation(rng)
    d = rng.random()
    world = World([mesh(grid(10.0, 1), Surface(damping=d), rot)], gravity=(0, 0, 0))
    n = rot @ [0, 0, 1]
    v = rng.normal(size=3)
    v -= (v @ n + 1.0) * n
    _, after = world.step((BALL_RADIUS + 1e-3) * n, v)
    assert after == pytest.approx(d * (v - 2 * (v @ n) * n), abs=1e-14)
