"""Resting contacts over time: rolling on slopes, creases, greens and seams, and rest."""

import math

import numpy as np
import pytest

from minigolf_env.physics import Status, Surface, TriangleMesh, World
from tests.physics.scenes import (
    BALL_RADIUS,
    FloatArray,
    G,
    box,
    cone,
    floor_world,
    grid,
    groove,
    mesh,
    room,
    rotation,
    rotation_about_y,
)

GREEN = Surface(damping=0.5, restitution=0.2, tangential=1.0, rolling=0.05)


@pytest.mark.parametrize("damping", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("slope", [0.01, 0.3, 1.2])
def test_slope_accelerates_by_g_sin_beta(slope: float, damping: float) -> None:
    """Without resistance a ball gains g sin(beta) t down a slope, keeps its sideways speed, and stays on the plane."""
    rot = rotation_about_y(slope)
    world = World([mesh(grid(200.0, 1), Surface(damping=damping, rolling=0.0), rot)])
    down, up = rot @ [1, 0, 0], rot @ [0, 0, 1]
    shot = world.simulate(BALL_RADIUS * up, [0.0, 0.5, 0.0], max_time=2.0, record=True)
    a = G * math.sin(slope)
    assert shot.bounces == 0
    assert shot.velocity == pytest.approx(2.0 * a * down + [0, 0.5, 0], abs=1e-10)
    assert shot.position == pytest.approx(BALL_RADIUS * up + 2.0 * a * down + [0, 1.0, 0], abs=1e-10)
    assert shot.path @ up == pytest.approx(BALL_RADIUS, abs=1e-10)


def test_rolling_resistance_is_proportional_to_the_normal_load() -> None:
    """Down a slope the acceleration is g (sin(beta) - c cos(beta)); up the slope the sum of both terms brakes."""
    slope = 0.2
    c = 0.05
    rot = rotation_about_y(slope)
    world = World([mesh(grid(200.0, 1), Surface(rolling=c), rot)])
    down, up = rot @ [1, 0, 0], rot @ [0, 0, 1]
    for sign in (1.0, -1.0):
        a = G * (math.sin(slope) - sign * c * math.cos(slope))
        shot = world.simulate(BALL_RADIUS * up, sign * 3.0 * down, max_time=1.0)
        assert shot.velocity @ down == pytest.approx(sign * 3.0 + a, abs=1e-11)


@pytest.mark.parametrize("rotated", [False, True])
@pytest.mark.parametrize(("stimp", "a"), [(8, 0.686), (10, 0.549), (12, 0.457)])
def test_putt_on_a_green_of_given_stimp_has_its_length(stimp: float, a: float, rotated: bool) -> None:
    """A putt on a green of Stimp S rolls v²/(2 a) in v/a, with a = 1.829² / (2 0.3048 S), whatever way is down."""
    exact = 1.829**2 / (2 * 0.3048 * stimp)
    assert exact == pytest.approx(a, abs=5e-4)
    rot = rotation(np.random.default_rng(stimp)) if rotated else np.eye(3)
    surface = Surface(damping=1.0, rolling=exact / G)
    world = World([mesh(grid(40.0, 1), surface, rot)], gravity=rot @ [0, 0, -G])
    for v in ([0.01, 0.0], [1.829, 0.0], [1.0, -2.5]):
        speed = math.hypot(*v)
        shot = world.simulate(rot @ [0, 0, BALL_RADIUS], rot @ [*v, 0])
        assert shot.status == Status.REST
        assert shot.bounces == 0
        assert shot.time == pytest.approx(speed / exact, abs=1e-10)
        direction = rot @ [*v, 0] / speed
        assert shot.position == pytest.approx(rot @ [0, 0, BALL_RADIUS] + speed**2 / (2 * exact) * direction, abs=1e-10)


@pytest.mark.parametrize("slope", [0.001, 0.02, 0.045])
@pytest.mark.parametrize("angle", [30.0, 90.0, 150.0])
def test_putt_across_a_slope_comes_to_rest(slope: float, angle: float) -> None:
    """On a slope gentler than the rolling resistance every putt curves, comes to rest, and loses no time."""
    rot = rotation_about_y(math.atan(slope))
    world = World([mesh(grid(100.0, 1), GREEN, rot)])
    direction = rot @ [math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0.0]
    shot = world.simulate(rot @ [0, 0, BALL_RADIUS], 1.5 * direction, max_time=120.0)
    assert (shot.status, shot.exhausted, shot.bounces) == (Status.REST, 0, 0)
    assert np.array_equal(world.step(shot.position, shot.velocity)[0], shot.position)


def test_ball_in_a_crease_is_braked_by_both_planes() -> None:
    """In a crease the acceleration is gravity along it, less the resistance of the load on each plane."""
    slope = 0.3
    angle = 0.6
    c = 0.02
    rot = rotation(np.random.default_rng(4))
    vertices, faces = groove(angle)
    gravity = rot @ [0, G * math.sin(slope), -G * math.cos(slope)]
    for rolling in (0.0, c):
        world = World([TriangleMesh(vertices @ rot.T, faces, Surface(damping=0.5, rolling=rolling))], gravity=gravity)
        start = rot @ [0, -5, BALL_RADIUS / math.cos(angle)]
        shot = world.simulate(start, [0, 0, 0], max_time=1.0)
        a = G * math.sin(slope) - 2 * rolling * G * math.cos(slope) * math.cos(angle)
        assert shot.velocity == pytest.approx(rot @ [0, a, 0], abs=1e-9)
        assert shot.position == pytest.approx(start + rot @ [0, 0.5 * a, 0], abs=1e-9)


def stays_at_rest(world: World, p: FloatArray) -> bool:
    """Return whether a ball placed at p does not move by a bit in 200 steps."""
    for _ in range(200):
        q, v = world.step(p, [0, 0, 0])
        if not (np.array_equal(q, p) and not v.any()):
            return False
    shot = world.simulate(p, [0, 0, 0])
    return shot.status == Status.REST and shot.time == 0.0


@pytest.mark.parametrize("c", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("damping", [0.0, 0.7, 1.0])
def test_rolling_resistance_holds_a_ball_up_to_its_limit(c: float, damping: float) -> None:
    """A ball placed on a slope stays at rest exactly when tan(beta) <= c."""
    for fraction, is_at_rest in ((0.5, True), (1 - 1e-9, True), (1 + 1e-9, False), (1.5, False)):
        rot = rotation_about_y(math.atan(c) * fraction)
        world = World([mesh(grid(10.0, 1), Surface(damping=damping, rolling=c), rot)])
        assert stays_at_rest(world, rot @ [0, 0, BALL_RADIUS]) == is_at_rest


def test_resting_ball_is_unchanged_after_10000_steps() -> None:
    """A ball at rest on a rotated floor keeps every bit for 10,000 steps."""
    rot = rotation(np.random.default_rng(8))
    world = World([mesh(room(4.0), GREEN, rot)], gravity=rot @ [0, 0, -G])
    shot = world.simulate(rot @ [0.3, 0.2, 0.5], rot @ [1.0, 2.0, 0.0])
    assert shot.status == Status.REST
    p, v = shot.position, shot.velocity
    for _ in range(10_000):
        p, v = world.step(p, v)
    assert np.array_equal(p, shot.position)
    assert not v.any()


@pytest.mark.parametrize("damping", [0.0, 0.5, 0.8])
@pytest.mark.parametrize("degrees", [5, 30, 45, 60, 75, 85])
def test_ball_rests_at_the_bottom_of_a_groove(degrees: float, damping: float) -> None:
    """A ball dropped into a V groove of any width ends at rest at its bottom, and loses no time."""
    angle = math.radians(degrees)
    rot = rotation(np.random.default_rng(degrees))
    world = World([mesh(groove(angle), Surface(damping=damping, rolling=0.05), rot)], gravity=rot @ [0, 0, -G])
    bottom = BALL_RADIUS / math.cos(angle)
    shot = world.simulate(rot @ [0.0, 0.0, bottom + 0.05], rot @ [0.01, 0.1, 0.0], max_time=60.0)
    assert (shot.status, shot.exhausted) == (Status.REST, 0)
    assert (rot.T @ shot.position)[[0, 2]] == pytest.approx([0.0, bottom], abs=1e-6)
    assert stays_at_rest(world, shot.position)


@pytest.mark.parametrize("seed", range(20))
def test_ball_placed_where_a_run_ended_at_rest_does_not_move(seed: int) -> None:
    """Among boxes, spheres and needles, rest is declared only where a ball placed there does not move by a bit."""
    rng = np.random.default_rng(seed)
    rot = rotation(rng)
    bodies = [room(), box([-0.6, -0.3, 0.0], [-0.1, 0.2, 0.03]), cone([0.2, 0.2, 0.0], 0.3, 0.2)]
    bodies += [box([0.1, -0.5, 0.02], [0.3, -0.4, 0.5]), cone([0.5, 0.5, 0.0], 0.01, 0.4)]
    surface = Surface(damping=0.5, restitution=rng.choice([0.0, 0.3]), tangential=1.0, rolling=0.1)
    gravity = rot @ (G * np.array([*rng.normal(size=2) * 0.5, -1.0]))
    world = World([mesh(body, surface, rot) for body in bodies], gravity=gravity)
    starts = np.array([rot @ [0.7, 0.7, 1.0], rot @ [-0.3, 0.0, 0.8], rot @ [0.2, 0.25, 0.6]] * 10)
    shots = world.simulate_batch(starts, rng.normal(size=starts.shape), max_time=60.0)
    assert shots.exhausted.sum() == 0
    resting = shots.position[shots.status == Status.REST]
    again = world.simulate_batch(resting, np.zeros_like(resting), max_time=1.0)
    assert len(resting) > 0
    assert np.array_equal(again.position, resting)
    assert not again.time.any()


@pytest.mark.parametrize("impact", ["average", "conservative"])
@pytest.mark.parametrize("feature", ["edge", "vertex"])
def test_ball_dropped_exactly_on_an_edge_or_vertex_balances(feature: str, impact: str) -> None:
    """The ball bounces straight up and ends balanced on the horizontal edge or the apex."""
    ridge = TriangleMesh([[-1, 0, 0], [1, 0, 0], [0, 1, -1], [0, -1, -1]], [[0, 1, 2], [1, 0, 3]], GREEN)
    world = World([ridge if feature == "edge" else mesh(cone([0, 0, -1], 0.5, 1.0), GREEN)], impact=impact)
    shot = world.simulate([0, 0, 0.1], [0, 0, 0], record=True)
    assert shot.status == Status.REST
    assert not shot.path[:, :2].any()
    assert shot.position[2] == pytest.approx(BALL_RADIUS, abs=1e-11)


@pytest.mark.parametrize("rotated", [False, True])
def test_seams_of_a_flat_floor_have_no_effect(rotated: bool) -> None:
    """Across thousands of jittered coplanar triangles a ball rolls as on one plane, within 1e-13 m of it."""
    rng = np.random.default_rng(12)
    rot = rotation(rng) if rotated else np.eye(3)
    vertices, faces = grid(2.0, 40)
    vertices[:, :2] += rng.uniform(-0.02, 0.02, (len(vertices), 2))
    gravity = rot @ [0, 0, -G]
    fine = World([TriangleMesh(vertices @ rot.T, faces, GREEN)], gravity=gravity)
    plain = World([mesh(grid(2.2, 1), GREEN, rot)], gravity=gravity)
    for v in ([0.9, 0.0, 0], [0.6, 0.65, 0], [0.3, -0.8, 0]):
        start = rot @ [-0.2, 0.1, BALL_RADIUS]
        shot = fine.simulate(start, rot @ v, record=True)
        expected = plain.simulate(start, rot @ v)
        assert np.abs((shot.path - start) @ (rot @ [0, 0, 1])).max() <= 1e-13
        assert shot.position == pytest.approx(expected.position, abs=1e-11)
        assert shot.time == pytest.approx(expected.time, abs=1e-11)


@pytest.mark.parametrize("rotated", [False, True])
@pytest.mark.parametrize("bump", [1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7])
def test_unevenness_of_single_precision_does_not_stop_a_putt(bump: float, rotated: bool) -> None:
    """On a floor with vertices off by less than a mesh file's rounding a putt keeps its length and direction."""
    rng = np.random.default_rng(1)
    rot = rotation(rng) if rotated else np.eye(3)
    world = World([mesh(grid(8.0, 80, rng.uniform(-bump, bump, (81, 81))), GREEN, rot)], gravity=rot @ [0, 0, -G])
    start, v = np.array([-2, -1.3, BALL_RADIUS + bump]), np.array([1.5, 0.4, 0.0])
    shot = world.simulate(rot @ start, rot @ v, record=True)
    a = 0.05 * G
    assert (shot.status, shot.bounces, shot.exhausted) == (Status.REST, 0, 0)
    assert rot.T @ shot.position == pytest.approx(start + v * np.linalg.norm(v) / (2 * a), abs=2e-3)
    assert np.abs((shot.path @ rot)[:, 2] - start[2]).max() < 3 * bump


@pytest.mark.parametrize("lift", [0.0, 0.01, 0.03, 0.039])
@pytest.mark.parametrize("degrees", [0.01, 0.2, 1.0])
def test_ball_with_a_tiny_hop_rolls_onto_a_ramp(degrees: float, lift: float) -> None:
    """A rolling ball follows a shallow ramp, also if its hop is too small to leave the floor."""
    angle = math.radians(degrees)
    y = 5.0
    high = [5 * math.cos(angle), 5 * math.sin(angle)]
    corners = [[-5, -y, 0], [0, -y, 0], [high[0], -y, high[1]], [-5, y, 0], [0, y, 0], [high[0], y, high[1]]]
    surface = Surface(restitution=0.0, tangential=1.0, rolling=0.0)
    world = World([TriangleMesh(corners, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]], surface)])
    for x in np.linspace(-0.02, -0.001, 9):
        p, v = np.array([x, 0.0, BALL_RADIUS]), np.array([2.0, 0.0, lift])
        for _ in range(3):
            p, v = world.step(p, v)
        assert np.linalg.norm(v) > 1.98
        assert v[2] == pytest.approx(math.tan(angle) * v[0], abs=1e-9)


def test_facets_of_a_bowl_brake_less_without_tangential_damping() -> None:
    """Damping loses speed at each facet; tangential 1 keeps all but the normal part of the velocity."""
    facets = np.radians(np.linspace(-45, 0, 46))
    x = np.sin(facets)
    z = 1 - np.cos(facets)
    vertices = np.array([[a, y, b] for a, b in zip(x, z) for y in (-1.0, 1.0)])
    first = 2 * np.arange(len(facets) - 1)
    faces = np.r_[np.c_[first, first + 2, first + 1], np.c_[first + 1, first + 2, first + 3]]
    speeds = {}
    for name, surface in {"d": Surface(damping=0.7, rolling=0.0), "t": Surface(0.7, 0.0, 1.0, 0.0)}.items():
        world = World([TriangleMesh(vertices, faces, surface)], gravity=(0, 0, 0))
        n = np.array([-math.sin(facets[0] + 0.00873), 0, math.cos(facets[0] + 0.00873)])
        start = vertices[0] + np.array([0, 1, 0]) + BALL_RADIUS * n + 0.002 * np.array([n[2], 0, -n[0]])
        speeds[name] = np.linalg.norm(world.simulate(start, 3.0 * np.array([n[2], 0, -n[0]]), max_time=0.2).velocity)
    assert speeds["t"] == pytest.approx(3.0 * math.cos(math.radians(1.0)) ** 44, abs=0.02)
    assert speeds["d"] < 0.25 * speeds["t"]


def test_rolling_on_a_level_floor_without_resistance_is_exact() -> None:
    """A ball that rolls for a minute keeps its height and speed to the bit."""
    world = floor_world(Surface(damping=1.0, rolling=0.0))
    shot = world.simulate([0, 0, BALL_RADIUS], [0.5, 0.25, 0], max_time=60.0, record=True)
    assert (shot.path[:, 2] == BALL_RADIUS).all()
    assert shot.velocity.tolist() == [0.5, 0.25, 0]
