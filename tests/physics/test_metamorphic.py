"""A scene that is rotated, moved, scaled, renumbered or subdivided gives the same trajectory."""

from collections.abc import Callable

import numpy as np
import pytest

from minigolf_env.physics import Shot, Surface, TriangleMesh, World
from tests.physics.scenes import (
    BALL_RADIUS,
    Body,
    FloatArray,
    box,
    cone,
    free_starts,
    grid,
    mesh,
    random_room,
    room,
    rotation,
    sphere,
    tetrahedron,
)

IMPACTS = ("average", "conservative")
GRAVITY = np.array([0.3, -0.2, -9.5])
MAX_TIME = 0.8
"""Duration of runs, s: at least one bounce each, and few enough that growing errors of 1e-16 stay below 1e-8."""

BODIES = {
    "room": room(2.0),
    "block": box([-0.3, -0.4, 0.0], [0.1, 0.2, 0.3]),
    "globe": sphere([0.5, 0.4, 0.3], 0.25),
    "rock": tetrahedron([-0.5, -0.6, 0.3], 0.3),
    "needle": cone([0.4, -0.5, 0.0], 0.05, 0.6),
}
SURFACES = {
    "room": Surface(restitution=0.6, tangential=1.0, rolling=0.05),
    "block": Surface(damping=0.7),
    "globe": Surface(damping=0.9),
    "rock": Surface(damping=1.0),
    "needle": Surface(damping=0.8),
}
Change = Callable[[Body], Body]


def build_world(change: Change = lambda body: body, gravity: FloatArray = GRAVITY, **kwargs: object) -> World:
    """Return the furnished room after a change of each body."""
    return World([mesh(change(BODIES[name]), SURFACES[name]) for name in BODIES], gravity=gravity, **kwargs)  # type: ignore[arg-type]


def random_starts(count: int = 12) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities of balls in the furnished room."""
    rng = np.random.default_rng(3)
    starts = rng.uniform([-0.9, -0.9, 0.9], [0.9, 0.9, 1.9], (count, 3))
    return starts, rng.uniform(-3, 3, (count, 3))


def has_same_bits(shots: Shot, expected: Shot, unit: float = 1.0) -> bool:
    """Return whether two batches are equal bit for bit, lengths multiplied by ``unit``."""
    exact = all(np.array_equal(getattr(shots, name), getattr(expected, name)) for name in ("status", "time", "bounces"))
    lengths = all(np.array_equal(getattr(shots, x), unit * getattr(expected, x)) for x in ("position", "velocity"))
    return exact and lengths


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("seed", range(3))
def test_rotated_world_gives_the_rotated_run(seed: int, impact: str) -> None:
    """Rotating everything rotates the path; rounding errors grow at each bounce and stay below 1e-8 m."""
    rot = rotation(np.random.default_rng(seed))
    p, v = random_starts()
    expected = build_world(impact=impact).simulate_batch(p, v, MAX_TIME)
    rotated = build_world(lambda body: (body[0] @ rot.T, body[1]), rot @ GRAVITY, impact=impact)
    shots = rotated.simulate_batch(p @ rot.T, v @ rot.T, MAX_TIME)
    assert np.array_equal(shots.bounces, expected.bounces)
    assert expected.bounces.sum() > 0  # type: ignore[attr-defined]
    assert shots.position @ rot == pytest.approx(expected.position, abs=1e-8)
    assert shots.velocity @ rot == pytest.approx(expected.velocity, abs=1e-7)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("move", [[1.0, -2.0, 3.0], [1e3, 1e3, 0.0]])
def test_translated_world_gives_the_translated_run(move: list[float], impact: str) -> None:
    """Moving everything moves the path; far from the origin coordinates and the tolerance have larger errors."""
    p, v = random_starts()
    expected = build_world(impact=impact).simulate_batch(p, v, MAX_TIME)
    moved = build_world(lambda body: (body[0] + move, body[1]), impact=impact)
    shots = moved.simulate_batch(p + move, v, MAX_TIME)
    assert np.array_equal(shots.bounces, expected.bounces)
    assert shots.position - move == pytest.approx(expected.position, abs=1e-8 * moved.coordinate_scale)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("k", [-40, -7, 3, 20])
def test_scaling_lengths_by_powers_of_two_keeps_the_bits(k: int, impact: str) -> None:
    """All lengths times 2**k give the same bits until rest, so no length or speed is built in."""
    unit = 2.0**k
    p, v = random_starts()
    expected = build_world(impact=impact).simulate_batch(p, v)
    scaled = build_world(
        lambda body: (unit * body[0], body[1]), unit * GRAVITY, impact=impact, ball_radius=unit * BALL_RADIUS
    )
    assert has_same_bits(scaled.simulate_batch(unit * p, unit * v), expected, unit)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("k", [-10, 3])
def test_scaling_times_by_powers_of_two_keeps_the_bits(k: int, impact: str) -> None:
    """All times times 2**k give the same bits, so no duration is built in."""
    unit = 2.0**k
    p, v = random_starts()
    expected = build_world(impact=impact).simulate_batch(p, v)
    slower = build_world(gravity=GRAVITY / unit**2, impact=impact, dt=unit / 120)
    shots = slower.simulate_batch(p, v / unit, 30.0 * unit)
    scaled = shots._replace(velocity=unit * shots.velocity, time=np.asarray(shots.time) / unit)
    assert has_same_bits(scaled, expected)


@pytest.mark.parametrize("impact", IMPACTS)
def test_order_of_faces_does_not_matter(impact: str) -> None:
    """Shuffled faces give the same bits, until two faces are hit at their common edge or vertex at the same instant.

    Then the normal of the first triangle counts, and the normals of two faces at one point differ by rounding.
    """
    rng = np.random.default_rng(8)
    p, v = random_starts(40)
    world = build_world(impact=impact)
    shuffled = build_world(lambda body: (body[0], rng.permutation(body[1])), impact=impact)
    hits = world.sweep_batch(p, p + v)
    shuffled_hits = shuffled.sweep_batch(p, p + v)
    assert np.array_equal(hits.alpha, shuffled_hits.alpha)
    assert hits.normal == pytest.approx(shuffled_hits.normal, abs=1e-14)
    expected, shots = (w.simulate_batch(p, v, MAX_TIME) for w in (world, shuffled))
    assert np.array_equal(shots.bounces, expected.bounces)
    assert shots.position == pytest.approx(expected.position, abs=1e-10)
    assert (shots.position == expected.position).all(axis=1).mean() > 0.9


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("first", [1, 2])
def test_first_corner_of_a_face_does_not_matter(first: int, impact: str) -> None:
    """Faces that start at another corner change the path only by rounding."""
    p, v = random_starts()
    expected = build_world(impact=impact).simulate_batch(p, v, MAX_TIME)
    shots = build_world(lambda body: (body[0], np.roll(body[1], first, axis=1)), impact=impact).simulate_batch(
        p, v, MAX_TIME
    )
    assert np.array_equal(shots.bounces, expected.bounces)
    assert shots.position == pytest.approx(expected.position, abs=1e-8)


def subdivided(body: Body) -> Body:
    """Return the body with each face divided into four at the midpoints of its edges."""
    corners = body[0][body[1]]
    a = corners[:, 0]
    b = corners[:, 1]
    c = corners[:, 2]
    ab = 0.5 * (a + b)
    bc = 0.5 * (b + c)
    ca = 0.5 * (c + a)
    parts = [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    vertices = np.concatenate(parts).reshape(-1, 3)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def snapped_to_lattice(body: Body) -> Body:
    """Return the body with its vertices at multiples of 2**-20 m, whose midpoints are exact."""
    return np.round(body[0] * 2.0**20) / 2.0**20, body[1]


@pytest.mark.parametrize("impact", IMPACTS)
def test_subdivided_faces_give_the_same_run(impact: str) -> None:
    """Dividing every face into 4, 16 and 64 coplanar faces changes the path only by rounding."""
    p, v = random_starts()
    expected = build_world(snapped_to_lattice, impact=impact).simulate_batch(p, v, MAX_TIME)
    change = snapped_to_lattice
    for _ in range(3):
        change = lambda body, previous=change: subdivided(previous(body))  # noqa: E731
        shots = build_world(change, impact=impact).simulate_batch(p, v, MAX_TIME)
        assert np.array_equal(shots.bounces, expected.bounces)
        assert shots.position == pytest.approx(expected.position, abs=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_sweep_of_a_split_path_equals_the_whole_sweep(seed: int) -> None:
    """Sweeps of the two halves of a path have the hit of the whole path, at the same place and with the same normal."""
    rng = np.random.default_rng(seed)
    world, frame = random_room(rng)
    starts = free_starts(rng, world, frame, 400)
    ends = starts + rng.normal(size=starts.shape) @ frame.T
    middles = 0.5 * (starts + ends)
    whole, first, second = (world.sweep_batch(a, b) for a, b in ((starts, ends), (starts, middles), (middles, ends)))
    alpha = np.where(first.hit, 0.5 * first.alpha, 0.5 + 0.5 * np.where(second.hit, second.alpha, 1.0))
    hit = first.hit | second.hit
    normal = np.where(first.hit[:, None], first.normal, second.normal)
    length = np.linalg.norm(ends - starts, axis=1)
    steep = np.abs(((ends - starts) * whole.normal).sum(axis=1)) / length > 1e-3
    assert np.array_equal(whole.hit[steep], hit[steep])
    assert (np.abs(whole.alpha - alpha) * length)[steep] == pytest.approx(0.0, abs=1e-9 * world.coordinate_scale)
    assert normal[steep] == pytest.approx(whole.normal[steep], abs=1e-6)
    assert steep.sum() > 50


def test_putt_does_not_depend_on_the_number_of_floor_triangles() -> None:
    """A putt on a level floor of 2 or of 20,000 triangles ends with the same bits."""
    green = Surface(restitution=0.3, tangential=1.0, rolling=0.05)
    putts = np.array([[x, y, 0.0] for x in (0.5, 1.0) for y in (0.1, -0.7)])
    starts = np.tile([0.01, 0.02, BALL_RADIUS], (4, 1))
    coarse, fine = (World([mesh(grid(8.0, n), green)]).simulate_batch(starts, putts) for n in (1, 100))
    assert has_same_bits(fine, coarse)


def test_winding_of_two_sided_faces_does_not_matter() -> None:
    """Reversed winding of two-sided faces changes the path only by rounding."""
    p, v = random_starts()
    worlds = []
    for step in (1, -1):
        meshes = [TriangleMesh(BODIES[n][0], BODIES[n][1][:, ::step], SURFACES[n], two_sided=True) for n in BODIES]
        worlds.append(World(meshes, gravity=GRAVITY))
    expected, shots = (world.simulate_batch(p, v, MAX_TIME) for world in worlds)
    assert np.array_equal(shots.bounces, expected.bounces)
    assert shots.position == pytest.approx(expected.position, abs=1e-8)
