"""Guarantees in any room: no penetration, no escape, no endless step, no NaN, the same bits in a batch."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from minigolf_env.physics import Shot, Status, Surface, World
from tests.physics.scenes import BALL_RADIUS, FloatArray, G, box, free_starts, mesh, random_room, room, rotation


def is_inside(frame: FloatArray, p: FloatArray) -> bool:
    """Return whether all points (N, 3) are in the room that ``frame`` maps the unit cube to."""
    unit = p @ np.linalg.inv(frame).T
    return bool((np.abs(unit[:, :2]) <= 0.5).all() and (unit[:, 2] >= 0.0).all() and (unit[:, 2] <= 1.0).all())


@pytest.mark.parametrize("impact", ["average", "conservative"])
def test_thin_walls_stop_fast_balls(impact: str) -> None:
    """At 30 m/s and dt = 1/60, half a metre a step, no ball passes a wall of 1 cm, of 1 mm or of no thickness."""
    rng = np.random.default_rng(2)
    for thickness in (0.01, 0.001, 0.0):
        rot = rotation(rng)
        half = 0.5 * thickness
        wall = mesh(box([-half, -2, -2], [half, 2, 4]), Surface(damping=0.9), rot, two_sided=thickness == 0.0)
        world = World([mesh(room(2.0), Surface(damping=0.9), rot), wall], dt=1 / 60, impact=impact)
        starts = np.tile(rot @ [0.5, 0.0, 1.0], (100, 1))
        velocities = rng.normal(size=(100, 3))
        velocities *= 30.0 / np.linalg.norm(velocities, axis=1, keepdims=True)
        shots = world.simulate_batch(starts, velocities, max_time=3.0)
        assert (shots.position @ rot[:, 0] >= half + world.ball_radius - 1e-9).all()
        assert shots.exhausted.sum() == 0


@pytest.mark.parametrize("impact", ["average", "conservative"])
def test_extreme_speeds_end_without_penetration(impact: str) -> None:
    """At 1e6 m/s with dt = 1 s steps may lose time, but end with finite numbers, in the room and outside its walls."""
    rng = np.random.default_rng(3)
    for speed in (1e3, 1e6):
        rot = rotation(rng)
        bodies = [room(2.0), box([-0.3, -0.3, 0.2], [0.3, 0.3, 0.5])]
        world = World([mesh(b, Surface(damping=rng.random()), rot) for b in bodies], dt=1.0, impact=impact)
        for _ in range(20):
            v = rng.normal(size=3)
            shot = world.simulate(rot @ [0.6, 0.6, 1.2], speed * v / np.linalg.norm(v), max_time=20.0, record=True)
            assert world.clearance(shot.path).min() >= -1e-12 * world.coordinate_scale
            assert is_inside(2.0 * rot, shot.path)
            assert np.isfinite(shot.velocity).all()


def test_ball_rests_in_a_slot_of_its_width_and_on_a_narrower_one() -> None:
    """A ball falls to the bottom of a slot of its width and rests on the edges of a narrower one; no time is lost."""
    for gap, low in ((2 * BALL_RADIUS, BALL_RADIUS), (1.9 * BALL_RADIUS, 0.5 + BALL_RADIUS * np.sqrt(1 - 0.95**2))):
        surface = Surface(damping=0.6, restitution=0.3, tangential=1.0)
        walls = [box([gap / 2, -1, 0], [1, 1, 0.5]), box([-1, -1, 0], [-gap / 2, 1, 0.5])]
        world = World([mesh(room(2.0), surface), *(mesh(wall, surface) for wall in walls)])
        shot = world.simulate([0.0, 0.0, 0.7], [0.0, 0.05, 0.0], max_time=60.0)
        assert shot.status == Status.REST
        assert shot.exhausted == 0
        assert shot.position[2] == pytest.approx(low, abs=1e-9)


@pytest.mark.parametrize("damping", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("degrees", [3, 10, 30])
def test_ball_comes_to_rest_in_an_acute_corner(degrees: float, damping: float) -> None:
    """A putt into the acute corner of two vertical walls on a green ends at rest, and loses no time."""
    angle = np.radians(degrees)
    corner = np.array([[0, 0], [3, 0], [3 * np.cos(angle), 3 * np.sin(angle)]])
    vertices = np.array([[x, y, z] for z in (-0.1, 0.5) for x, y in corner])
    walls = (vertices, np.array([[0, 3, 4], [0, 4, 1], [0, 2, 5], [0, 5, 3]]))
    floor = mesh(box([-1, -1, -1], [4, 4, 0]), Surface(damping=0.5, rolling=0.05))
    world = World([floor, mesh(walls, Surface(damping=damping))])
    middle = np.array([np.cos(angle / 2), np.sin(angle / 2), 0.0])
    for speed in (0.5, 1.0, 3.0):
        for offset in (0.0, 0.01, 0.2):
            start = 2.5 * middle + [0, 0, BALL_RADIUS]
            direction = -middle + offset * np.sin(angle / 2) * np.array([-middle[1], middle[0], 0.0])
            shot = world.simulate(start, speed * direction, max_time=60.0)
            assert (shot.status, shot.exhausted) == (Status.REST, 0)


def is_equal_to_run(shots: Shot, i: int, shot: Shot) -> bool:
    """Return whether row i of a batch equals a single run, bit for bit."""
    names = ("position", "velocity", "status", "time", "bounces", "exhausted")
    return all(np.array_equal(getattr(shots, name)[i], getattr(shot, name)) for name in names)


@pytest.mark.parametrize("count", [1, 2, 7, 33])
def test_batch_equals_single_calls_bitwise_on_any_number_of_threads(count: int) -> None:
    """simulate_batch, sweep_batch and clearance equal one call after another, on one thread and on all."""
    rng = np.random.default_rng(count)
    world, frame = random_room(rng, gravity=(0, 0, -G))
    starts = free_starts(rng, world, frame, 200)[:count]
    velocities = rng.uniform(-3, 3, starts.shape)
    single = [world.simulate(p, v, max_time=2.0) for p, v in zip(starts, velocities)]
    sweeps = [world.sweep(p, p + v) for p, v in zip(starts, velocities)]
    threads = numba.get_num_threads()
    try:
        for n in {1, threads}:
            numba.set_num_threads(n)
            shots = world.simulate_batch(starts, velocities, max_time=2.0)
            assert all(is_equal_to_run(shots, i, shot) for i, shot in enumerate(single))
            hits = world.sweep_batch(starts, starts + velocities)
            for i, hit in enumerate(sweeps):
                assert (hits.hit[i], hits.alpha[i], hits.triangle[i]) == (hit.hit, hit.alpha, hit.triangle)
                assert np.array_equal(hits.normal[i], hit.normal)
            assert np.array_equal(world.clearance(starts), [world.clearance(p) for p in starts])
    finally:
        numba.set_num_threads(threads)
    assert len(starts) == count


def test_start_is_refused_exactly_where_the_clearance_is_below_the_tolerance() -> None:
    """The fast overlap test of starting positions agrees with the clearance, down to the tolerance itself."""
    world = World([mesh(room(2.0)), mesh(box([-0.5, -0.5, 0.0], [0.5, 0.5, 0.3]))])
    tolerance = 1e-12 * world.coordinate_scale
    for depth in (-1e-3, 0.0, 0.4 * tolerance, 0.9 * tolerance, 1.1 * tolerance, 2.0 * tolerance, 1e-6, 0.02):
        position = np.array([0.1, 0.2, 0.3 + world.ball_radius - depth])
        refused = world.clearance(position) < -tolerance
        assert refused == (depth > tolerance)
        for count in (1, 100):
            starts = np.tile([0.9, 0.9, 1.0], (count, 1))
            starts[-1] = position
            if refused:
                with pytest.raises(ValueError, match=f"position {count - 1}: expected a ball in free space"):
                    world.simulate_batch(starts, np.zeros((count, 3)), max_time=0.01)
            else:
                world.simulate_batch(starts, np.zeros((count, 3)), max_time=0.01)


def test_batches_do_not_start_openmp() -> None:
    """Numba's threading layer stays unused: started, it would overrule torch.set_num_threads(1)."""
    code = """
import numba, numpy as np
from minigolf_env.courses import load_course
world = load_course("room").world()
world.simulate_batch(np.tile([0.0, 0.0, 0.5], (200, 1)), np.ones((200, 3)))
try:
    print(numba.threading_layer())
except ValueError:
    print("none")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "none\n"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_forked_child_starts_its_own_threads() -> None:
    """The thread pool does not survive a fork; the child starts another and gets the same bits."""
    code = """
import os, numba, numpy as np
from minigolf_env.courses import load_course
numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
world, rng = load_course("room").world(), np.random.default_rng(0)
starts, velocities = np.tile([0.0, 0.0, 0.5], (200, 1)), rng.normal(size=(200, 3))
before = world.simulate_batch(starts, velocities).position
child = os.fork()
if child == 0:
    os._exit(0 if (world.simulate_batch(starts, velocities).position == before).all() else 1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout == "0\n", done.stderr


def test_runs_are_independent() -> None:
    """A world keeps no state between runs: the same shot gives the same bits after any other."""
    rng = np.random.default_rng(5)
    world, frame = random_room(rng)
    p, q = free_starts(rng, world, frame, 100)[:2]
    first = world.simulate(p, [1.0, 2.0, 3.0], max_time=2.0, record=True)
    world.simulate(q, [-3.0, 1.0, 0.0], max_time=2.0)
    again = world.simulate(p, [1.0, 2.0, 3.0], max_time=2.0, record=True)
    assert np.array_equal(first.path, again.path)
    assert np.array_equal(first.impacts, again.impacts)
