"""Argument validation of World: what it refuses, what it accepts, and what its errors say."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from minigolf_env.physics import Surface, TriangleMesh, World, sweep_sphere
from tests.physics.scenes import BALL_RADIUS, box, grid, mesh, room

HALL = mesh(room(2.0), Surface())
NAN, INF = float("nan"), float("inf")
CENTRE = [0.0, 0.0, 1.0]
ZERO_VELOCITY = [0.0, 0.0, 0.0]

BAD_WORLDS = {
    "no mesh": ({"meshes": []}, ["meshes", "at least one TriangleMesh"]),
    "a mesh alone": ({"meshes": HALL}, ["meshes", "World([mesh])"]),
    "not a mesh": ({"meshes": [HALL, "floor"]}, ["meshes", "str"]),
    "nothing": ({"meshes": None}, ["meshes", "TriangleMesh"]),
    "radius zero": ({"ball_radius": 0.0}, ["ball_radius", "> 0", "0.0"]),
    "radius negative": ({"ball_radius": -1}, ["ball_radius", "> 0", "-1"]),
    "radius nan": ({"ball_radius": NAN}, ["ball_radius", "finite", "nan"]),
    "radius text": ({"ball_radius": "small"}, ["ball_radius", "number", "small"]),
    "radius too small to tell": ({"ball_radius": 1e-13}, ["ball_radius", "1e-13"]),
    "gravity flat": ({"gravity": [0, -9.81]}, ["gravity", "(3,)", "(2,)"]),
    "gravity inf": ({"gravity": [0, 0, -INF]}, ["gravity", "finite", "-inf"]),
    "dt zero": ({"dt": 0}, ["dt", "> 0"]),
    "dt negative": ({"dt": -0.01}, ["dt", "> 0", "-0.01"]),
    "dt inf": ({"dt": INF}, ["dt", "finite", "inf"]),
    "impact unknown": ({"impact": "elastic"}, ["impact", "average", "conservative", "elastic"]),
    "impact misspelt": ({"impact": "avrage"}, ["impact", "did you mean 'average'"]),
    "bounds reversed": ({"bounds": [[1, 1, 1], [-1, -1, -1]]}, ["bounds", "lower < upper"]),
    "bounds flat": ({"bounds": [1, 1, 1]}, ["bounds", "(2, 3)", "(3,)"]),
    "bounds nan": ({"bounds": [[NAN, 0, 0], [1, 1, 1]]}, ["bounds", "finite", "nan"]),
}


@pytest.mark.parametrize("fault", BAD_WORLDS)
def test_rejects_bad_worlds_with_expected_and_received_values(fault: str) -> None:
    """The error has the argument, what was expected and what was received."""
    arguments, expected_words = BAD_WORLDS[fault]
    with pytest.raises(ValueError, match=expected_words[0]) as error:
        World(**{"meshes": [HALL], **arguments})
    assert all(word in str(error.value) for word in ["expected", "received", *expected_words])


CALLS: dict[str, Callable[[World, object, object], object]] = {
    "step": lambda world, p, v: world.step(p, v),  # type: ignore[arg-type]
    "simulate": lambda world, p, v: world.simulate(p, v),  # type: ignore[arg-type]
    "simulate_batch": lambda world, p, v: world.simulate_batch([CENTRE, p], [ZERO_VELOCITY, v]),  # type: ignore[list-item]
}
BAD_STATES = {
    "flat position": ([0.0, 0.0], ZERO_VELOCITY, ["position", "expected", "received"]),
    "position nan": ([0.0, NAN, 1.0], ZERO_VELOCITY, ["position", "finite", "nan"]),
    "position text": ("tee", ZERO_VELOCITY, ["position", "expected", "received"]),
    "velocity inf": (CENTRE, [INF, 0.0, 0.0], ["velocit", "finite", "inf"]),
    "velocity missing": (CENTRE, None, ["velocit", "expected", "received"]),
    "in the floor": (
        [0.0, 0.0, 0.5 * BALL_RADIUS],
        ZERO_VELOCITY,
        ["position", "free space", "0.0107 m deep", "0.02135 m"],
    ),
    "in a corner": (
        [1 - BALL_RADIUS, 1 - BALL_RADIUS, 0.9 * BALL_RADIUS],
        ZERO_VELOCITY,
        ["position", "free space", "deep"],
    ),
}


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("fault", BAD_STATES)
def test_rejects_bad_states_with_expected_and_received_values(call: str, fault: str) -> None:
    """Every method that moves the ball refuses an invalid state, and says where and why."""
    p, v, expected_words = BAD_STATES[fault]
    with pytest.raises(ValueError, match="expected") as error:
        CALLS[call](World([HALL]), p, v)
    ragged = call == "simulate_batch" and fault in ("flat position", "position text", "velocity missing")
    assert all(word in str(error.value) for word in (expected_words[:1] if ragged else expected_words))


def test_batch_error_has_the_index_of_the_bad_ball() -> None:
    """The error of a batch counts the balls from 0."""
    with pytest.raises(ValueError, match="position 2"):
        World([HALL]).simulate_batch([CENTRE, CENTRE, [0, 0, 0]], [ZERO_VELOCITY] * 3)


@pytest.mark.parametrize("call", ["simulate_batch", "sweep_batch"])
def test_rejects_batches_of_different_lengths(call: str) -> None:
    """Positions and velocities, and starts and ends, must have the same number of rows."""
    with pytest.raises(ValueError, match=r"expected as many rows as .* 1, received 2"):
        getattr(World([HALL]), call)([CENTRE], [ZERO_VELOCITY, ZERO_VELOCITY])


@pytest.mark.parametrize("max_time", [0.0, -1.0, NAN, INF, "long"])
def test_rejects_bad_time_limits(max_time: object) -> None:
    """A run needs a finite time limit above zero."""
    with pytest.raises(ValueError, match=r"max_time: expected .* received"):
        World([HALL]).simulate(CENTRE, ZERO_VELOCITY, max_time=max_time)  # type: ignore[arg-type]


def test_rejects_time_limits_of_too_many_steps() -> None:
    """A limit of more steps than an integer can count is refused."""
    world = World([mesh(grid(2.0, 1), Surface())])
    for limit in (1e20, 1e300):
        with pytest.raises(ValueError, match="max_time"):
            world.simulate([0, 0, BALL_RADIUS], ZERO_VELOCITY, max_time=limit)


BAD_SWEEPS = {
    "radius": (CENTRE, ZERO_VELOCITY, -0.1, np.zeros((1, 3, 3)), ["radius", "> 0", "-0.1"]),
    "start": ([NAN, 0, 0], ZERO_VELOCITY, 0.1, np.zeros((1, 3, 3)), ["start", "finite", "nan"]),
    "end": (CENTRE, [0, 0], 0.1, np.zeros((1, 3, 3)), ["end", "(3,)", "(2,)"]),
    "triangles": (CENTRE, ZERO_VELOCITY, 0.1, np.zeros((3, 3)), ["triangles", "(N, 3, 3)", "(3, 3)"]),
    "corners": (CENTRE, ZERO_VELOCITY, 0.1, np.full((1, 3, 3), NAN), ["triangles", "finite", "nan"]),
}


@pytest.mark.parametrize("fault", BAD_SWEEPS)
def test_rejects_bad_sweeps(fault: str) -> None:
    """sweep_sphere checks its four arguments, and a world's sweep and clearance theirs."""
    *arguments, expected_words = BAD_SWEEPS[fault]
    with pytest.raises(ValueError, match="expected") as error:
        sweep_sphere(*arguments)  # type: ignore[arg-type]
    assert all(word in str(error.value) for word in expected_words)
    for bad in ([0.0, 0.0], [NAN, 0.0, 0.0], "here"):
        with pytest.raises(ValueError, match="expected"):
            World([HALL]).sweep(bad, CENTRE)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="expected"):
            World([HALL]).clearance(bad)  # type: ignore[arg-type]


def test_calls_do_not_modify_their_arguments() -> None:
    """Neither a refused nor an accepted call writes into the arrays that it was given."""
    world = World([HALL])
    p, v = np.array([CENTRE, [0.0, 0.0, 0.01]]), np.array([[1.0, 2.0, 3.0], ZERO_VELOCITY])
    before = p.copy(), v.copy()
    with pytest.raises(ValueError, match="position 1"):
        world.simulate_batch(p, v)
    world.simulate_batch(p[:1], v[:1])
    world.simulate(p[0], v[0])
    world.step(p[0], v[0])
    assert np.array_equal(p, before[0])
    assert np.array_equal(v, before[1])


def test_empty_batches_give_empty_results() -> None:
    """No balls give no shots, no paths no hits, no points no clearances, and no triangles no hit."""
    world = World([HALL])
    none = np.empty((0, 3))
    shots = world.simulate_batch(none, none)
    hits = world.sweep_batch(none, none)
    assert [len(shots.position), len(shots.status), len(shots.time)] == [0, 0, 0]
    assert [len(hits.hit), len(hits.alpha), hits.normal.shape] == [0, 0, (0, 3)]
    assert world.clearance(none).shape == (0,)
    assert not sweep_sphere(CENTRE, ZERO_VELOCITY, 0.1, np.empty((0, 3, 3))).hit


def test_accepts_lists_integers_and_single_precision() -> None:
    """A state may be a list of integers, a tuple, or a float32 array."""
    world = World([HALL])
    shots = [world.simulate(p, [1, 0, 0], max_time=1) for p in ([0, 0, 1], (0.0, 0.0, 1.0), np.float32([0, 0, 1]))]
    assert all(np.array_equal(shot.position, shots[0].position) for shot in shots)
    assert [type(shots[0].time), type(shots[0].bounces)] == [float, int]


def test_results_for_one_ball_are_python_scalars() -> None:
    """Results for one ball are plain numbers and (3,) arrays of float64."""
    world = World([HALL])
    hit = world.sweep(CENTRE, [0, 0, -1])
    shot = world.simulate(CENTRE, ZERO_VELOCITY, max_time=0.1)
    assert [type(hit.hit), type(hit.alpha), type(hit.triangle)] == [bool, float, int]
    assert [hit.normal.dtype, hit.normal.shape] == [np.float64, (3,)]
    assert type(world.clearance(CENTRE)) is float
    assert [shot.position.shape, shot.velocity.shape] == [(3,), (3,)]


def test_clearance_is_the_distance_less_the_radius() -> None:
    """The clearance is the distance to the nearest triangle less the ball's radius, and negative in contact."""
    world = World([HALL])
    assert world.clearance([0.0, 0.3, 0.5]) == pytest.approx(0.5 - BALL_RADIUS, abs=1e-15)
    assert world.clearance([0.9, 0.0, 1.0]) == pytest.approx(0.1 - BALL_RADIUS, abs=1e-15)
    assert world.clearance([0.0, 0.0, 0.01]) == pytest.approx(0.01 - BALL_RADIUS, abs=1e-15)
    assert world.clearance([[0.0, 0.0, 0.5], [0.0, 0.0, 0.01]]).shape == (2,)


def test_triangle_index_counts_through_all_meshes() -> None:
    """A hit's triangle is an index into the faces of all meshes in the given order."""
    block = box([-0.1, -0.1, 0.0], [0.1, 0.1, 0.1])
    for meshes, first in (([HALL, mesh(block)], 12), ([mesh(block), HALL], 0)):
        triangle = World(meshes).sweep([0.05, 0.0, 1.0], [0.05, 0.0, 0.0]).triangle
        assert np.ptp(block[0][block[1][triangle - first]][:, 2]) == 0.0


def test_each_mesh_has_its_own_surface() -> None:
    """An impact uses the surface of the mesh that is hit."""
    floors = [mesh(grid(1.0, 1), Surface(damping=d)) for d in (0.25, 0.75)]
    apart = TriangleMesh(floors[1].vertices + np.array([2.0, 0, 0]), floors[1].faces, floors[1].surface)
    world = World([floors[0], apart], gravity=(0, 0, 0))
    for x, d in ((0.1, 0.25), (2.1, 0.75)):
        assert world.step([x, 0, BALL_RADIUS + 1e-3], [0, 0, -1])[1] == pytest.approx([0, 0, d], abs=1e-15)


def test_world_is_immutable() -> None:
    """Setting an attribute raises, as the compiled scene would not change; copies and pickles work."""
    world = World([HALL])
    for name in ("dt", "gravity", "meshes", "unknown"):
        with pytest.raises(AttributeError, match=f"World.{name} cannot be set"):
            setattr(world, name, 1.0)
    assert pickle.loads(pickle.dumps(world)).dt == copy.copy(world).dt == world.dt  # noqa: S301 (own data)
