"""The same scene told differently: turned, moved, scaled, renumbered, cut up. The ball must not notice."""

from collections.abc import Callable

import numpy as np
import pytest

from minigolf_env.physics import Shot, Surface, TriangleMesh, World
from tests.physics.scenes import (
    BALL,
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
LIMIT = 0.8
"""s: at least one bounce each, and not so many that errors of 1e-16, which grow at each, reach 1e-8."""

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


def build(change: Change = lambda body: body, gravity: FloatArray = GRAVITY, **kwargs: object) -> World:
    """Return the furnished room with each body changed."""
    return World([mesh(change(BODIES[name]), SURFACES[name]) for name in BODIES], gravity=gravity, **kwargs)  # type: ignore[arg-type]


def throws(count: int = 12) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities of balls in the furnished room."""
    rng = np.random.default_rng(3)
    starts = rng.uniform([-0.9, -0.9, 0.9], [0.9, 0.9, 1.9], (count, 3))
    return starts, rng.uniform(-3, 3, (count, 3))


def same(shots: Shot, expected: Shot, unit: float = 1.0) -> bool:
    """Return whether two batches are the same bits, lengths times ``unit``."""
    exact = all(np.array_equal(getattr(shots, name), getattr(expected, name)) for name in ("status", "time", "bounces"))
    lengths = all(np.array_equal(getattr(shots, x), unit * getattr(expected, x)) for x in ("position", "velocity"))
    return exact and lengths


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("seed", range(3))
def test_turned_world_gives_the_turned_run(seed: int, impact: str) -> None:
    """Turning everything turns the path: what rounding differs grows at each bounce, and stays below 1e-8 m."""
    turn = rotation(np.random.default_rng(seed))
    p, v = throws()
    expected = build(impact=impact).simulate_batch(p, v, LIMIT)
    turned = build(lambda body: (body[0] @ turn.T, body[1]), turn @ GRAVITY, impact=impact)
    shots = turned.simulate_batch(p @ turn.T, v @ turn.T, LIMIT)
    assert np.array_equal(shots.bounces, expected.bounces)
    assert expected.bounces.sum() > 0  # type: ignore[attr-defined]
    assert shots.position @ turn == pytest.approx(expected.position, abs=1e-8)
    assert shots.velocity @ turn == pytest.approx(expected.velocity, abs=1e-7)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("move", [[1.0, -2.0, 3.0], [1e3, 1e3, 0.0]])
def test_moved_world_gives_the_moved_run(move: list[float], impact: str) -> None:
    """Moving everything moves the path; far from the origin coordinates, and the tolerance, have larger errors."""
    p, v = throws()
    expected = build(impact=impact).simulate_batch(p, v, LIMIT)
    moved = build(lambda body: (body[0] + move, body[1]), impact=impact)
    shots = moved.simulate_batch(p + move, v, LIMIT)
    assert np.array_equal(shots.bounces, expected.bounces)
    assert shots.position - move == pytest.approx(expected.position, abs=1e-8 * moved.coordinate_scale)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("k", [-40, -7, 3, 20])
def test_powers_of_two_scale_a_run_bit_for_bit(k: int, impact: str) -> None:
    """All lengths times 2**k: the same bits to the very rest, so no length or speed is built in."""
    unit, (p, v) = 2.0**k, throws()
    expected = build(impact=impact).simulate_batch(p, v)
    scaled = build(lambda body: (unit * body[0], body[1]), unit * GRAVITY, impact=impact, ball_radius=unit * BALL)
    assert same(scaled.simulate_batch(unit * p, unit * v), expected, unit)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("k", [-10, 3])
def test_powers_of_two_scale_the_time_bit_for_bit(k: int, impact: str) -> None:
    """All times times 2**k: the same bits, so no duration is built in."""
    unit, (p, v) = 2.0**k, throws()
    expected = build(impact=impact).simulate_batch(p, v)
    slower = build(gravity=GRAVITY / unit**2, impact=impact, dt=unit / 120)
    shots = slower.simulate_batch(p, v / unit, 30.0 * unit)
    scaled = shots._replace(velocity=unit * shots.velocity, time=np.asarray(shots.time) / unit)
    assert same(scaled, expected)


@pytest.mark.parametrize("impact", IMPACTS)
def test_order_of_faces_does_not_matter(impact: str) -> None:
    """Shuffled faces give the same bits, until two that share an edge or vertex are met there in the same instant.

    Then the normal of the first number counts, and normals of two faces to one point differ by rounding.
    """
    rng, (p, v) = np.random.default_rng(8), throws(40)
    world = build(impact=impact)
    shuffled = build(lambda body: (body[0], rng.permutation(body[1])), impact=impact)
    hits, others = world.sweep_batch(p, p + v), shuffled.sweep_batch(p, p + v)
    assert np.array_equal(hits.alpha, others.alpha)
    assert hits.normal == pytest.approx(others.normal, abs=1e-14)
    expected, shots = (w.simulate_batch(p, v, LIMIT) for w in (world, shuffled))
    assert np.array_equal(shots.bounces, expected.bounces)
    assert shots.position == pytest.approx(expected.position, abs=1e-10)
    assert (shots.position == expected.position).all(axis=1).mean() > 0.9


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("first", [1, 2])
def test_first_corner_of_a_face_does_not_matter(first: int, impact: str) -> None:
    """Faces that start at another corner change the path by rounding alone."""
    p, v = throws()
    expected = build(impact=impact).simulate_batch(p, v, LIMIT)
    shots = build(lambda body: (body[0], np.roll(body[1], first, axis=1)), impact=impact).simulate_batch(p, v, LIMIT)
    assert np.array_equal(shots.bounces, expected.bounces)
    assert shots.position == pytest.approx(expected.position, abs=1e-8)


def quartered(body: Body) -> Body:
    """Return the body with each face cut into four at the middles of its edges."""
    corners = body[0][body[1]]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts = [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    vertices = np.concatenate(parts).reshape(-1, 3)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def on_lattice(body: Body) -> Body:
    """Return the body with its vertices moved to multiples of 2**-20 m, whose middles are exact."""
    return np.round(body[0] * 2.0**20) / 2.0**20, body[1]


@pytest.mark.parametrize("impact", IMPACTS)
def test_cut_faces_are_the_face(impact: str) -> None:
    """Cutting every face into four, sixteen and sixty-four, without moving a point, changes the path by rounding."""
    p, v = throws()
    expected = build(on_lattice, impact=impact).simulate_batch(p, v, LIMIT)
    cut = on_lattice
    for _ in range(3):
        cut = lambda body, before=cut: quartered(before(body))  # noqa: E731
        shots = build(cut, impact=impact).simulate_batch(p, v, LIMIT)
        assert np.array_equal(shots.bounces, expected.bounces)
        assert shots.position == pytest.approx(expected.position, abs=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_split_path_is_the_path(seed: int) -> None:
    """The first half of a path and then the second meet what the whole meets, where and as steeply as it does."""
    rng = np.random.default_rng(seed)
    world, frame = random_room(rng)
    starts = free_starts(rng, world, frame, 400)
    ends = starts + rng.normal(size=starts.shape) @ frame.T
    middles = 0.5 * (starts + ends)
    whole, first, second = (world.sweep_batch(a, b) for a, b in ((starts, ends), (starts, middles), (middles, ends)))
    met = np.where(first.hit, 0.5 * first.alpha, 0.5 + 0.5 * np.where(second.hit, second.alpha, 1.0))
    hit, normal = first.hit | second.hit, np.where(first.hit[:, None], first.normal, second.normal)
    length = np.linalg.norm(ends - starts, axis=1)
    steep = np.abs(((ends - starts) * whole.normal).sum(axis=1)) / length > 1e-3
    assert np.array_equal(whole.hit[steep], hit[steep])
    assert (np.abs(whole.alpha - met) * length)[steep] == pytest.approx(0.0, abs=1e-9 * world.coordinate_scale)
    assert normal[steep] == pytest.approx(whole.normal[steep], abs=1e-6)
    assert steep.sum() > 50


def test_floor_of_one_triangle_or_many_is_the_floor() -> None:
    """A putt on a floor of 2 or of 20,000 triangles ends at the same place, to the bit on level ground."""
    green = Surface(restitution=0.3, tangential=1.0, rolling=0.05)
    putts = np.array([[x, y, 0.0] for x in (0.5, 1.0) for y in (0.1, -0.7)])
    starts = np.tile([0.01, 0.02, BALL], (4, 1))
    coarse, fine = (World([mesh(grid(8.0, n), green)]).simulate_batch(starts, putts) for n in (1, 100))
    assert same(fine, coarse)


def test_wound_the_other_way_a_two_sided_mesh_is_the_same() -> None:
    """The winding of two-sided faces changes the path by rounding alone."""
    p, v = throws()
    worlds = []
    for step in (1, -1):
        meshes = [TriangleMesh(BODIES[n][0], BODIES[n][1][:, ::step], SURFACES[n], two_sided=True) for n in BODIES]
        worlds.append(World(meshes, gravity=GRAVITY))
    expected, shots = (world.simulate_batch(p, v, LIMIT) for world in worlds)
    assert np.array_equal(shots.bounces, expected.bounces)
    assert shots.position == pytest.approx(expected.position, abs=1e-8)
