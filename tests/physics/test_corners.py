"""At corners, grooves, wedges, pits, crests and seams no time is lost and no ball penetrates or gains speed."""

import math

import numpy as np
import pytest

from minigolf_env.physics import Shot, Status, Surface, TriangleMesh, World
from tests.physics.scenes import BALL_RADIUS, Body, FloatArray, G, box, cone, grid, groove, inside_out, mesh, rotation

IMPACTS = ("average", "conservative")
GREEN = Surface(damping=0.5, restitution=0.2, tangential=1.0, rolling=0.05)


def checked_run(world: World, p: FloatArray, v: FloatArray, max_time: float = 60.0) -> Shot:
    """Return the recorded run after checking that no step penetrated a surface or lost time."""
    shot = world.simulate(p, v, max_time, record=True)
    assert shot.path is not None
    assert world.clearance(shot.path).min() >= -1e-12 * world.coordinate_scale
    assert shot.exhausted == 0
    return shot


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("damping", [0.0, 0.5, 0.8])
@pytest.mark.parametrize("seed", range(4))
def test_ball_rests_in_the_corner_of_a_room(seed: int, damping: float, impact: str) -> None:
    """With gravity into a corner of three walls a moving ball comes to rest in contact with all three."""
    rng = np.random.default_rng(seed)
    rot = rotation(rng)
    world = World(
        [mesh(inside_out(box([0, 0, 0], [1, 1, 1])), Surface(damping, rolling=0.02), rot)],
        gravity=rot @ -rng.uniform(2, 8, 3),
        impact=impact,
    )
    shot = checked_run(world, rot @ rng.uniform(0.1, 0.9, 3), rot @ rng.normal(size=3))
    assert shot.status == Status.REST
    assert rot.T @ shot.position == pytest.approx([BALL_RADIUS] * 3, abs=1e-9)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("degrees", [(20, 70), (5, 60), (45, 80), (1, 89)])
def test_ball_rests_in_an_asymmetric_groove(degrees: tuple[float, float], impact: str) -> None:
    """Between planes of different slopes a dropped ball rests on both, or on one where rolling resistance holds it."""
    left, right = np.radians(degrees)
    rot = rotation(np.random.default_rng(1))
    corners = [[0, -9, 0], [0, 9, 0]]
    corners += [[9 * math.cos(right), y, 9 * math.sin(right)] for y in (-9, 9)]
    corners += [[-9 * math.cos(left), y, 9 * math.sin(left)] for y in (-9, 9)]
    planes = np.array(corners), np.array([[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4]])
    world = World([mesh(planes, Surface(0.5, rolling=0.05), rot)], gravity=rot @ [0, 0, -G], impact=impact)
    normals = np.array([[math.sin(left), 0, math.cos(left)], [-math.sin(right), 0, math.cos(right)]])
    for x in (-0.3, -0.1, -0.03):
        shot = checked_run(world, rot @ [x, 0.0, 1.0], rot @ [0.1, 0.2, 0.0])
        place = rot.T @ shot.position
        assert shot.status == Status.REST
        assert normals[0] @ place == pytest.approx(BALL_RADIUS, abs=1e-9)
        if math.tan(left) > 0.05:  # Otherwise rolling resistance holds the ball.
            assert normals[1] @ place == pytest.approx(BALL_RADIUS, abs=1e-9)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("damping", [0.0, 0.7, 1.0])
@pytest.mark.parametrize("degrees", [1, 5, 20, 60])
def test_wedge_returns_or_holds_a_ball(degrees: float, damping: float, impact: str) -> None:
    """Under a ceiling that meets the floor a ball of any speed gets as far as it fits, and no time is lost."""
    angle = math.radians(degrees)
    floor = mesh(grid(40.0, 1), Surface(0.5, tangential=1.0, rolling=0.05))
    x, y, z = 19.0, 10.0, 19.0 * math.tan(angle)
    ceiling = TriangleMesh([[0, -y, 0], [0, y, 0], [x, y, z], [x, -y, z]], [[0, 1, 2], [0, 2, 3]], Surface(damping))
    world = World([floor, ceiling], impact=impact)
    fits = BALL_RADIUS / math.tan(angle / 2)
    for speed in (0.5, 3.0, 30.0):
        for offset in (0.0, 0.01, 1.0):
            shot = checked_run(
                world, np.array([fits + 1.0, 0.0, BALL_RADIUS]), speed * np.array([-1.0, offset, 0.0]), 5.0
            )
            assert shot.path is not None
            assert shot.path[:, 0].min() >= fits - 1e-9


def pit(side: float, sides: int) -> Body:
    """Return a level surface with a shaft, a regular prism, whose walls are ``side`` from its axis."""
    angles = 2 * np.pi * np.arange(sides) / sides
    rim = np.c_[np.cos(angles), np.sin(angles), np.zeros(sides)] * side / math.cos(math.pi / sides)
    k = np.arange(sides)
    after = (k + 1) % sides
    vertices = np.concatenate([rim, rim - [0, 0, 1], 10 * rim])
    walls = np.r_[np.c_[k, k + sides, after + sides], np.c_[k, after + sides, after]]
    top = np.r_[np.c_[k, after + 2 * sides, k + 2 * sides], np.c_[k, after, after + 2 * sides]]
    return vertices, np.concatenate([walls, top])


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("fraction", [0.3, 0.9, 1.0 - 1e-6])
@pytest.mark.parametrize("sides", [3, 4, 6])
def test_ball_rests_on_the_rim_of_a_narrower_pit(sides: int, fraction: float, impact: str) -> None:
    """Dropped near the middle of a pit whose inscribed circle is smaller than the ball, it rests on all edges."""
    rot = rotation(np.random.default_rng(sides))
    world = World([mesh(pit(fraction * BALL_RADIUS, sides), GREEN, rot)], gravity=rot @ [0, 0, -G], impact=impact)
    shot = checked_run(world, rot @ [1e-4, 2e-4, 1.01 * BALL_RADIUS], np.zeros(3))
    assert shot.status == Status.REST
    assert rot.T @ shot.position == pytest.approx([0, 0, BALL_RADIUS * math.sqrt(1 - fraction**2)], abs=1e-7)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("feature", ["edge", "vertex", "inner edge", "inner vertex", "seam", "needle"])
def test_ball_dropped_exactly_on_a_feature_bounces_straight_up(feature: str, impact: str) -> None:
    """A ball that lands exactly on a horizontal edge, a vertex or a seam rises with e times its speed."""
    surface = Surface(damping=0.5, rolling=0.05)
    bodies = {
        "edge": (np.array([[-1, 0, 0], [1, 0, 0], [0, 1, -1], [0, -1, -1]], float), np.array([[0, 1, 2], [1, 0, 3]])),
        "vertex": cone([0, 0, -1], 0.5, 1.0),
        "inner edge": groove(0.0),
        "inner vertex": grid(1.0, 2),
        "seam": grid(1.0, 1),
        "needle": cone([0, 0, -1], 1e-9, 1.0),
    }
    world = World([mesh(bodies[feature], surface)], gravity=(0, 0, 0), impact=impact)
    shot = checked_run(world, np.array([0.0, 0.0, BALL_RADIUS + 1 / 240]), np.array([0.0, 0.0, -1.0]), 1 / 120)
    assert shot.bounces == 1
    assert shot.velocity == pytest.approx([0, 0, 0.5], abs=1e-14)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("degrees", [0.001, 0.1, 1.0, 10.0])
def test_ball_rolling_over_a_crest_keeps_its_energy(degrees: float, impact: str) -> None:
    """Over a convex crease a slow ball follows the other side and a fast one flies straight on."""
    angle = math.radians(degrees)
    x = 5 * math.cos(angle)
    z = -5 * math.sin(angle)
    corners = [[-5, -5, 0], [0, -5, 0], [x, -5, z], [-5, 5, 0], [0, 5, 0], [x, 5, z]]
    smooth = Surface(restitution=0.0, tangential=1.0, rolling=0.0)
    world = World([TriangleMesh(corners, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]], smooth)], impact=impact)
    for speed in (0.05, 0.5, 5.0):
        shot = checked_run(world, np.array([-0.01, 0.0, BALL_RADIUS]), np.array([speed, 0.1, 0.0]), 0.5)
        gained = 0.5 * shot.velocity @ shot.velocity + G * (shot.position[2] - BALL_RADIUS)
        assert shot.bounces == 0
        assert gained <= 0.5 * (speed**2 + 0.01) * (1 + 1e-9) + 1e-12
        assert shot.velocity[1] == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("degrees", [0.001, 0.1, 1.0, 10.0])
def test_ball_rolling_into_a_crease_loses_only_its_normal_velocity(degrees: float, impact: str) -> None:
    """At a concave crease with e = 0 and t = 1 a ball loses the part of its velocity into the slope, and only that."""
    angle = math.radians(degrees)
    x = 50 * math.cos(angle)
    z = 50 * math.sin(angle)
    corners = [[-5, -50, 0], [0, -50, 0], [x, -50, z], [-5, 50, 0], [0, 50, 0], [x, 50, z]]
    smooth = Surface(restitution=0.0, tangential=1.0, rolling=0.0)
    world = World([TriangleMesh(corners, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]], smooth)], impact=impact)
    shot = checked_run(world, np.array([-0.5, 0.0, BALL_RADIUS]), np.array([4.0, 1.0, 0.0]), 0.25)
    climbed = shot.position[2] - BALL_RADIUS / math.cos(angle) - math.tan(angle) * shot.position[0]
    assert climbed == pytest.approx(0.0, abs=1e-9)
    energy = 0.5 * shot.velocity @ shot.velocity + G * (shot.position[2] - BALL_RADIUS)
    assert energy == pytest.approx(0.5 * ((4.0 * math.cos(angle)) ** 2 + 1.0), rel=1e-6)


@pytest.mark.parametrize("impact", IMPACTS)
@pytest.mark.parametrize("rotated", [False, True])
def test_rolling_on_jittered_coplanar_triangles_is_rolling_on_a_plane(rotated: bool, impact: str) -> None:
    """Over the seams of 3,200 jittered triangles a ball with any restitution stays within 1e-13 m of the plane."""
    rng = np.random.default_rng(12)
    rot = rotation(rng) if rotated else np.eye(3)
    vertices, faces = grid(2.0, 40)
    vertices[:, :2] += rng.uniform(-0.02, 0.02, (len(vertices), 2))
    for surface in (GREEN, Surface(damping=0.7, rolling=0.05), Surface(damping=1.0, rolling=0.05)):
        world = World([mesh((vertices, faces), surface, rot)], gravity=rot @ [0, 0, -G], impact=impact)
        for v in ([0.9, 0.0, 0], [0.6, 0.65, 0], [-0.3, 0.8, 0]):
            start = rot @ [-0.2, 0.1, BALL_RADIUS]
            shot = checked_run(world, start, rot @ v)
            assert (shot.status, shot.bounces) == (Status.REST, 0)
            assert np.abs((shot.path - start) @ (rot @ [0, 0, 1])).max() <= 1e-13
