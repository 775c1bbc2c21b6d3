"""Queries of a world: one-sided and two-sided meshes, clearance, and the inside of solids."""

import math

import numpy as np
import pytest

from minigolf_env.physics import Surface, TriangleMesh, World
from tests.physics.scenes import (
    BALL_RADIUS,
    FloatArray,
    box,
    cone,
    floor_with_hole,
    free_starts,
    grid,
    inside_out,
    mesh,
    random_room,
    room,
    sphere,
    tetrahedron,
)

SOLIDS = {
    "box": box([-0.5, -0.3, -0.2], [0.4, 0.6, 0.3]),
    "sphere": sphere([0.1, 0.0, 0.0], 0.5, 7, 5),
    "needle": cone([0.0, 0.0, -0.5], 0.2, 1.5),
    "tetrahedron": tetrahedron([0.0, 0.0, 0.0], 0.7),
}


def test_closed_meshes_are_not_hit_from_behind() -> None:
    """A sphere that leaves a solid, or enters a room from outside, hits nothing; in the other direction it does."""
    solid = World([mesh(box([-1, -1, -1], [1, 1, 1]))])
    hall = World([mesh(inside_out(box([-1, -1, -1], [1, 1, 1])))])
    inside, outside = [0.1, 0.2, 0.3], [3.0, 0.2, 0.3]
    assert not solid.sweep(inside, outside).hit
    assert solid.sweep(outside, inside).alpha == pytest.approx((2.0 - BALL_RADIUS) / 2.9, abs=1e-12)
    assert not hall.sweep(outside, inside).hit
    assert hall.sweep(inside, outside).alpha == pytest.approx((0.9 - BALL_RADIUS) / 2.9, abs=1e-12)


@pytest.mark.parametrize("two_sided", [None, True])
def test_open_meshes_are_hit_from_both_sides(two_sided: bool | None) -> None:
    """An open mesh, or a two-sided one, stops a ball from above and from below."""
    world = World([mesh(grid(2.0, 2), two_sided=two_sided)])
    for z in (1.0, -1.0):
        hit = world.sweep([0.1, 0.2, z], [0.1, 0.2, -z])
        assert hit.alpha == pytest.approx(0.5 * (1 - BALL_RADIUS), abs=1e-12)
        assert hit.normal.tolist() == [0, 0, z]


@pytest.mark.parametrize("seed", range(8))
def test_clearance_is_zero_at_the_hit_and_positive_before(seed: int) -> None:
    """A free path has no negative clearance, and at the hit the clearance is zero."""
    rng = np.random.default_rng(seed)
    world, frame = random_room(rng)
    for start in free_starts(rng, world, frame, 20):
        end = start + frame @ rng.uniform(-1, 1, 3)
        hit = world.sweep(start, end)
        path = start + np.linspace(0, hit.alpha, 50)[:, None] * (end - start)
        assert world.clearance(path).min() >= -1e-12 * world.coordinate_scale
        if hit.hit:
            assert world.clearance(path[-1]) == pytest.approx(0.0, abs=1e-11)
            touched = path[-1] - world.ball_radius * hit.normal
            corners = np.concatenate([body.triangles for body in world.meshes])[hit.triangle]
            triangle_world = World([TriangleMesh(corners, [[0, 1, 2]])], ball_radius=world.ball_radius)
            assert triangle_world.clearance(touched) == pytest.approx(-world.ball_radius, abs=1e-6)


def points_near(kind: str, inside: bool, rng: np.random.Generator) -> FloatArray:
    """Return points near the faces, edges and corners of a solid, on one side of it."""
    vertices, faces = SOLIDS[kind]
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    middle = vertices.mean(axis=0)
    features = np.concatenate([corners.mean(axis=1), corners[:, :2].mean(axis=1), corners[:, 0]])
    fraction = rng.uniform(0.02, 0.9, (len(features), 1))
    # All solids are convex: towards the middle is inside, away from it outside.
    return middle + (features - middle) * ((1 - fraction) if inside else (1 + fraction))


@pytest.mark.parametrize("kind", SOLIDS)
def test_free_space_is_outside_solids_and_inside_rooms(kind: str) -> None:
    """Near faces, edges, corners and centres check_collision_free refuses a ball in a solid or outside the room."""
    solid = World([mesh(SOLIDS[kind], name="rock")], ball_radius=1e-6)
    hall = World([mesh(inside_out(SOLIDS[kind]), name="hall")], ball_radius=1e-6)
    for free, blocked, inside in ((solid, hall, False), (hall, solid, True)):
        for p in points_near(kind, inside, np.random.default_rng(6)):
            assert np.array_equal(free.check_collision_free(p), p)
            with pytest.raises(ValueError, match=r"inside 'rock'|outside 'hall'"):
                blocked.check_collision_free(p)
    with pytest.raises(ValueError, match="inside 'rock'"):
        solid.check_collision_free(SOLIDS[kind][0].mean(axis=0))


def test_solids_may_touch_and_overlap() -> None:
    """Blocks next to each other, stacked or overlapping leave exactly the space around them free."""
    blocks = [box([-0.5, -0.5, 0], [0, 0.5, 0.4]), box([0, -0.5, 0], [0.5, 0.5, 0.4])]
    blocks += [box([-0.2, -0.2, 0.4], [0.2, 0.2, 0.6]), box([0.3, 0.3, -0.2], [0.7, 0.7, 0.5])]
    world = World([mesh(room(2.0)), *(mesh(block) for block in blocks)])
    points = np.random.default_rng(4).uniform([-0.9, -0.9, 0.1], [0.9, 0.9, 0.8], (300, 3))
    for p in points[world.clearance(points) > 0]:
        if any(((p > vertices.min(axis=0)) & (p < vertices.max(axis=0))).all() for vertices, _ in blocks):
            with pytest.raises(ValueError, match="inside"):
                world.check_collision_free(p)
        else:
            assert np.array_equal(world.check_collision_free(p), p)


@pytest.mark.parametrize(("offset", "speed"), [(0.0, 1.313), (0.2, 1.269), (0.4, 1.121), (0.5, 0.987), (0.6, 0.716)])
def test_hole_captures_a_ball_below_the_free_fall_speed(offset: float, speed: float) -> None:
    """A ball that crosses a hole below the speed at which it falls by its radius in flight drops in."""
    hole = 0.054
    r = BALL_RADIUS
    g = 9.81
    flight = math.sqrt(hole**2 * (1 - offset**2)) + math.sqrt((hole - r) ** 2 - (offset * hole) ** 2)
    limit = flight * math.sqrt(g / (2 * r))
    assert limit == pytest.approx(speed, abs=1.5e-3)
    world = World([mesh(floor_with_hole(0.054), Surface(restitution=0.3, tangential=1.0, rolling=0.0))])
    for fraction in (0.3, 0.7, 0.98):
        shot = world.simulate([-0.2, offset * hole, r], [fraction * limit, 0, 0], max_time=5.0)
        assert shot.position[2] < -r


def test_hole_lets_fast_balls_pass() -> None:
    """Twice the free-fall speed carries a ball across the hole, and a ball that misses it rolls past."""
    world = World([mesh(floor_with_hole(0.054), Surface(restitution=0.3, tangential=1.0, rolling=0.0))])
    for y, speed in ((0.0, 2 * 1.313), (0.054 + BALL_RADIUS, 0.5), (0.2, 0.5)):
        shot = world.simulate([-0.2, y, BALL_RADIUS], [speed, 0, 0], max_time=1.0)
        assert shot.position[2] > 0.0
        assert shot.position[0] > 0.2
