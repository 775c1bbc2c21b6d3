"""Impacts and energy.

The average-velocity response has an exact error, which is zero in short hops; the conservative response has none.
"""

import numpy as np
import pytest

from minigolf_env.physics import Status, Surface, World
from minigolf_env.physics.step import FORCE_RESTING_AFTER
from tests.physics.scenes import (
    BALL_RADIUS,
    FloatArray,
    G,
    box,
    floor_world,
    grid,
    inside_out,
    mesh,
    rotation,
    rotation_about_y,
    sphere,
    tetrahedron,
)

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


@pytest.mark.parametrize("e", [0.6, 0.8, 0.95])
@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_short_hop_keeps_e_squared_of_the_normal_energy(slope: float, e: float) -> None:
    """Where the average velocity would return more than damping takes, an impact keeps exactly e² of the energy.

    That is the energy of the motion along the normal; the motion along the floor keeps ``tangential`` of its average
    velocity, as in any impact.
    """
    rng = np.random.default_rng(3)
    dt = 1 / 60
    rot = rotation_about_y(slope)
    n = rot @ [0.0, 0.0, 1.0]
    load = -GRAVITY @ n
    world = World([mesh(grid(20.0, 1), Surface(restitution=e, tangential=0.5), rot)], dt=dt)
    num_hops = 0
    for _ in range(200):
        alpha = rng.uniform(0.0, 1.0)
        approach = rng.uniform(0.5, 2.0) * load * dt
        along = rot @ [*rng.uniform(-1, 1, 2), 0.0]
        v = along - (approach - 0.5 * load * dt) * n
        shot = world.simulate((BALL_RADIUS + alpha * approach * dt) * n, v, max_time=dt)
        at_impact = -v @ n + alpha * load * dt
        is_short = (1 - e**2) * approach < load * dt
        if shot.bounces == 0 or not is_short or at_impact <= 0.0:
            continue
        num_hops += 1
        before = 0.5 * (v @ n) ** 2 + load * alpha * approach * dt
        after = 0.5 * (shot.velocity @ n) ** 2 + load * (shot.position @ n - BALL_RADIUS)
        assert after == pytest.approx(e**2 * before, rel=1e-11)
        pull = GRAVITY + load * n
        average = v + 0.5 * dt * pull
        sliding = average - (average @ n) * n
        end = 0.5 * sliding + (1.0 - alpha) * dt * pull
        assert shot.velocity - (shot.velocity @ n) * n == pytest.approx(end, abs=1e-12)
    assert num_hops > 0


@pytest.mark.parametrize("dt", [1 / 60, 1 / 120])
@pytest.mark.parametrize("d", [0.5, 0.7, 0.8, 0.9, 0.95, 0.99])
def test_dropped_ball_rests_after_the_textbook_time(d: float, dt: float) -> None:
    """With the average-velocity response every drop ends, near sqrt(2 H / g) (1 + d) / (1 - d), and gains no energy."""
    heights = np.random.default_rng(5).uniform(0.001, 1.0, 300)
    world = floor_world(Surface(damping=d), dt=dt)
    p = np.c_[np.zeros((300, 2)), BALL_RADIUS + heights]
    v = np.zeros((300, 3))
    shots = world.simulate_batch(p, v, max_time=200.0)
    assert (shots.status == Status.REST).all()
    ratio = shots.time / (np.sqrt(2.0 * heights / G) * (1 + d) / (1 - d))
    assert np.median(ratio) == pytest.approx(0.98, abs=0.025)
    assert ratio[heights > 0.05].min() > 0.75
    assert ratio[heights > 0.05].max() < 1.3

    before = G * p[:, 2]
    for _ in range(240):
        shots = world.simulate_batch(p, v, max_time=dt)
        p, v = shots.position, shots.velocity
        after = 0.5 * (v**2).sum(axis=1) + G * p[:, 2]
        assert (after <= before + 1e-12).all()
        before = after


def test_ball_dropped_from_19_cm_rests_after_about_a_second() -> None:
    """At the default damping of 0.7 the textbook time is 1.115 s; the CS121 notes taken literally hop for ever."""
    shot = floor_world(Surface()).simulate((0, 0, 0.19 + BALL_RADIUS), (0, 0, 0), max_time=600)
    assert shot.status == Status.REST
    assert shot.time == pytest.approx(1.115, rel=0.05)


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


def test_contact_that_the_ball_leaves_does_not_cancel_gravity() -> None:
    """A step of many sub-steps gains no energy, with gravity that bends the path by metres in a step.

    The balls slide around a faceted sphere, from the inside: they leave a facet's plane at each edge.
    """
    rng = np.random.default_rng(0)
    bowl = mesh(inside_out(sphere([0, 0, 0], 1.0)), Surface(restitution=0.3, tangential=0.9, rolling=0.0))
    max_substeps = 0
    for _ in range(12):
        gravity = rotation(rng) @ [0.0, 0.0, 10.0 ** rng.uniform(4, 5.5)]
        world = World([bowl], gravity=gravity, impact="conservative")
        p, v = rng.uniform(-0.5, 0.5, (64, 3)), 30.0 * rng.normal(size=(64, 3))
        for _ in range(20):
            before = 0.5 * (v**2).sum(axis=1) - p @ gravity
            recorded = world.simulate(p[0], v[0], max_time=world.dt, record=True)
            assert recorded.num_substeps is not None
            max_substeps = max(max_substeps, int(recorded.num_substeps.max()))
            shots = world.simulate_batch(p, v, max_time=world.dt)
            p, v = shots.position, shots.velocity
            after = 0.5 * (v**2).sum(axis=1) - p @ gravity
            assert (after <= before + 1e-12 * np.linalg.norm(gravity)).all()
    assert max_substeps > FORCE_RESTING_AFTER


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
