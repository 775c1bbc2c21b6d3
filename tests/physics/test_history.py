"""A query depends only on its arguments: not on earlier queries, the batch or the use of the world."""

from collections.abc import Callable

import numpy as np
import pytest

from minigolf_env.physics import Hit, Shot, Surface, World, sweep_sphere
from tests.physics.scenes import BALL_RADIUS, FloatArray, free_starts, grid, mesh, random_room

MAX_TIME = 1.5
SEEDS = range(6)


def scene(seed: int, count: int) -> tuple[World, FloatArray, FloatArray]:
    """Return a random room, or every third time an uneven green, and positions and velocities of balls in it."""
    rng = np.random.default_rng(seed)
    if seed % 3 == 2:
        green = mesh(grid(4.0, 60, rng.uniform(-1e-4, 1e-4, (61, 61))), Surface(0.5, 0.2, 1.0))
        v = rng.uniform(-1.5, 1.5, (count, 3)) * [1, 1, 0]
        return World([green]), np.c_[rng.uniform(-1, 1, (count, 2)), np.full(count, BALL_RADIUS + 2e-4)], v
    world, frame = random_room(rng)
    p = free_starts(rng, world, frame, 4 * count)[:count]
    return world, p, rng.normal(size=p.shape) * rng.choice([0.01, 1.0, 10.0], (len(p), 1))


def rebuilt(world: World) -> World:
    """Return the same world, built again and never used."""
    return World(world.meshes, world.ball_radius, world.gravity, world.dt, world.impact)


def to_bytes(record: Hit | Shot, i: int | None = None) -> bytes:
    """Return a result, or row i of a batch of results, as bytes."""
    fields = [np.asarray(value) for value in record if value is not None]
    return b"".join((x if i is None else x[i]).astype(np.float64).tobytes() for x in fields)


@pytest.mark.parametrize("seed", SEEDS)
def test_order_of_a_batch_does_not_matter(seed: int) -> None:
    """A batch reversed, shuffled, thinned out or with repeated rows gives each ball the same bits."""
    world, p, v = scene(seed, 24)
    n = len(p)
    rng = np.random.default_rng(seed)
    shots = world.simulate_batch(p, v, MAX_TIME)
    hits = world.sweep_batch(p, p + v)
    for order in (np.arange(n)[::-1], rng.permutation(n), np.arange(0, n, 3), np.zeros(9, int)):
        permuted = world.simulate_batch(p[order], v[order], MAX_TIME)
        permuted_hits = world.sweep_batch(p[order], (p + v)[order])
        assert [to_bytes(permuted, k) for k in range(len(order))] == [to_bytes(shots, i) for i in order]
        assert [to_bytes(permuted_hits, k) for k in range(len(order))] == [to_bytes(hits, i) for i in order]


@pytest.mark.parametrize("seed", SEEDS)
def test_run_equals_steps_in_unused_worlds_bitwise(seed: int) -> None:
    """The result of simulate, and each point of its path, is that of step in worlds that were never used."""
    world, p, v = scene(seed, 2)
    for x, u in zip(p, v):
        shot = world.simulate(x, u, max_time=60 * world.dt, record=True)
        assert shot.path is not None
        path = [x]
        for _ in range(len(shot.path) - 1):
            x, u = rebuilt(world).step(x, u)
            path.append(x)
        assert np.array_equal(shot.path, path)
        assert np.array_equal(shot.velocity, u)


@pytest.mark.parametrize("seed", SEEDS)
def test_run_resumed_from_its_end_equals_the_whole_run(seed: int) -> None:
    """Two runs, the second from where the first ended, equal one run of both durations."""
    world, p, v = scene(seed, 24)
    for steps in (1, 7, 60):
        first = world.simulate_batch(p, v, steps * world.dt)
        second = world.simulate_batch(first.position, first.velocity, 50 * world.dt)
        whole = world.simulate_batch(p, v, (steps + 50) * world.dt)
        assert np.array_equal(second.position, whole.position)
        assert np.array_equal(second.velocity, whole.velocity)


OTHER_CALLS: dict[str, Callable[[World, FloatArray, FloatArray], object]] = {
    "sweeps nearby": lambda world, p, v: world.sweep_batch(p + 1e-6, p + 1e-6 + v),
    "sweeps of no length": lambda world, p, v: world.sweep_batch(p, p),
    "sweeps from far": lambda world, p, v: world.sweep_batch(1e3 * p, p),
    "runs elsewhere": lambda world, p, v: world.simulate_batch(p[::-1], -v, MAX_TIME),
    "a run with a record": lambda world, p, v: world.simulate(p[0], v[-1], MAX_TIME, record=True),
    "clearances": lambda world, p, v: world.clearance(p + 0.1),
    "steps": lambda world, p, v: [world.step(x, u) for x, u in zip(p, v)],
    "another world": lambda world, p, v: World([mesh(grid(4.0, 3), Surface())]).simulate([0, 0, 1], [1, 0, 0]),
}


@pytest.mark.parametrize("call", OTHER_CALLS)
def test_results_do_not_depend_on_earlier_calls(call: str) -> None:
    """Steps, sweeps, clearances and runs give the same bits after any other call, and in an unused world."""
    for seed in SEEDS:
        world, p, v = scene(seed, 8)

        def answers(world: World, p: FloatArray = p, v: FloatArray = v) -> list[bytes]:
            steps = [np.concatenate(world.step(x, u)).tobytes() for x, u in zip(p, v)]
            sweeps = [to_bytes(world.sweep(x, x + u)) for x, u in zip(p, v)]
            return [*steps, *sweeps, world.clearance(p).tobytes(), to_bytes(world.simulate(p[-1], v[-1], MAX_TIME))]

        before = answers(world)
        OTHER_CALLS[call](world, p, v)
        assert answers(world) == before
        assert answers(rebuilt(world)) == before


@pytest.mark.parametrize("seed", [seed for seed in range(18) if seed % 3 < 2])
def test_world_sweep_equals_brute_force_over_front_faces(seed: int) -> None:
    """World.sweep among one-sided and two-sided meshes equals sweep_sphere on all but the back faces, bit for bit."""
    world, p, v = scene(seed, 40)
    corners = np.concatenate([body.triangles for body in world.meshes])
    one_sided = np.repeat([not body.two_sided for body in world.meshes], [len(body.faces) for body in world.meshes])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    num_hits = 0
    for start, displacement in zip(p, v):
        displacement = displacement / np.linalg.norm(displacement) * 0.5 * world.coordinate_scale
        across = normals @ displacement
        if np.abs(start + displacement).max() > world.coordinate_scale:
            continue  # The tolerance of sweep_sphere depends on the path, too.
        if (one_sided & (np.abs(across) <= 1e-9 * np.linalg.norm(normals, axis=1) * world.coordinate_scale)).any():
            continue  # Rounding decides whether this path hits a back face.
        front = np.flatnonzero(~one_sided | (across < 0.0))
        hit = world.sweep(start, start + displacement)
        brute_force = sweep_sphere(start, start + displacement, world.ball_radius, corners[front])
        assert (hit.hit, hit.alpha, hit.normal.tolist()) == (
            brute_force.hit,
            brute_force.alpha,
            brute_force.normal.tolist(),
        )
        assert hit.triangle == (front[brute_force.triangle] if brute_force.hit else -1)
        num_hits += hit.hit
    assert num_hits > 0
