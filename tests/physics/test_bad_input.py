"""Bad meshes and absurd numbers: they work, or are refused by name. Nothing hangs, nothing is NaN."""

from collections.abc import Callable

import numpy as np
import pytest

from minigolf_env.physics import Shot, Status, Surface, TriangleMesh, World, sweep_sphere
from tests.physics.scenes import BALL, Body, FloatArray, G, box, grid, inwards, mesh, rotation, sphere, tetrahedron

IMPACTS = ("average", "conservative")


def room_in(unit: float, **kwargs: object) -> World:
    """Return a room of two units with a globe in it, in which a second looks as it does in metres."""
    bodies = [inwards(box([-unit, -unit, 0], [unit, unit, 2 * unit])), sphere([0.4 * unit] * 3, 0.2 * unit)]
    settings = {"ball_radius": 0.02 * unit, "gravity": (0, 0, -G * unit), **kwargs}
    return World([mesh(body, Surface(rolling=0.1)) for body in bodies], **settings)  # type: ignore[arg-type]


def sane(world: World, shot: Shot) -> bool:
    """Return whether every number of a run is finite and the ball was never in a surface."""
    assert shot.path is not None
    assert shot.times is not None
    assert shot.impacts is not None
    numbers = (shot.position, shot.velocity, shot.path, shot.times, shot.impacts["position"], shot.impacts["normal"])
    finite = all(np.isfinite(array).all() for array in numbers)
    return finite and bool(
        world.clearance(shot.path).min() >= -1e-12 * max(world.coordinate_scale, np.abs(shot.path).max())
    )


def doubled(body: Body) -> Body:
    """Return the body with all faces twice, the second time the other way round."""
    return body[0], np.concatenate([body[1], body[1][:, ::-1]])


def flipped(body: Body) -> Body:
    """Return the body with every third face turned."""
    return body[0], np.where(np.arange(len(body[1]))[:, None] % 3 == 0, body[1][:, ::-1], body[1])


def joined(*bodies: Body) -> Body:
    """Return one body of several."""
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    faces = [faces + first for (_, faces), first in zip(bodies, firsts)]
    return np.concatenate([vertices for vertices, _ in bodies]), np.concatenate(faces)


BLOCK = box([-0.3, -0.3, 0.0], [0.3, 0.3, 0.4])
ODD: dict[str, Body] = {
    "open": (BLOCK[0], BLOCK[1][2:]),
    "one face": (BLOCK[0], BLOCK[1][:1]),
    "every third face turned": flipped(BLOCK),
    "all faces twice": doubled(BLOCK),
    "fin on an edge": (np.r_[BLOCK[0], [[0.6, 0.6, 0.8]]], np.r_[BLOCK[1], [[0, 1, 8]]]),
    "two solids on one edge": joined(BLOCK, box([0.3, 0.3, 0.0], [0.6, 0.6, 0.4])),
    "solids in each other": joined(BLOCK, box([-0.1, -0.1, 0.1], [0.5, 0.5, 0.7]), tetrahedron([0, 0, 0.4], 0.3)),
    "the same solid twice": joined(BLOCK, BLOCK),
    "points and segments": (BLOCK[0], np.array([[0, 0, 0], [0, 1, 0], [2, 2, 3], [4, 7, 4]])),
    "repeated vertices": (np.repeat(BLOCK[0], 3, axis=0), 3 * BLOCK[1] + np.arange(3)),
    "unused vertices": (np.r_[BLOCK[0], [[0.9, 0.9, 1.9]] * 5], BLOCK[1]),
    "needles": (
        np.array([[-0.5, 0, 0.2], [0.5, 0, 0.2], [0, 1e-17, 0.2], [0, 1e-9, 0.2]]),
        np.array([[0, 1, 2], [0, 1, 3]]),
    ),
}


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("kind", ODD)
def test_odd_meshes_keep_the_ball_out(kind: str, impact: str) -> None:
    """Open, non-manifold, inconsistently wound, overlapping and degenerate meshes are as solid as any other."""
    rng = np.random.default_rng(len(kind))
    turn = rotation(rng)
    hall = mesh(inwards(box([-1, -1, 0], [1, 1, 2])), Surface(0.8), turn)
    world = World([hall, mesh(ODD[kind], Surface(0.8), turn)], gravity=turn @ [0, 0, -G], dt=1 / 60, impact=impact)
    lost = 0
    for _ in range(40):
        p = turn @ rng.uniform([-0.9, -0.9, 0.9], [0.9, 0.9, 1.9])
        shot = world.simulate(p, rng.normal(size=3) * rng.choice([0.1, 3.0, 20.0]), max_time=2.0, record=True)
        assert sane(world, shot)
        lost += shot.exhausted
    assert lost == 0


def test_mesh_that_crosses_itself_is_solid_when_two_sided() -> None:
    """A bow tie, of whose two lobes one is inside out, keeps the ball out of both if it is made two-sided."""
    outline = [[0, 0], [1, 1], [1, 0], [0, 1]]
    vertices = [[x, y, z] for z in (0.0, 1.0) for x, y in outline]
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    faces += [face for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)) for face in ([i, j, j + 4], [i, j + 4, i + 4])]
    assert TriangleMesh(vertices, faces).is_closed
    world = World([TriangleMesh(vertices, faces, two_sided=True)], gravity=(0, 0, 0))
    middle = np.array([0.5, 0.5, 0.5])
    for way in np.random.default_rng(5).normal(size=(40, 3)):
        start = middle + 2.0 * way / np.linalg.norm(way)
        assert sane(world, world.simulate(start, 3.0 * (middle + 0.2 * way[::-1] - start), max_time=1.0, record=True))


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e8])
def test_rooms_of_any_size_work_alike(unit: float, impact: str) -> None:
    """In rooms from a nanometre to 100,000 km a ball takes the same way, in their unit."""
    starts, ways = np.array([-0.3, -0.2, 0.5]), np.array([1.0, 2.0, 0.0])
    expected = room_in(1.0, impact=impact).simulate(starts, ways)
    world = room_in(unit, impact=impact)
    shot = world.simulate(unit * starts, unit * ways, record=True)
    assert sane(world, shot)
    assert (shot.status, shot.exhausted) == (Status.REST, 0)
    assert shot.position / unit == pytest.approx(expected.position, abs=1e-4)


def test_golf_far_from_the_origin() -> None:
    """A thousand kilometres from the origin a golf ball rolls and rests, to the accuracy of numbers of that size."""
    away = np.array([1e6, -1e6, 0.0])
    vertices, faces = grid(20.0, 8)
    world = World([TriangleMesh(vertices + away, faces, Surface(0.5, 0.2, 1.0))])
    shot = world.simulate(away + np.array([0, 0, BALL]), [1.0, 0.5, 0.0], record=True)
    assert sane(world, shot)
    assert shot.status == Status.REST
    assert shot.position - away == pytest.approx([1.14, 0.57, BALL], abs=1e-2)


def test_golf_ball_among_micrometres() -> None:
    """On gravel of a micrometre a golf ball lies as on the plane it amounts to."""
    rng = np.random.default_rng(1)
    vertices = rng.uniform(-1e-3, 1e-3, (300, 1, 3)) * [1, 1, 0] + rng.uniform(-1e-6, 1e-6, (300, 3, 3))
    gravel = TriangleMesh(vertices.reshape(-1, 3), np.arange(900).reshape(-1, 3), Surface(0.3))
    world = World([gravel, mesh(grid(1.0, 1), Surface(0.3))])
    shot = world.simulate([0, 0, 2 * BALL], [0, 0, 0], record=True)
    assert sane(world, shot)
    assert shot.position[2] == pytest.approx(BALL, abs=2e-6)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("speed", [0.0, 5e-324, 1e-300, 1e-20, 1e6, 1e12, 1e49])
def test_any_speed_ends_inside_the_room(speed: float, impact: str) -> None:
    """From 0 to 1e49 m/s runs end, finite, in the room; what is gentle loses no time."""
    world = room_in(1.0, impact=impact)
    for way in np.random.default_rng(2).normal(size=(12, 3)):
        shot = world.simulate([-0.5, -0.5, 1.0], speed * way / np.linalg.norm(way), max_time=3.0, record=True)
        assert sane(world, shot)
        assert np.abs(shot.path - [0, 0, 1]).max() <= 1.0
        assert shot.exhausted == 0 or speed > 1e3


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("dt", [1e-9, 1e-6, 0.25, 1.0, 60.0])
def test_any_time_step_works(dt: float, impact: str) -> None:
    """From a nanosecond to a minute a step keeps the ball in the room, and small ones agree with free fall."""
    world = room_in(1.0, dt=dt, impact=impact)
    shot = world.simulate([-0.5, -0.5, 1.0], [1.0, 0.3, 0.0], max_time=min(1e4 * dt, 1e3 * dt + 1e-3), record=True)
    assert sane(world, shot)
    assert np.abs(shot.path - [0, 0, 1]).max() <= 1.0
    if dt < 1e-3:
        t = shot.time
        assert shot.position == pytest.approx([-0.5 + t, -0.5 + 0.3 * t, 1.0 - 0.5 * G * t * t], abs=1e-11)


HUGE: dict[str, Callable[[], object]] = {
    "ball_radius": lambda: room_in(1.0, ball_radius=1e51),
    "gravity": lambda: room_in(1.0, gravity=(0, 0, -1e300)),
    "dt": lambda: room_in(1.0, dt=1e300),
    "velocity": lambda: room_in(1.0).simulate([0, 0, 1], [1e200, 0, 0]),
    "velocities": lambda: room_in(1.0).simulate_batch([[0, 0, 1]], [[0, -1e200, 0]]),
    "position": lambda: room_in(1.0).clearance([1e300, 0, 0]),
    "end": lambda: room_in(1.0).sweep([0, 0, 1], [1e300, 0, 0]),
    "start": lambda: sweep_sphere([0, 0, 1e300], [0, 0, 0], 1.0, np.zeros((1, 3, 3))),
    "rock: vertices": lambda: TriangleMesh(5e9 * BLOCK[0], BLOCK[1], name="rock"),
}


@pytest.mark.parametrize("what", HUGE)
def test_numbers_that_would_overflow_are_refused(what: str) -> None:
    """Where products would leave float64 and a ball its room, the argument and the largest number are named."""
    with pytest.raises(ValueError, match=rf"{what}: expected finite numbers up to 1e\+\d\d, received"):
        HUGE[what]()


def test_ball_larger_than_the_room_is_refused_in_it_and_works_beside_it() -> None:
    """Nowhere in a room is there a place for a larger ball; outside of a solid of that size there is."""
    big = room_in(1.0, ball_radius=1.5)
    for p in ([0, 0, 1], [0.9, 0.9, 1.9], [0, 0, 1e-3]):
        with pytest.raises(ValueError, match=r"position: expected a ball in free space.*at least 1.5 m"):
            big.simulate(p, [1, 0, 0])
    world = World([mesh(BLOCK), mesh(grid(100.0, 1))], ball_radius=1.5)
    shot = world.simulate([0.1, 0.05, 3.0], [0, 0, 0], record=True)
    assert sane(world, shot)
    assert shot.exhausted == 0


@pytest.mark.parametrize("inside", [True, False])
def test_start_on_the_wrong_side_is_named_when_asked_and_harmless_when_not(inside: bool) -> None:
    """In a solid or outside the room check_collision_free refuses the ball; a run has finite numbers and ends."""
    world = World([mesh(inwards(box([-1, -1, 0], [1, 1, 2])), name="hall"), mesh(BLOCK, name="rock")])
    p: FloatArray = np.array([0.0, 0.0, 0.2 if inside else -1.0])
    with pytest.raises(ValueError, match="inside 'rock'" if inside else "outside 'hall'"):
        world.check_collision_free(p)
    for way in ([0, 0, 0], [1, 0, 0], [0, 0.1, 5], [0, 0, 1e6]):
        shot = world.simulate(p, way, max_time=3.0, record=True)
        assert np.isfinite(shot.path).all()
        assert np.isfinite(shot.velocity).all()
        if inside:
            assert np.abs(shot.position - [0, 0, 1]).max() <= 1.0
