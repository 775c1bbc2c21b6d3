"""The time step against hand-worked and exact results; the run to rest repeats that step."""

import math
from pathlib import Path

import numpy as np
import pytest

from minigolf_env.physics import Status, Surface, TriangleMesh, World
from tests.physics.scenes import BALL_RADIUS, FloatArray, G, box, floor_world, grid, mesh, rotation, sphere, tetrahedron
from tests.physics.scenes import room as box_room

GOLDEN = dict(np.load(Path(__file__).parents[1] / "data" / "golden_steps.npz"))


def test_free_flight_is_a_parabola() -> None:
    """Without a hit a step adds v dt + g dt²/2 to the position and g dt to the velocity."""
    world = floor_world(Surface(), dt=0.125, gravity=(1.0, -2.0, -8.0))
    p, v = world.step([0.0, 0.0, 10.0], [3.0, 4.0, 5.0])
    assert p.tolist() == [3 / 8 + 1 / 128, 4 / 8 - 2 / 128, 10 + 5 / 8 - 8 / 128]
    assert v.tolist() == [3 + 1 / 8, 4 - 2 / 8, 5 - 1]


def test_hand_worked_drop() -> None:
    """At v = -2, g = -8, dt = 1/8: vavg = -5/2, alpha = 2/5, v' = 5/4, and the 3/40 s left lift it to 157/800 m."""
    world = floor_world(Surface(damping=0.5), ball_radius=0.125, dt=0.125, gravity=(0, 0, -8))
    shot = world.simulate([0, 0, 0.25], [0, 0, -2], max_time=0.125, record=True)
    assert shot.position == pytest.approx([0, 0, 157 / 800], abs=1e-12)
    assert shot.velocity == pytest.approx([0, 0, 13 / 20], abs=1e-11)
    assert shot.impacts["time"] == pytest.approx([0.05], abs=1e-12)
    assert shot.impacts["position"][0] == pytest.approx([0, 0, 0.125], abs=1e-12)
    assert shot.impacts["normal"].tolist() == [[0, 0, 1]]


def test_hand_worked_oblique_wall() -> None:
    """At a wall of normal (-3, 0, 4)/5 the formulas of the CS121 notes, section 4, hold with vavg = (4, 1, -1/2)."""
    n = np.array([-0.6, 0.0, 0.8])
    corners = np.array([[-8.0, -10, -6], [8, -10, 6], [8, 10, 6], [-8, 10, -6]])
    wall = TriangleMesh(corners, [[0, 1, 2], [0, 2, 3]], Surface(damping=0.75))
    world = World([wall], ball_radius=0.125, dt=0.125, gravity=(0, 0, -8))
    average = np.array([4.0, 1.0, -0.5])
    start = (0.125 + 0.14) * n
    alpha = 0.14 / (2.8 * 0.125)
    after = 0.75 * (average - 2 * (average @ n) * n)
    left = 0.125 * (1 - alpha)
    g = np.array([0, 0, -8])
    p, v = world.step(start, [4.0, 1.0, 0.0])
    assert p == pytest.approx(start + alpha * 0.125 * average + left * after + 0.5 * left**2 * g, abs=1e-11)
    assert v == pytest.approx(after + left * g, abs=1e-11)


@pytest.mark.parametrize("run", range(len(GOLDEN["radius"])))
def test_steps_follow_the_exact_golden_runs(run: int) -> None:
    """Steps follow the exact trajectories of the CS121 notes' algorithm; the bound grows as errors do at impacts."""
    vertices, faces, states = (GOLDEN[name][run] for name in ("vertices", "faces", "states"))
    surface = Surface(damping=float(GOLDEN["damping"][run]), rolling=0.0)
    dt = float(GOLDEN["dt"][run])
    meshes = [TriangleMesh(vertices[:8], faces[:12], surface), TriangleMesh(vertices[8:], faces[12:] - 8, surface)]
    world = World(meshes, ball_radius=float(GOLDEN["radius"][run]), dt=dt)
    bound = 1e-9
    p, v = np.split(states[0], 2)
    for exact in states[1:][np.isfinite(states[1:, 0])]:
        before = v
        p, v = world.step(p, v)
        if np.abs(v - before + [0, 0, G * dt]).max() > 1e-12:
            bound = min(4 * bound, 1e-6)
        assert np.abs(np.r_[p, v] - exact).max() <= bound


def furnished_room(seed: int, **kwargs: object) -> tuple[World, FloatArray, FloatArray]:
    """Return a rotated room with a box, a sphere and a tetrahedron, and the start of a ball in it."""
    rng = np.random.default_rng(seed)
    rot = rotation(rng)
    bodies = [box_room(), box([-0.3, -0.3, 0.0], [0.1, 0.2, 0.4]), sphere([0.5, 0.4, 0.3], 0.25)]
    bodies.append(tetrahedron([0.4, -0.5, 0.5], 0.3))
    surface = Surface(damping=float(rng.choice([0.5, 0.7, 0.9])), rolling=0.1)
    world = World([mesh(body, surface, rot) for body in bodies], gravity=rot @ [0, 0, -G], **kwargs)  # type: ignore[arg-type]
    return world, rot @ [-0.5, 0.5, 1.2], rot @ rng.uniform(-4, 4, 3)


@pytest.mark.parametrize("impact", ["average", "conservative"])
@pytest.mark.parametrize("seed", range(4))
def test_simulate_equals_repeated_steps_bitwise(seed: int, impact: str) -> None:
    """A run and its record have the same bits as repeated calls of step."""
    world, p, v = furnished_room(seed, impact=impact)
    shot = world.simulate(p, v, max_time=2.0, record=True)
    path = [p]
    for _ in range(len(shot.path) - 1):
        p, v = world.step(p, v)
        path.append(p)
    assert np.array_equal(shot.path, path)
    assert np.array_equal(shot.position, p)
    assert np.array_equal(shot.velocity, v)


@pytest.mark.parametrize("seed", range(4))
def test_recorded_path_times_and_impacts_agree(seed: int) -> None:
    """Times rise by dt; each impact is on its triangle, in contact, and in order."""
    world, p, v = furnished_room(seed)
    shot = world.simulate(p, v, record=True)
    bare = world.simulate(p, v)
    assert shot.status == Status.REST
    assert (bare.path, bare.times, bare.impacts) == (None, None, None)
    assert (bare.time, bare.bounces, bare.exhausted) == (shot.time, shot.bounces, 0)
    assert np.array_equal(bare.position, shot.position)
    assert len(shot.path) == len(shot.times)
    assert len(shot.impacts) == shot.bounces > 0
    assert np.diff(shot.times)[:-1] == pytest.approx(world.dt, abs=1e-12)
    assert (shot.times[0], shot.times[-1]) == (0.0, shot.time)
    assert (np.diff(shot.impacts["time"]) >= 0.0).all()
    corners = np.concatenate([body.triangles for body in world.meshes])
    for contact in shot.impacts:
        touched = contact["position"] - world.ball_radius * contact["normal"]
        a, b, c = corners[contact["triangle"]]
        n = np.cross(b - a, c - a)
        assert abs((touched - a) @ n) / np.linalg.norm(n) < 1e-9
        k = int(contact["time"] / world.dt)
        assert np.linalg.norm(contact["position"] - shot.path[k]) <= np.linalg.norm(v) * 3 * world.dt


def test_status_says_why_a_run_ended() -> None:
    """At rest the time is exact, out of bounds a multiple of dt, and at the time limit the limit."""
    bounds = [[-1, -1, -1], [1, 1, 1]]
    world = World([mesh(grid(100.0, 1), Surface(rolling=0.5))], bounds=bounds)
    rest = world.simulate([0, 0, BALL_RADIUS], [1.0, 0, 0])
    out = world.simulate([0, 0, BALL_RADIUS], [5.0, 0, 0])
    late = world.simulate([0, 0, BALL_RADIUS], [1.0, 0, 0], max_time=0.1)
    assert [rest.status, out.status, late.status] == [Status.REST, Status.OUT_OF_BOUNDS, Status.TIME_LIMIT]
    assert rest.time == pytest.approx(1 / (0.5 * G), abs=1e-12)
    assert out.position[0] > 1.0 >= out.position[0] - 5.0 * world.dt
    assert out.time / world.dt == pytest.approx(round(out.time / world.dt), abs=1e-9)
    assert late.time == pytest.approx(0.1, abs=1e-12)
    assert not rest.velocity.any()


@pytest.mark.parametrize(("e", "total"), [(0.5, 1.355), (0.8, 4.064)])
def test_dropped_ball_stops_after_the_textbook_time(e: float, total: float) -> None:
    """A drop from 1 m bounces for sqrt(2 H / g) (1 + e) / (1 - e); the error shrinks with dt."""
    exact = math.sqrt(2 / G) * (1 + e) / (1 - e)
    assert exact == pytest.approx(total, abs=5e-4)
    errors = []
    for dt in (1 / 60, 1 / 240, 1 / 960, 1 / 3840):
        world = floor_world(Surface(damping=e), dt=dt, impact="conservative")
        errors.append(abs(world.simulate([0, 0, 1 + BALL_RADIUS], [0, 0, 0]).time - exact))
    assert errors[0] < 0.05 * total
    assert errors[-1] < 2e-3 * total
    assert errors[-1] < 0.1 * errors[0]


def test_number_of_bounces_between_two_walls_is_at_most_pi_over_theta() -> None:
    """Between two elastic walls at an angle theta a ball bounces at most ceil(pi / theta) times, and leaves."""
    rng = np.random.default_rng(9)
    for angle in np.radians([90, 60, 50, 36, 25, 12]):
        side = np.array([math.cos(angle), math.sin(angle)])
        corners = [[0, 0, -50], [50, 0, -50], [50, 0, 50], [0, 0, 50], [*50 * side, -50], [*50 * side, 50]]
        faces = [[0, 1, 2], [0, 2, 3], [0, 3, 5], [0, 5, 4]]
        world = World([TriangleMesh(corners, faces, Surface(damping=1.0))], ball_radius=0.01, gravity=(0, 0, 0))
        middle = np.array([math.cos(angle / 2), math.sin(angle / 2), 0.0])
        max_bounces = 0
        for _ in range(40):
            start = 2.0 * middle
            aim = 0.2 * rng.random() * middle + [0.0, 0.0, rng.uniform(-1, 1)]
            shot = world.simulate(start, 3.0 * (aim - start), max_time=3.0)
            assert shot.exhausted == 0
            max_bounces = max(max_bounces, shot.bounces)
        assert math.ceil(math.pi / angle) - 1 <= max_bounces <= math.ceil(math.pi / angle)


@pytest.mark.parametrize("impact", ["average", "conservative"])
def test_mirrored_world_gives_the_mirrored_run(impact: str) -> None:
    """Mirroring the scene, the gravity and the ball mirrors the path, as long as rounding errors stay small."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        bodies = [box_room(), sphere([0.5, 0.4, 0.3], 0.25), tetrahedron([-0.3, -0.2, 0.5], 0.3)]
        gravity = rng.normal(size=3) * 5
        p = np.array([-0.6, 0.6, 1.4])
        v = rng.uniform(-3, 3, 3)
        mirror = np.array([-1.0, 1.0, 1.0])
        worlds = [World([mesh(body, Surface(damping=0.8)) for body in bodies], gravity=gravity, impact=impact)]
        mirrored = [TriangleMesh(mirror * vertices, faces[:, ::-1], Surface(damping=0.8)) for vertices, faces in bodies]
        worlds.append(World(mirrored, gravity=mirror * gravity, impact=impact))
        shots = [w.simulate(m * p, m * v, max_time=0.8) for w, m in zip(worlds, (np.ones(3), mirror))]
        assert shots[0].bounces == shots[1].bounces > 0
        assert mirror * shots[1].position == pytest.approx(shots[0].position, abs=1e-8)


def test_elastic_motion_without_gravity_is_reversible() -> None:
    """With d = 1 and no gravity, the reversed velocity brings the ball back through the same bounces."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        rot = rotation(rng)
        bodies = [box_room(), sphere([0.3, 0.2, 1.0], 0.3)]
        world = World([mesh(body, Surface(damping=1.0), rot) for body in bodies], gravity=(0, 0, 0))
        p, v = rot @ [-0.5, 0.5, 1.2], rot @ rng.uniform(-3, 3, 3)
        forward = world.simulate(p, v, max_time=1.0)
        back = world.simulate(forward.position, -forward.velocity, max_time=1.0)
        assert forward.bounces == back.bounces > 0
        assert back.position == pytest.approx(p, abs=1e-8)
        assert back.velocity == pytest.approx(-v, abs=1e-7)
