"""Balls that roll on in lanes do what ``step`` does, bit for bit, and those that may do anything else do not."""

import math

import numpy as np
import pytest
from trimesh.remesh import subdivide

from minigolf_env.physics import Surface, TriangleMesh, World
from minigolf_env.physics.rolling_batch import MAX_FLAT_RUN_STEPS, SIMD_WIDTH, step_rolling, try_enter
from minigolf_env.physics.step import Balls, Scratch, new_scratch, simulate_range, step
from minigolf_env.physics.types import RESULT_DTYPE, Status, Vec3
from tests.physics.scenes import BALL, Body, FloatArray, box, inwards, random_surface, rotation, sphere

NO_LOG = np.empty((0, 8))

STEPS = (0.0, 1e-14, 1e-13, 1e-12, 5e-12, 1e-10, 1e-7, 1e-4, 0.01, 0.05)
"""Heights of slabs on the floor, m: from none to far more than the tolerance."""


def floors(rng: np.random.Generator) -> tuple[World, FloatArray, FloatArray]:
    """Return a room with slabs, flush floors and gaps, all of it perhaps turned, and balls on or near its floor."""
    size, felt = rng.choice([0.3, 1.0, 3.0]), random_surface(rng)
    bodies: list[tuple[Body, Surface]] = []
    if rng.random() < 0.4:  # Two floors with a gap between them, or a step, or neither.
        border, gap = rng.uniform(-0.3, 0.3) * size, rng.choice([1e-13, 1e-12, 1e-9, 1e-6, 1e-3, 0.02, 0.1])
        depth = 1.1 * size
        right = [border + gap, -depth, -0.5], [depth, depth, rng.choice([0.0, 0.0, 1e-13, -1e-13, 1e-12, -1e-4])]
        bodies += [(inwards(box([-size, -size, -0.3], [size, size, 1.0])), felt)]
        bodies += [(box([-depth, -depth, -0.5], [border, depth, 0.0]), felt)]
        bodies += [(box(*right), felt if rng.random() < 0.7 else random_surface(rng))]
    else:
        bodies += [(inwards(box([-size, -size, 0.0], [size, size, 1.0])), felt)]
    for _ in range(rng.integers(0, 4)):
        middle, half = rng.uniform(-size, size, 2), rng.uniform(0.02, 0.5, 2) * size
        slab = box([*(middle - half), rng.choice([-0.1, 0.0])], [*(middle + half), rng.choice(STEPS)])
        bodies += [(slab, felt if rng.random() < 0.5 else random_surface(rng))]
    if rng.random() < 0.3:
        bodies += [(sphere([*rng.uniform(-0.5, 0.5, 2) * size, rng.uniform(-0.05, 0.1)], 0.1), felt)]

    turn = rotation(rng) if rng.random() < 0.4 else np.eye(3)
    shift = rng.normal(size=3) * rng.choice([0.0, 0.0, 1.0, 10.0])
    gravity = turn @ [0.0, 0.0, -9.81] * rng.choice([1.0, 1.0, 0.01, 3.0])
    gravity = gravity + 0.3 * rng.normal(size=3) * (rng.random() < 0.3)
    meshes = []
    for body, surface in bodies:
        vertices, faces = body
        for _ in range(rng.integers(0, 3)):
            vertices, faces = subdivide(vertices, faces)
        meshes.append(TriangleMesh(vertices @ turn.T + shift, faces, surface, None if rng.random() < 0.8 else True))
    radius, impact = rng.choice([BALL, 0.005, 0.1]), rng.choice(["average", "conservative"])
    dt = rng.choice([1 / 60, 1 / 120, 1 / 240, 0.05])
    bounds = shift + size * np.array([[-1.0] * 3, [1.0] * 3]) * rng.uniform(0.2, 1.0) if rng.random() < 0.3 else None
    world = World(meshes, ball_radius=radius, gravity=gravity, dt=dt, impact=impact, bounds=bounds)

    places = np.column_stack([rng.uniform(-0.9, 0.9, (16, 2)) * size, np.full(16, radius)])
    places[:, 2] += rng.choice([0.0, 0.0, 0.0, 1e-13, 1e-12, 1e-9, 0.01, 0.2], 16)
    ways = rng.normal(size=(16, 3)) * [1.0, 1.0, 0.0] + rng.choice([0.0, 0.0, 0.1], (16, 1)) * rng.normal(size=(16, 3))
    ways *= np.exp(rng.uniform(math.log(0.01), math.log(rng.choice([8.0, 100.0, 3000.0])), (16, 1)))
    positions = places @ turn.T + shift
    free = world.clearance(positions) > -1e-13 * world.coordinate_scale
    return world, positions[free], (ways @ turn.T)[free]


@pytest.mark.parametrize("first", range(0, 200, 10))
def test_a_batch_is_runs_of_single_steps(first: int) -> None:
    """A recorded run takes each of its steps alone; a batch of the same balls ends with the same bits."""
    for seed in range(first, first + 10):
        world, positions, velocities = floors(np.random.default_rng([7, seed]))
        batch = world.simulate_batch(positions, velocities, 5.0)
        for i in range(len(positions)):
            alone = world.simulate(positions[i], velocities[i], 5.0, record=True)
            assert batch.position[i].tobytes() == alone.position.tobytes()
            assert batch.velocity[i].tobytes() == alone.velocity.tobytes()
            ends = batch.status[i], batch.time[i], batch.bounces[i], batch.exhausted[i]  # type: ignore[index]
            assert ends == (alone.status, alone.time, alone.bounces, alone.exhausted)


def rows_under(world: World, p: FloatArray) -> list[int]:
    """Return the triangles whose plane the ball touches, and which hold its foot."""
    triangles = world.scene.triangles
    height, x, y = (((p - triangles["a"]) * triangles[name]).sum(axis=1) for name in "nuv")
    touched = np.abs(height - world.ball_radius) <= 4.0 * world.scene.eps
    return list(np.flatnonzero(touched & (x > 0.0) & (y > 0.0) & (x + y < 1.0)))


def one_step(world: World, scratch: Scratch, p: FloatArray, v: FloatArray, row: int) -> tuple[bool, bool]:
    """Let a ball enter a lane on a triangle, and roll; return whether it entered, and whether it rolled."""
    lane = scratch.rolling_batch[0]
    k, before = SIMD_WIDTH - 1, (Vec3(*p.tolist()), Vec3(*v.tolist()))
    lane["active"], lane["support"][k] = 0, row
    if not try_enter(world.scene, scratch.cache.traversal, scratch.contacts, scratch.rolling_batch, k, *before):
        return False, False
    lane["steps_left"][k] = 1
    rolled = step_rolling(world.scene, scratch.rolling_batch, SIMD_WIDTH) == 1
    after = lane["p"][:, k].tobytes(), lane["v"][:, k].tobytes()
    if rolled:
        moved = step(world.scene, scratch, *before, NO_LOG, 0, 0.0)
        assert after == (np.array(moved.p).tobytes(), np.array(moved.v).tobytes())
        assert (moved.time_left, moved.resting, moved.bounces, moved.exhausted) == (0.0, False, 0, False)
    else:
        assert after == (np.array(before[0]).tobytes(), np.array(before[1]).tobytes())
    return True, rolled


def test_a_rolled_step_is_a_step() -> None:
    """Of balls that hover or have sunk, rise or fall, by more or less than the tolerance, those that roll do as steps.

    Those that do not stay where they are. The mixture must have many of both.
    """
    entered = rolled = 0
    for seed in range(1000):
        rng = np.random.default_rng([8, seed])
        world, positions, velocities = floors(rng)
        scratch, eps = new_scratch(), world.scene.eps
        for p, v in zip(positions, velocities, strict=True):
            for row in rows_under(world, p)[:1]:
                n = world.scene.triangles[row]["n"]
                height = (p - world.scene.triangles[row]["a"]) @ n
                p = p + n * (world.ball_radius - height + rng.choice([0.0, 0.0, -1.0, -0.6, 0.5, 0.9, 2.0]) * eps)
                v = v - n * (v @ n) * rng.choice([0.0, 1.0]) + n * rng.choice([0.0, 1e-14, -1e-14, 1e-9, -1e-3, 0.1])
                results = one_step(world, scratch, p, v * rng.choice([1.0, 1.0, 1e-6, 1e-13]), row)
                entered, rolled = entered + results[0], rolled + results[1]
    assert rolled > 500
    assert entered - rolled > 500


def test_a_putt_rolls_on_to_the_end_of_what_was_looked_at() -> None:
    """A ball in the middle of a floor rolls on for all of its steps ahead, over seams, and no further."""
    world = World([TriangleMesh(*subdivide(*inwards(box([-5, -5, 0], [5, 5, 1]))))], ball_radius=BALL)
    scratch = new_scratch()
    lane, p, v = scratch.rolling_batch[0], Vec3(-0.1, 0.03, BALL), Vec3(1.0, 0.2, 0.0)
    [row] = rows_under(world, np.array(p))
    lane["support"][0], lane["steps_left"] = row, 10_000
    assert try_enter(world.scene, scratch.cache.traversal, scratch.contacts, scratch.rolling_batch, 0, p, v)
    while step_rolling(world.scene, scratch.rolling_batch, 1):
        moved = step(world.scene, scratch, p, v, NO_LOG, 0, 0.0)
        p, v = moved.p, moved.v
    assert lane["p"][:, 0].tolist() == list(p) and lane["v"][:, 0].tolist() == list(v)
    assert MAX_FLAT_RUN_STEPS <= lane["steps_done"][0] <= 2 * MAX_FLAT_RUN_STEPS


FELT = Surface(0.7)


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("two_sided", [None, True])
@pytest.mark.parametrize("height", [0.0, 1e-14, 3e-12, 1e-9])
def test_level_is_one_plane_of_one_closed_mesh(height: float, two_sided: bool | None, apart: bool) -> None:
    """In the middle of a slab let into the floor a ball rolls on if they are one plane and mesh; at its sides never."""
    floor, slab = box([-4, -4, -0.7], [4, 4, 0]), box([-0.5, -0.5, -0.5], [0.5, 0.5, height])
    both = np.concatenate([floor[0], slab[0]]), np.concatenate([floor[1], slab[1] + len(floor[0])])
    meshes = [TriangleMesh(*body, FELT, two_sided) for body in ([floor, slab] if apart else [both])]
    world = World([TriangleMesh(*inwards(box([-5, -5, -1], [5, 5, 1]))), *meshes], ball_radius=BALL)
    assert 1e-14 < 0.125 * world.scene.eps < 3e-12
    level = height < 1e-12 and two_sided is None and not apart
    for way in (1.0, -1.0):
        assert [enters(world, [0.0, 0.1, BALL], way, row) for row in rows_under(world, np.array([0.0, 0.1, BALL]))] in (
            [level],
            [level, level],
        )
        for x in (0.5 - 1.01 * BALL, 0.5 + 1.01 * BALL):
            rows = rows_under(world, np.array([x, 0.1, BALL]))
            assert not any(enters(world, [x, 0.1, BALL], way, row) for row in rows)


@pytest.mark.parametrize("obstacle", [box([0.0, -0.5, -0.5], [0.5, 0.5, 0.1]), sphere([0.0, 0.0, 0.0], 1e-3)])
def test_what_stands_on_the_floor_is_in_the_way(obstacle: Body) -> None:
    """A ball that nearly touches it does not roll on, wherever it heads; one that is far enough does."""
    world = World([TriangleMesh(*inwards(box([-5, -5, 0], [5, 5, 1])), FELT), TriangleMesh(*obstacle, FELT)])
    r = world.ball_radius
    for way in (1.0, -1.0):
        for x, free in ((-1.01 * r, False), (-3.0 * r, way < 0.0), (-1.0, True)):
            [row] = rows_under(world, np.array([x, 0.05 * r, r]))
            assert enters(world, [x, 0.05 * r, r], way, row) == free


def test_no_ground_no_lane() -> None:
    """A ball beside a table, as high as if it lay on it, does not roll on along the table's plane."""
    meshes = [TriangleMesh(*inwards(box([-5, -5, -1], [5, 5, 1]))), TriangleMesh(*box([-4, -4, -0.5], [0, 4, 0.0]))]
    world = World(meshes, ball_radius=BALL)
    [row] = rows_under(world, np.array([-1.0, 0.1, BALL]))
    for x, there in ((-1.0, True), (3.0 * BALL, False), (1.0, False)):
        assert enters(world, [x, 0.1, BALL], 1.0, row) == there


def test_balls_on_level_ground_find_a_lane() -> None:
    """From a batch's own first steps; bits do not tell whether they did, only the time it takes."""
    floor = inwards(box([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]))
    world = World([TriangleMesh(*floor, Surface(rolling=0.1))], ball_radius=BALL)
    scratch, count = new_scratch(), SIMD_WIDTH
    angles = np.linspace(0.1, 6.0, count)
    velocities = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    balls = Balls(np.tile([0.1, 0.2, BALL], (count, 1)), velocities, np.zeros(count, RESULT_DTYPE))
    simulate_range(0, count, world.scene, scratch, 20, balls, np.empty((0, 4)), NO_LOG)
    assert (scratch.rolling_batch["length"] > 0.0).all()
    assert (world.scene.triangles["a"][scratch.rolling_batch["support"][0], 2] == 0.0).all()


def test_a_lane_ends_at_the_bounds() -> None:
    """Whichever side a ball rolls out of, it is out in the step in which it leaves, as alone."""
    bounds = [[-0.4, -0.3, -1.0], [0.3, 0.4, 1.0]]
    world = World([TriangleMesh(*inwards(box([-5, -5, 0], [5, 5, 1])))], ball_radius=BALL, bounds=bounds)
    ways = np.array([[1.0, 0.1, 0.0], [-1.0, 0.1, 0.0], [0.1, 1.0, 0.0], [0.1, -1.0, 0.0]])
    starts = np.tile([0.0, 0.0, BALL], (4, 1))
    batch = world.simulate_batch(starts, ways)
    for i, way in enumerate(ways):
        alone = world.simulate(starts[i], way, record=True)
        assert alone.status == Status.OUT_OF_BOUNDS
        assert (batch.status[i], batch.time[i]) == (alone.status, alone.time)  # type: ignore[index]


def enters(world: World, p: list[float], way: float, row: int) -> bool:
    """Return whether a ball that rolls on a triangle along x may roll on."""
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
            Vec3(5.0 * way, 0.0, 0.0),
        )
    )
