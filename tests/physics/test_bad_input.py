"""Bad meshes and extreme numbers work or are refused with the argument's name; nothing hangs or becomes NaN."""

from collections.abc import Callable

import numpy as np
import pytest

from minigolf_env.physics import Shot, Status, Surface, TriangleMesh, World, sweep_sphere
from tests.physics.scenes import (
    BALL_RADIUS,
    Body,
    FloatArray,
    G,
    box,
    grid,
    inside_out,
    mesh,
    rotation,
    sphere,
    tetrahedron,
)

IMPACTS = ("average", "conservative")


def room_in(unit: float, **kwargs: object) -> World:
    """Return a room of two units with a sphere in it, in which motion takes as long as in metres."""
    bodies = [inside_out(box([-unit, -unit, 0], [unit, unit, 2 * unit])), sphere([0.4 * unit] * 3, 0.2 * unit)]
    settings = {"ball_radius": 0.02 * unit, "gravity": (0, 0, -G * unit), **kwargs}
    return World([mesh(body, Surface(rolling=0.1)) for body in bodies], **settings)  # type: ignore[arg-type]


def is_sane(world: World, shot: Shot) -> bool:
    """Return whether every number of a run is finite and the ball never penetrated a surface."""
    assert shot.path is not None
    assert shot.times is not None
    assert shot.impacts is not None
    numbers = (shot.position, shot.velocity, shot.path, shot.times, shot.impacts["position"], shot.impacts["normal"])
    finite = all(np.isfinite(array).all() for array in numbers)
    return finite and bool(
        world.clearance(shot.path).min() >= -1e-12 * max(world.coordinate_scale, np.abs(shot.path).max())
    )


def doubled(body: Body) -> Body:
    """Return the body with all faces twice, the second time with reversed winding."""
    return body[0], np.concatenate([body[1], body[1][:, ::-1]])


def with_flipped_faces(body: Body) -> Body:
    """Return the body with the winding of every third face reversed."""
    return body[0], np.where(np.arange(len(body[1]))[:, None] % 3 == 0, body[1][:, ::-1], body[1])


def merge_bodies(*bodies: Body) -> Body:
    """Return the union of the triangles of several bodies."""
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    faces = [faces + first for (_, faces), first in zip(bodies, firsts)]
    return np.concatenate([vertices for vertices, _ in bodies]), np.concatenate(faces)


BLOCK = box([-0.3, -0.3, 0.0], [0.3, 0.3, 0.4])
IRREGULAR_MESHES: dict[str, Body] = {
    "open": (BLOCK[0], BLOCK[1][2:]),
    "one face": (BLOCK[0], BLOCK[1][:1]),
    "every third face turned": with_flipped_faces(BLOCK),
    "all faces twice": doubled(BLOCK),
    "fin on an edge": (np.r_[BLOCK[0], [[0.6, 0.6, 0.8]]], np.r_[BLOCK[1], [[0, 1, 8]]]),
    "two solids on one edge": merge_bodies(BLOCK, box([0.3, 0.3, 0.0], [0.6, 0.6, 0.4])),
    "solids in each other": merge_bodies(BLOCK, box([-0.1, -0.1, 0.1], [0.5, 0.5, 0.7]), tetrahedron([0, 0, 0.4], 0.3)),
    "the same solid twice": merge_bodies(BLOCK, BLOCK),
    "points and segments": (BLOCK[0], np.array([[0, 0, 0], [0, 1, 0], [2, 2, 3], [4, 7, 4]])),
    "repeated vertices": (np.repeat(BLOCK[0], 3, axis=0), 3 * BLOCK[1] + np.arange(3)),
    "unused vertices": (np.r_[BLOCK[0], [[0.9, 0.9, 1.9]] * 5], BLOCK[1]),
    "needles": (
        np.array([[-0.5, 0, 0.2], [0.5, 0, 0.2], [0, 1e-17, 0.2], [0, 1e-9, 0.2]]),
        np.array([[0, 1, 2], [0, 1, 3]]),
    ),
}


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("kind", IRREGULAR_MESHES)
def test_irregular_meshes_are_solid(kind: str, impact: str) -> None:
    """Open, non-manifold, inconsistently wound, overlapping and degenerate meshes keep the ball out."""
    rng = np.random.default_rng(len(kind))
    rot = rotation(rng)
    hall = mesh(inside_out(box([-1, -1, 0], [1, 1, 2])), Surface(0.8), rot)
    world = World(
        [hall, mesh(IRREGULAR_MESHES[kind], Surface(0.8), rot)], gravity=rot @ [0, 0, -G], dt=1 / 60, impact=impact
    )
    num_exhausted = 0
    for _ in range(40):
        p = rot @ rng.uniform([-0.9, -0.9, 0.9], [0.9, 0.9, 1.9])
        shot = world.simulate(p, rng.normal(size=3) * rng.choice([0.1, 3.0, 20.0]), max_time=2.0, record=True)
        assert is_sane(world, shot)
        num_exhausted += shot.exhausted
    assert num_exhausted == 0


def test_self_intersecting_mesh_is_solid_when_two_sided() -> None:
    """A bow tie, one of whose lobes is inside out, keeps the ball out of both lobes if it is two-sided."""
    outline = [[0, 0], [1, 1], [1, 0], [0, 1]]
    vertices = [[x, y, z] for z in (0.0, 1.0) for x, y in outline]
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    faces += [face for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)) for face in ([i, j, j + 4], [i, j + 4, i + 4])]
    assert TriangleMesh(vertices, faces).is_closed
    world = World([TriangleMesh(vertices, faces, two_sided=True)], gravity=(0, 0, 0))
    middle = np.array([0.5, 0.5, 0.5])
    for direction in np.random.default_rng(5).normal(size=(40, 3)):
        start = middle + 2.0 * direction / np.linalg.norm(direction)
        assert is_sane(
            world, world.simulate(start, 3.0 * (middle + 0.2 * direction[::-1] - start), max_time=1.0, record=True)
        )


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e8])
def test_trajectory_does_not_depend_on_the_unit_of_length(unit: float, impact: str) -> None:
    """In rooms from a nanometre to 100,000 km a ball ends at the same position, in the room's unit."""
    starts = np.array([-0.3, -0.2, 0.5])
    directions = np.array([1.0, 2.0, 0.0])
    expected = room_in(1.0, impact=impact).simulate(starts, directions)
    world = room_in(unit, impact=impact)
    shot = world.simulate(unit * starts, unit * directions, record=True)
    assert is_sane(world, shot)
    assert (shot.status, shot.exhausted) == (Status.REST, 0)
    assert shot.position / unit == pytest.approx(expected.position, abs=1e-4)


def test_ball_rests_correctly_far_from_the_origin() -> None:
    """A thousand kilometres from the origin a golf ball rolls and rests, up to the rounding of such coordinates."""
    away = np.array([1e6, -1e6, 0.0])
    vertices, faces = grid(20.0, 8)
    world = World([TriangleMesh(vertices + away, faces, Surface(0.5, 0.2, 1.0))])
    shot = world.simulate(away + np.array([0, 0, BALL_RADIUS]), [1.0, 0.5, 0.0], record=True)
    assert is_sane(world, shot)
    assert shot.status == Status.REST
    assert shot.position - away == pytest.approx([1.14, 0.57, BALL_RADIUS], abs=1e-2)


def test_ball_rests_on_micrometre_gravel_as_on_a_plane() -> None:
    """On gravel of a micrometre a golf ball rests as high as on a plane, to 2 micrometres."""
    rng = np.random.default_rng(1)
    vertices = rng.uniform(-1e-3, 1e-3, (300, 1, 3)) * [1, 1, 0] + rng.uniform(-1e-6, 1e-6, (300, 3, 3))
    gravel = TriangleMesh(vertices.reshape(-1, 3), np.arange(900).reshape(-1, 3), Surface(0.3))
    world = World([gravel, mesh(grid(1.0, 1), Surface(0.3))])
    shot = world.simulate([0, 0, 2 * BALL_RADIUS], [0, 0, 0], record=True)
    assert is_sane(world, shot)
    assert shot.position[2] == pytest.approx(BALL_RADIUS, abs=2e-6)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("speed", [0.0, 5e-324, 1e-300, 1e-20, 1e3, 1e6, 1e12, 1e49])
def test_ball_stays_in_the_room_at_any_speed(speed: float, impact: str) -> None:
    """Runs at 0 to 1e49 m/s end with finite numbers inside the room; up to 1,000 m/s no step loses time."""
    world = room_in(1.0, impact=impact)
    for direction in np.random.default_rng(2).normal(size=(12, 3)):
        shot = world.simulate(
            [-0.5, -0.5, 1.0], speed * direction / np.linalg.norm(direction), max_time=3.0, record=True
        )
        assert is_sane(world, shot)
        assert np.abs(shot.path - [0, 0, 1]).max() <= 1.0
        assert shot.exhausted == 0 or speed > 1e3


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("dt", [1e-9, 1e-6, 0.25, 1.0, 60.0])
def test_ball_stays_in_the_room_with_any_time_step(dt: float, impact: str) -> None:
    """With dt from a nanosecond to a minute the ball stays in the room; small steps agree with free fall."""
    world = room_in(1.0, dt=dt, impact=impact)
    shot = world.simulate([-0.5, -0.5, 1.0], [1.0, 0.3, 0.0], max_time=min(1e4 * dt, 1e3 * dt + 1e-3), record=True)
    assert is_sane(world, shot)
    assert np.abs(shot.path - [0, 0, 1]).max() <= 1.0
    if dt < 1e-3:
        t = shot.time
        assert shot.position == pytest.approx([-0.5 + t, -0.5 + 0.3 * t, 1.0 - 0.5 * G * t * t], abs=1e-11)


OVERFLOWING_CALLS: dict[str, Callable[[], object]] = {
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


@pytest.mark.parametrize("argument", OVERFLOWING_CALLS)
def test_rejects_numbers_that_would_overflow(argument: str) -> None:
    """The error has the argument and the largest number that is allowed."""
    with pytest.raises(ValueError, match=rf"{argument}: expected finite numbers up to 1e\+\d\d, received"):
        OVERFLOWING_CALLS[argument]()


def test_ball_larger_than_the_room() -> None:
    """A ball that fits nowhere in a room is refused there; outside a solid of that size it works."""
    big = room_in(1.0, ball_radius=1.5)
    for p in ([0, 0, 1], [0.9, 0.9, 1.9], [0, 0, 1e-3]):
        with pytest.raises(ValueError, match=r"position: expected a ball in free space.*at least 1.5 m"):
            big.simulate(p, [1, 0, 0])
    world = World([mesh(BLOCK), mesh(grid(100.0, 1))], ball_radius=1.5)
    shot = world.simulate([0.1, 0.05, 3.0], [0, 0, 0], record=True)
    assert is_sane(world, shot)
    assert shot.exhausted == 0


@pytest.mark.parametrize("inside", [True, False])
def test_start_inside_a_solid_is_reported_on_request_and_harmless_otherwise(inside: bool) -> None:
    """In a solid or outside the room check_collision_free raises; a run from there ends with finite numbers."""
    world = World([mesh(inside_out(box([-1, -1, 0], [1, 1, 2])), name="hall"), mesh(BLOCK, name="rock")])
    p: FloatArray = np.array([0.0, 0.0, 0.2 if inside else -1.0])
    with pytest.raises(ValueError, match="inside 'rock'" if inside else "outside 'hall'"):
        world.check_collision_free(p)
    for direction in ([0, 0, 0], [1, 0, 0], [0, 0.1, 5], [0, 0, 1e6]):
        shot = world.simulate(p, direction, max_time=3.0, record=True)
        assert np.isfinite(shot.path).all()
        assert np.isfinite(shot.velocity).all()
        if inside:
            assert np.abs(shot.position - [0, 0, 1]).max() <= 1.0
