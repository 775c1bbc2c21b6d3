"""The rolling batch on flat ground equals the reference step bit for bit, and is entered only where that holds."""

import math

import numpy as np
import pytest
from trimesh.remesh import subdivide

from minigolf_env.physics import Surface, TriangleMesh, World
from minigolf_env.physics.rolling_batch import MAX_FLAT_RUN_STEPS, SIMD_WIDTH, step_rolling, try_enter
from minigolf_env.physics.step import RunBatch, Scratch, new_scratch, simulate_range, step
from minigolf_env.physics.types import RESULT_DTYPE, Status, Vec3
from tests.physics.scenes import BALL_RADIUS, Body, FloatArray, box, inside_out, random_surface, rotation, sphere

NO_LOG = np.empty((0, 8))

SLAB_HEIGHTS = (0.0, 1e-14, 1e-13, 1e-12, 5e-12, 1e-10, 1e-7, 1e-4, 0.01, 0.05)
"""Heights of slabs on the floor, m: from none to far more than the tolerance."""


def random_floor(rng: np.random.Generator) -> tuple[World, FloatArray, FloatArray]:
    """Return a room with slabs, flush floors and gaps, some of them rotated, and balls on or near its floor."""
    size = rng.choice([0.3, 1.0, 3.0])
    floor_surface = random_surface(rng)
    bodies: list[tuple[Body, Surface]] = []
    if rng.random() < 0.4:  # Two floors, with or without a gap and a step between them.
        edge = rng.uniform(-0.3, 0.3) * size
        gap = rng.choice([1e-13, 1e-12, 1e-9, 1e-6, 1e-3, 0.02, 0.1])
        depth = 1.1 * size
        right = [edge + gap, -depth, -0.5], [depth, depth, rng.choice([0.0, 0.0, 1e-13, -1e-13, 1e-12, -1e-4])]
        bodies += [(inside_out(box([-size, -size, -0.3], [size, size, 1.0])), floor_surface)]
        bodies += [(box([-depth, -depth, -0.5], [edge, depth, 0.0]), floor_surface)]
        bodies += [(box(*right), floor_surface if rng.random() < 0.7 else random_surface(rng))]
    else:
        bodies += [(inside_out(box([-size, -size, 0.0], [size, size, 1.0])), floor_surface)]
    for _ in range(rng.integers(0, 4)):
        middle = rng.uniform(-size, size, 2)
        half = rng.uniform(0.02, 0.5, 2) * size
        slab = box([*(middle - half), rng.choice([-0.1, 0.0])], [*(middle + half), rng.choice(SLAB_HEIGHTS)])
        bodies += [(slab, floor_surface if rng.random() < 0.5 else random_surface(rng))]
    if rng.random() < 0.3:
        bodies += [(sphere([*rng.uniform(-0.5, 0.5, 2) * size, rng.uniform(-0.05, 0.1)], 0.1), floor_surface)]

    rot = rotation(rng) if rng.random() < 0.4 else np.eye(3)
    shift = rng.normal(size=3) * rng.choice([0.0, 0.0, 1.0, 10.0])
    gravity = rot @ [0.0, 0.0, -9.81] * rng.choice([1.0, 1.0, 0.01, 3.0])
    gravity = gravity + 0.3 * rng.normal(size=3) * (rng.random() < 0.3)
    meshes = []
    for body, surface in bodies:
        vertices, faces = body
        for _ in range(rng.integers(0, 3)):
            vertices, faces = subdivide(vertices, faces)
        meshes.append(TriangleMesh(vertices @ rot.T + shift, faces, surface, None if rng.random() < 0.8 else True))
    radius = rng.choice([BALL_RADIUS, 0.005, 0.1])
    impact = rng.choice(["average", "conservative"])
    dt = rng.choice([1 / 60, 1 / 120, 1 / 240, 0.05])
    bounds = shift + size * np.array([[-1.0] * 3, [1.0] * 3]) * rng.uniform(0.2, 1.0) if rng.random() < 0.3 else None
    world = World(meshes, ball_radius=radius, gravity=gravity, dt=dt, impact=impact, bounds=bounds)

    places = np.column_stack([rng.uniform(-0.9, 0.9, (16, 2)) * size, np.full(16, radius)])
    places[:, 2] += rng.choice([0.0, 0.0, 0.0, 1e-13, 1e-12, 1e-9, 0.01, 0.2], 16)
    velocities = rng.normal(size=(16, 3)) * [1.0, 1.0, 0.0] + rng.choice([0.0, 0.0, 0.1], (16, 1)) * rng.normal(
        size=(16, 3)
    )
    velocities *= np.exp(rng.uniform(math.log(0.01), math.log(rng.choice([8.0, 100.0, 3000.0])), (16, 1)))
    positions = places @ rot.T + shift
    free = world.clearance(positions) > -1e-13 * world.coordinate_scale
    return world, positions[free], (velocities @ rot.T)[free]


@pytest.mark.parametrize("first", range(0, 200, 10))
def test_batch_equals_recorded_single_runs_bitwise(first: int) -> None:
    """Recorded runs never use the rolling batch; a batch of the same balls ends with the same bits."""
    for seed in range(first, first + 10):
        world, positions, velocities = random_floor(np.random.default_rng([7, seed]))
        batch = world.simulate_batch(positions, velocities, 5.0)
        for i in range(len(positions)):
            single = world.simulate(positions[i], velocities[i], 5.0, record=True)
            assert batch.position[i].tobytes() == single.position.tobytes()
            assert batch.velocity[i].tobytes() == single.velocity.tobytes()
            ends = batch.status[i], batch.time[i], batch.bounces[i], batch.exhausted[i]  # type: ignore[index]
            assert ends == (single.status, single.time, single.bounces, single.exhausted)


def supporting_rows(world: World, p: FloatArray) -> list[int]:
    """Return the triangles that the ball touches within their edges."""
    triangles = world.scene.triangles
    height, x, y = (((p - triangles["a"]) * triangles[name]).sum(axis=1) for name in ("n", "dual_u", "dual_v"))
    touched = np.abs(height - world.ball_radius) <= 4.0 * world.scene.eps
    return list(np.flatnonzero(touched & (x > 0.0) & (y > 0.0) & (x + y < 1.0)))


def try_one_step(world: World, scratch: Scratch, p: FloatArray, v: FloatArray, row: int) -> tuple[bool, bool]:
    """Try to enter the rolling batch and advance one step; return whether the ball entered and whether it advanced.

    A ball that advanced must equal the reference step, one that did not must be unchanged.
    """
    record = scratch.rolling_batch[0]
    k = SIMD_WIDTH - 1
    before = (Vec3(*p.tolist()), Vec3(*v.tolist()))
    record["active"] = 0
    record["support"][k] = row
    if not try_enter(world.scene, scratch.cache.traversal, scratch.contacts, scratch.rolling_batch, k, *before):
        return False, False
    record["max_steps"][k] = 1
    rolled = step_rolling(world.scene, scratch.rolling_batch, SIMD_WIDTH) == 1
    after = record["p"][:, k].tobytes(), record["v"][:, k].tobytes()
    if rolled:
        moved = step(world.scene, scratch, *before, NO_LOG, 0, 0.0)
        assert after == (np.array(moved.p).tobytes(), np.array(moved.v).tobytes())
        assert (moved.time_left, moved.resting, moved.bounces, moved.exhausted) == (0.0, False, 0, False)
    else:
        assert after == (np.array(before[0]).tobytes(), np.array(before[1]).tobytes())
    return True, rolled


def test_rolling_batch_matches_reference_step_bitwise() -> None:
    """Balls hover, sink, rise or fall by more or less than the tolerance: each of its steps equals the reference step.

    Balls that do not advance stay unchanged. The sample must contain many of both.
    """
    entered = rolled = 0
    for seed in range(1000):
        rng = np.random.default_rng([8, seed])
        world, positions, velocities = random_floor(rng)
        scratch = new_scratch()
        eps = world.scene.eps
        for p, v in zip(positions, velocities, strict=True):
            for row in supporting_rows(world, p)[:1]:
                n = world.scene.triangles[row]["n"]
                height = (p - world.scene.triangles[row]["a"]) @ n
                p = p + n * (world.ball_radius - height + rng.choice([0.0, 0.0, -1.0, -0.6, 0.5, 0.9, 2.0]) * eps)
                v = v - n * (v @ n) * rng.choice([0.0, 1.0]) + n * rng.choice([0.0, 1e-14, -1e-14, 1e-9, -1e-3, 0.1])
                results = try_one_step(world, scratch, p, v * rng.choice([1.0, 1.0, 1e-6, 1e-13]), row)
                entered = entered + results[0]
                rolled = rolled + results[1]
    assert rolled > 500
    assert entered - rolled > 500


def test_rolling_batch_covers_the_whole_flat_run_and_no_more() -> None:
    """In the middle of a floor the rolling batch takes all steps of its lookahead, across seams, and then ends."""
    world = World([TriangleMesh(*subdivide(*inside_out(box([-5, -5, 0], [5, 5, 1]))))], ball_radius=BALL_RADIUS)
    scratch = new_scratch()
    record = scratch.rolling_batch[0]
    p = Vec3(-0.1, 0.03, BALL_RADIUS)
    v = Vec3(1.0, 0.2, 0.0)
    [row] = supporting_rows(world, np.array(p))
    record["support"][0] = row
    record["max_steps"] = 10_000
    assert try_enter(world.scene, scratch.cache.traversal, scratch.contacts, scratch.rolling_batch, 0, p, v)
    while step_rolling(world.scene, scratch.rolling_batch, 1):
        moved = step(world.scene, scratch, p, v, NO_LOG, 0, 0.0)
        p, v = moved.p, moved.v
    assert record["p"][:, 0].tolist() == list(p) and record["v"][:, 0].tolist() == list(v)
    assert MAX_FLAT_RUN_STEPS <= record["steps_done"][0] <= 2 * MAX_FLAT_RUN_STEPS


FLOOR_SURFACE = Surface(0.7)


@pytest.mark.parametrize("separate", [False, True])
@pytest.mark.parametrize("two_sided", [None, True])
@pytest.mark.parametrize("height", [0.0, 1e-14, 3e-12, 1e-9])
def test_rolling_batch_needs_one_plane_of_one_closed_mesh(
    height: float, two_sided: bool | None, separate: bool
) -> None:
    """On a slab in the floor a ball enters if both are one plane of one mesh, and never at the slab's sides."""
    floor = box([-4, -4, -0.7], [4, 4, 0])
    slab = box([-0.5, -0.5, -0.5], [0.5, 0.5, height])
    both = np.concatenate([floor[0], slab[0]]), np.concatenate([floor[1], slab[1] + len(floor[0])])
    meshes = [TriangleMesh(*body, FLOOR_SURFACE, two_sided) for body in ([floor, slab] if separate else [both])]
    world = World([TriangleMesh(*inside_out(box([-5, -5, -1], [5, 5, 1]))), *meshes], ball_radius=BALL_RADIUS)
    assert 1e-14 < 0.125 * world.scene.eps < 3e-12
    is_flat = height < 1e-12 and two_sided is None and not separate
    for direction in (1.0, -1.0):
        assert [
            enters_rolling_batch(world, [0.0, 0.1, BALL_RADIUS], direction, row)
            for row in supporting_rows(world, np.array([0.0, 0.1, BALL_RADIUS]))
        ] in (
            [is_flat],
            [is_flat, is_flat],
        )
        for x in (0.5 - 1.01 * BALL_RADIUS, 0.5 + 1.01 * BALL_RADIUS):
            rows = supporting_rows(world, np.array([x, 0.1, BALL_RADIUS]))
            assert not any(enters_rolling_batch(world, [x, 0.1, BALL_RADIUS], direction, row) for row in rows)


@pytest.mark.parametrize("obstacle", [box([0.0, -0.5, -0.5], [0.5, 0.5, 0.1]), sphere([0.0, 0.0, 0.0], 1e-3)])
def test_rolling_batch_is_not_entered_near_an_obstacle(obstacle: Body) -> None:
    """A ball that nearly touches an obstacle does not enter in any direction; a distant one does."""
    world = World(
        [TriangleMesh(*inside_out(box([-5, -5, 0], [5, 5, 1])), FLOOR_SURFACE), TriangleMesh(*obstacle, FLOOR_SURFACE)]
    )
    r = world.ball_radius
    for direction in (1.0, -1.0):
        for x, free in ((-1.01 * r, False), (-3.0 * r, direction < 0.0), (-1.0, True)):
            [row] = supporting_rows(world, np.array([x, 0.05 * r, r]))
            assert enters_rolling_batch(world, [x, 0.05 * r, r], direction, row) == free


def test_rolling_batch_needs_ground_below_the_ball() -> None:
    """A ball next to a table, as high as if it rested on it, does not roll along the table's plane."""
    meshes = [TriangleMesh(*inside_out(box([-5, -5, -1], [5, 5, 1]))), TriangleMesh(*box([-4, -4, -0.5], [0, 4, 0.0]))]
    world = World(meshes, ball_radius=BALL_RADIUS)
    [row] = supporting_rows(world, np.array([-1.0, 0.1, BALL_RADIUS]))
    for x, expected in ((-1.0, True), (3.0 * BALL_RADIUS, False), (1.0, False)):
        assert enters_rolling_batch(world, [x, 0.1, BALL_RADIUS], 1.0, row) == expected


def test_balls_on_flat_ground_enter_the_rolling_batch() -> None:
    """Balls of a batch enter within its first steps; only the run time would reveal that they did not."""
    floor = inside_out(box([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]))
    world = World([TriangleMesh(*floor, Surface(rolling=0.1))], ball_radius=BALL_RADIUS)
    scratch = new_scratch()
    count = SIMD_WIDTH
    angles = np.linspace(0.1, 6.0, count)
    velocities = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    runs = RunBatch(np.tile([0.1, 0.2, BALL_RADIUS], (count, 1)), velocities, np.zeros(count, RESULT_DTYPE))
    simulate_range(0, count, world.scene, scratch, 20, runs, np.empty((0, 4)), NO_LOG)
    assert (scratch.rolling_batch["length"] > 0.0).all()
    assert (world.scene.triangles["a"][scratch.rolling_batch["support"][0], 2] == 0.0).all()


def test_rolling_batch_ends_at_the_bounds() -> None:
    """A ball that rolls out of any side ends in the same step as in a single run."""
    bounds = [[-0.4, -0.3, -1.0], [0.3, 0.4, 1.0]]
    world = World([TriangleMesh(*inside_out(box([-5, -5, 0], [5, 5, 1])))], ball_radius=BALL_RADIUS, bounds=bounds)
    velocities = np.array([[1.0, 0.1, 0.0], [-1.0, 0.1, 0.0], [0.1, 1.0, 0.0], [0.1, -1.0, 0.0]])
    starts = np.tile([0.0, 0.0, BALL_RADIUS], (4, 1))
    batch = world.simulate_batch(starts, velocities)
    for i, direction in enumerate(velocities):
        single = world.simulate(starts[i], direction, record=True)
        assert single.status == Status.OUT_OF_BOUNDS
        assert (batch.status[i], batch.time[i]) == (single.status, single.time)  # type: ignore[index]


def enters_rolling_batch(world: World, p: list[float], direction: float, row: int) -> bool:
    """Return whether a ball that rolls along x on a triangle enters the rolling batch."""
    scratch = new_scratch()
    scratch.rolling_batch[0]["support"][0] = row
    return bool(
        try_enter(
            world.scene,
            scratch.cache.traversal,
            scratch.contacts,
            scratch.rolling_batch,
            0,
            Vec3(*p),
            Vec3(5.0 * direction, 0.0, 0.0),
        )
    )
