"""Impacts and energy: the exact error of the average-velocity response, and none with the conservative response."""

import numpy as np
import pytest

from minigolf_env.physics import Surface, World
from tests.physics.scenes import BALL_RADIUS, FloatArray, G, box, grid, inside_out, mesh, rotation, sphere, tetrahedron

GRAVITY = np.array([0.0, 0.0, -G])


def energy(world: World, p: FloatArray, v: FloatArray) -> float:
    """Return the energy of a ball of one kilogram, J."""
    return float(0.5 * v @ v - np.array(world.gravity) @ p)


def test_average_velocity_response_has_its_exact_energy_error() -> None:
    """One bounce at d = 1 changes the energy by (1/2 - alpha) h g . v0 + h² g² (1/8 - alpha/2)."""
    rng = np.random.default_rng(1)
    dt = 1 / 60
    for _ in range(200):
        rot = rotation(rng)
        v = rng.uniform(-3, 3, 3)
        alpha = rng.uniform(0.05, 0.95)
        world = World([mesh(grid(20.0, 1), Surface(damping=1.0), rot)], dt=dt)
        n = rot @ [0, 0, 1]
        average = v + 0.5 * dt * GRAVITY
        n = -np.sign(average @ n) * n
        if -average @ n < 0.5:
            continue
        start = (BALL_RADIUS - alpha * dt * (average @ n)) * n
        shot = world.simulate(start, v, max_time=dt)
        expected = (0.5 - alpha) * dt * GRAVITY @ v + dt**2 * G**2 * (1 / 8 - alpha / 2)
        assert shot.bounces == 1
        gained = energy(world, shot.position, shot.velocity) - energy(world, start, v)
        assert gained == pytest.approx(expected, abs=1e-11 * max(1.0, v @ v))


def tall_room(rot: FloatArray, surface: Surface, **kwargs: object) -> World:
    """Return a tall room with slanted bodies, where a fast ball has no resting contact."""
    bodies = [inside_out(box([-1, -1, 0], [1, 1, 3])), sphere([0.4, 0.4, 0.5], 0.4), tetrahedron([-0.5, 0.3, 0.8], 0.4)]
    bodies.append(box([-0.2, -0.8, 0.3], [0.3, -0.4, 0.9]))
    return World([mesh(body, surface, rot) for body in bodies], gravity=rot @ GRAVITY, **kwargs)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(4))
def test_conservative_impacts_keep_the_energy(seed: int) -> None:
    """At d = 1 without rolling resistance a minute among obstacles changes the energy by less than 1e-9 of it."""
    rng = np.random.default_rng(seed)
    rot = rotation(rng)
    world = tall_room(rot, Surface(damping=1.0, rolling=0.0), impact="conservative", dt=1 / 60)
    p, v = rot @ [0.0, 0.0, 2.5], rot @ rng.uniform(-5, 5, 3)
    first = energy(world, p, v)
    for _ in range(60):
        shot = world.simulate(p, v, max_time=1.0)
        p, v = shot.position, shot.velocity
        assert energy(world, p, v) == pytest.approx(first, rel=1e-9)
    assert shot.bounces > 0


@pytest.mark.parametrize("rolling", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("d", [0.6, 0.95, 1.0])
def test_conservative_impacts_never_gain_energy(d: float, rolling: float) -> None:
    """No 0.05 s of a run adds energy, while the ball bounces, rolls or rests, with any rolling resistance."""
    rng = np.random.default_rng(17)
    for _ in range(4):
        rot = rotation(rng)
        surface = Surface(damping=d, tangential=[None, 1.0, 0.0][rng.integers(3)], rolling=rolling)
        world = tall_room(rot, surface, impact="conservative")
        p, v = rot @ [0.0, 0.0, 1.5], rot @ rng.uniform(-3, 3, 3)
        for _ in range(300):
            before = energy(world, p, v)
            shot = world.simulate(p, v, max_time=0.05)
            p, v = shot.position, shot.velocity
            assert energy(world, p, v) <= before + 1e-10 * abs(before)


def test_impact_does_not_return_energy_lost_to_rolling_resistance() -> None:
    """A ball that rolls slowly down a braking slope into an elastic wall leaves it with less energy."""
    slope = np.radians(5.0)
    gravity = G * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    floor = mesh(grid(10.0, 1), Surface(rolling=0.085))
    wall = mesh(box([0, -1, -1], [1, 1, 1]), Surface(damping=1.0))
    for speed in (0.01, 0.03, 0.1):
        for fraction in (0.1, 0.5, 0.9):
            world = World([floor, wall], gravity=gravity, impact="conservative", dt=1 / 60)
            p, v = np.array([-BALL_RADIUS - fraction * speed / 60, 0.0, BALL_RADIUS]), np.array([speed, 0.0, 0.0])
            shot = world.simulate(p, v, max_time=1 / 60)
            assert shot.bounces == 1
            assert energy(world, shot.position, shot.velocity) < energy(world, p, v)


def test_conservative_grazing_impact_keeps_the_energy() -> None:
    """A ball whose path hits a wall but whose velocity already separates continues undamped."""
    dt = 1 / 60
    for load_ratio, fraction in ((0.1, 0.25), (0.1, 0.4), (0.3, 0.2)):
        gravity = G * np.array([np.sqrt(1 - load_ratio**2), 0.0, -load_ratio])
        rise = 0.5 * (fraction + 0.5) * load_ratio * G * dt
        # The start speed lies between those that gravity takes until the contact and until the middle of the step.
        gap = fraction * dt * (0.5 * load_ratio * G * dt - rise)
        wall = mesh(grid(20.0, 1), Surface(damping=0.3))
        world = World([wall], gravity=gravity, dt=dt, impact="conservative")
        p, v = np.array([0.0, 0.0, BALL_RADIUS + gap]), np.array([1.0, 0.5, rise])
        shot = world.simulate(p, v, max_time=dt)
        assert shot.bounces == 1
        assert shot.velocity[2] > 0.0
        assert energy(world, shot.position, shot.velocity) == pytest.approx(energy(world, p, v), rel=1e-11)
