"""The default hole and the room: closed, playable, with no way out; and validation of courses."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity
import trimesh
from numpy.typing import NDArray

from minigolf_env.courses import Course, CourseError, Cup, Part, Tee, list_courses, load_course
from minigolf_env.physics import Shot, Status, TriangleMesh, World

COURSE_NAMES = ["dogleg", "room"]
LANE_OUTLINE = shapely.Polygon(
    [(0, 0), (3, 0), (4, 1), (4, 2.1), (3.6, 2.5), (3.15, 2.5), (2.75, 2.1), (2.75, 1.25), (0, 1.25)]
)
BLOCK_OUTLINE = shapely.affinity.rotate(shapely.box(1.7, 0.545, 2.1, 0.705), -30.0)
BOLLARD_POSITION = (3.3, 1.5)
CUP_POSITION = (3.45, 2.1, 0.0)
MAX_FLIGHT_HEIGHT = 0.12
"""Height of borders and obstacles, m: none of 50,000 balls putted at the cup from nearby flew so high."""

PART_PARAMS = [
    pytest.param(part, id=f"{name}-{part.name}") for name in COURSE_NAMES for part in load_course(name).parts
]
BALL_RADIUS = load_course("dogleg").ball_radius

FloatArray = NDArray[np.float64]


@pytest.fixture(scope="module")
def dogleg() -> Course:
    """Return the default hole."""
    return load_course("dogleg")


@pytest.fixture(scope="module")
def world(dogleg: Course) -> World:
    """Return its physics."""
    return dogleg.world()


@pytest.fixture
def rng() -> np.random.Generator:
    """Return the same random numbers for every test."""
    return np.random.default_rng(0)


def sample_tee(course: Course, n: int, rng: np.random.Generator) -> FloatArray:
    """Return n random starts (n, 3) from the tee, its corners first."""
    lower, upper = np.array(course.tee.lower), np.array(course.tee.upper)
    fractions = np.concatenate([[[0, 0], [0, 1], [1, 0], [1, 1]], rng.random((n - 4, 2))])
    return np.column_stack([lower + fractions * (upper - lower), np.full(n, course.tee.height + course.ball_radius)])


def sample_floor(n: int, rng: np.random.Generator) -> FloatArray:
    """Return n random ball positions (n, 3) on the dogleg's felt."""
    blocked = [BLOCK_OUTLINE, shapely.Point(BOLLARD_POSITION).buffer(0.12), shapely.Point(CUP_POSITION).buffer(0.06)]
    clear = (LANE_OUTLINE - shapely.union_all(blocked)).buffer(-1.01 * BALL_RADIUS)
    points = rng.uniform((0.0, 0.0), (4.0, 2.5), (4 * n, 2))
    points = points[shapely.contains_xy(clear, points)][:n]
    return np.column_stack([points, np.full(n, BALL_RADIUS)])


def putts(angles: FloatArray, speeds: FloatArray) -> FloatArray:
    """Return horizontal velocities (n, 3)."""
    return np.column_stack([speeds * np.cos(angles), speeds * np.sin(angles), np.zeros_like(speeds)])


def in_cup(course: Course, shot: Shot) -> NDArray[np.bool_]:
    """Return whether balls rest in the cup, below its rim."""
    assert course.cup is not None
    offset = np.asarray(shot.position) - course.cup.position
    inside = np.hypot(offset[..., 0], offset[..., 1]) < course.cup.radius
    return np.asarray((np.asarray(shot.status) == Status.REST) & inside & (offset[..., 2] < 0.0))


@pytest.mark.parametrize("part", PART_PARAMS)
def test_parts_are_closed_and_wound_towards_ball(part: Part) -> None:
    """Meshes are watertight and wound outwards, or inwards if the ball is inside."""
    solid = trimesh.Trimesh(part.mesh.vertices, part.mesh.faces)
    assert solid.is_watertight and solid.is_winding_consistent
    assert (solid.volume < 0.0) == (part.name == "room")
    assert abs(solid.volume) > 1e-5
    assert part.mesh.is_closed and not part.mesh.two_sided


@pytest.mark.parametrize("name", COURSE_NAMES)
def test_ball_on_tee_overlaps_no_surface(name: str, rng: np.random.Generator) -> None:
    """No start is inside a surface; on a hole every start is in contact with the floor."""
    course = load_course(name)
    world = course.world()
    clearance = world.clearance(sample_tee(course, 200, rng))
    assert clearance.min() >= -1e-12 * world.coordinate_scale
    if course.cup is not None:
        assert clearance.max() <= 1e-12 * world.coordinate_scale


def test_no_straight_putt_reaches_cup(dogleg: Course, world: World, rng: np.random.Generator) -> None:
    """From every start an upright wall blocks the straight line to the cup."""
    starts = sample_tee(dogleg, 200, rng)
    starts[:, 2] += 0.001  # Off the felt, which would be hit first.
    ends = np.broadcast_to([*CUP_POSITION[:2], starts[0, 2]], starts.shape)
    hits = world.sweep_batch(starts, ends)
    assert np.all(hits.hit)
    assert np.allclose(hits.normal[:, 2], 0.0)


def test_hole_in_one_exists_from_corners_and_middle_of_tee(dogleg: Course, world: World) -> None:
    """A coarse search finds putts that bank into the cup."""
    angles, speeds = np.meshgrid(np.linspace(-np.pi, np.pi, 180), np.linspace(3.0, dogleg.top_speed, 10))
    velocities = putts(angles.ravel(), speeds.ravel())
    for x, y in (dogleg.tee.lower, dogleg.tee.centre, dogleg.tee.upper):
        shots = world.simulate_batch(np.broadcast_to([x, y, BALL_RADIUS], velocities.shape), velocities)
        assert in_cup(dogleg, shots).any(), f"no hole in one from {(x, y)}"


def test_putts_end_on_lane_or_in_cup(dogleg: Course, world: World, rng: np.random.Generator) -> None:
    """From anywhere at any speed, no ball leaves the lane, sinks, gets stuck on an edge or rolls for ever."""
    starts = np.concatenate([sample_tee(dogleg, 300, rng), sample_floor(300, rng)])
    n = len(starts)
    shots = world.simulate_batch(starts, putts(rng.uniform(-np.pi, np.pi, n), rng.uniform(0.0, dogleg.top_speed, n)))
    assert n == 600 and np.all(shots.status == Status.REST)
    assert not np.any(shots.exhausted)
    assert world.clearance(shots.position).min() >= -1e-12 * world.coordinate_scale
    assert shapely.contains_xy(LANE_OUTLINE.buffer(-0.99 * BALL_RADIUS), shots.position[:, :2]).all()
    on_felt = np.abs(shots.position[:, 2] - BALL_RADIUS) <= 1e-9
    assert (on_felt | in_cup(dogleg, shots)).all()


def test_balls_thrown_up_by_rim_stay_below_border_top(dogleg: Course, rng: np.random.Generator) -> None:
    """Putts at the cup from nearby, at any speed, never fly as high as the border."""
    lower, upper = np.array(dogleg.bounds)
    upper[2] = MAX_FLIGHT_HEIGHT + BALL_RADIUS
    low_sky = World([part.mesh for part in dogleg.parts], bounds=[lower, upper])
    around = rng.uniform(-np.pi, np.pi, 500)
    distance = rng.uniform(0.1, 0.3, 500)
    starts = np.array(CUP_POSITION) + putts(around, distance) + [0.0, 0.0, BALL_RADIUS]
    velocities = putts(around + np.pi + rng.uniform(-0.3, 0.3, 500), rng.uniform(0.0, dogleg.top_speed, 500))
    assert np.all(low_sky.simulate_batch(starts, velocities).status == Status.REST)


def test_dogleg_file_builds_golden_meshes_bitwise(dogleg: Course) -> None:
    """The meshes have the bits on which the golden trajectories were recorded."""
    with np.load(Path(__file__).parents[1] / "data" / "golden_dogleg.npz") as data:
        assert {part.name for part in dogleg.parts} == {key.split(".")[0] for key in data}
        for part in dogleg.parts:
            assert np.array_equal(part.mesh.vertices, data[f"{part.name}.vertices"])
            assert np.array_equal(part.mesh.faces, data[f"{part.name}.faces"])


def test_ball_dropped_over_cup_rests_on_its_bottom(dogleg: Course, world: World) -> None:
    """A dropped ball comes to rest in the cup."""
    assert dogleg.cup is not None
    shot = world.simulate((*dogleg.cup.position[:2], 0.2), (0.0, 0.0, 0.0))
    assert in_cup(dogleg, shot)
    assert shot.position[2] == pytest.approx(BALL_RADIUS - dogleg.cup.depth)


@pytest.mark.parametrize(("speed", "captured"), [(0.3, True), (1.2, True), (2.5, False)])
def test_cup_captures_slow_balls_only(dogleg: Course, world: World, speed: float, captured: bool) -> None:
    """Along its centre line free fall alone captures below 1.31 m/s (docs/physics.md); a fast ball crosses the cup."""
    x, y, _ = CUP_POSITION
    braking = 2.0 * dogleg.parts[0].mesh.surface.rolling * 9.81 * (0.3 - Cup.radius)
    shot = world.simulate((x, y - 0.3, BALL_RADIUS), (0.0, np.sqrt(speed**2 + braking), 0.0))
    assert in_cup(dogleg, shot) == captured


@pytest.mark.parametrize("radius", [0.03, 0.054, 0.1])
def test_cup_is_open_up_to_its_radius(radius: float) -> None:
    """The whole circle is free; just beyond it, at the middle of a side, the wall begins."""
    course = load_course("dogleg", cup_radius=radius)
    world = course.world()
    assert course.cup is not None and course.cup.radius == radius
    angles = np.arange(128) * (np.pi / 64)  # Corners and middles of 64 sides.
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(128)])
    middle = np.array(course.cup.position) - [0.0, 0.0, 0.05]
    assert world.clearance(middle + (radius - BALL_RADIUS) * ring).min() >= -1e-12 * world.coordinate_scale
    assert world.clearance(middle + (radius - BALL_RADIUS + 1e-6) * ring)[1::2].max() < 0.0


@pytest.mark.parametrize("impact", ["average", "conservative"])
def test_thrown_balls_stay_in_room(impact: str, rng: np.random.Generator) -> None:
    """Thrown in any direction, they bounce between the meshes and never enter one or leave."""
    course = load_course("room")
    world = course.world(impact=impact)
    directions = rng.normal(size=(100, 3))
    velocities = directions * (course.top_speed / np.linalg.norm(directions, axis=1, keepdims=True))
    shots = world.simulate_batch(sample_tee(course, 100, rng), velocities, max_time=10.0)
    assert not np.any(shots.status == Status.OUT_OF_BOUNDS) and not np.any(shots.exhausted)
    assert world.clearance(shots.position).min() >= -1e-12 * world.coordinate_scale
    assert np.mean(shots.bounces) > 5.0
    if impact == "conservative":
        assert np.all(shots.status == Status.REST)


def test_courses_load_by_name() -> None:
    """The room can be loaded too; the same request returns the same course."""
    assert "dogleg" in list_courses() and "room" not in list_courses()
    assert load_course("dogleg") is load_course("dogleg") is load_course(Path("dogleg"))
    assert load_course(load_course("room")) is load_course("room")
    assert load_course("room").cup is None


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({"name": "dog-leg"}, r"expected one of .*, received 'dog-leg'; did you mean 'dogleg'\?"),
        ({"name": "procedural"}, r"names all levels; name one of them, such as 'procedural-v1-easy-17'"),
        ({"name": "windmill"}, "expected one of 'straight', 'dogleg', .*'room', received 'windmill'"),
        ({"name": "holes/nine.toml"}, "expected a course file, received 'holes/nine.toml', which does not exist"),
        ({"name": "nine.glb"}, "expected a course file, received 'nine.glb'"),
        ({"name": "dogleg", "cup_radius": -0.1}, "cup_radius: expected a number > 0, received -0.1"),
        ({"name": "dogleg", "cup_radius": "wide"}, "cup_radius: expected numbers"),
        ({"name": "dogleg", "cup_radius": 0.02}, "expected more than the ball's radius, 0.02135 m, received 0.02"),
        ({"name": "dogleg", "cup_radius": 0.5}, r"cup radius: expected less than 0\.\d+ m, received 0.5"),
        ({"name": "room", "cup_radius": 0.05}, "'room', which has no cup"),
        ({"name": load_course("dogleg"), "cup_radius": 0.07}, "already cut"),
    ],
)
def test_invalid_requests_name_expected_and_received_value(request_: dict[str, Any], message: str) -> None:
    """Unknown names, missing files and cup radii that do not fit are errors."""
    with pytest.raises(CourseError, match=message):
        load_course(**request_)


OPEN_MESH = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parts": ()}, "parts: expected at least one"),
        ({"top_speed": 0.0}, "top_speed"),
        ({"ball_radius": 0.06}, "cup radius: expected more than the ball's radius"),
        ({"gravity": (0.0, -9.81)}, "gravity"),
        ({"gravity": (0.0, 0.0, 0.0)}, "gravity: expected one that pulls down"),
        ({"par": 0}, "par: expected an integer >= 1"),
        ({"cup": None}, "expected None and \\(\\) without cup"),
        ({"route": ()}, "route"),
        ({"route": ((0.0, 0.0), CUP_POSITION[:2])}, "route: expected points from the tee's centre to the cup"),
        ({"bounds": ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))}, "expected a ball within the bounds"),
        ({"bounds": ((0.0, 0.0, -np.inf), (4.0, 4.0, 1.0))}, "bounds: expected finite numbers"),
    ],
)
def test_rejects_invalid_course_field(dogleg: Course, change: dict[str, Any], message: str) -> None:
    """Every message names the course and the field."""
    with pytest.raises(CourseError, match=f"course 'dogleg': .*{message}"):
        dataclasses.replace(dogleg, **change)


def test_rejects_invalid_cup_tee_and_part() -> None:
    """Cups, tees and parts validate themselves."""
    with pytest.raises(CourseError, match="cup: radius"):
        Cup((0.0, 0.0, 0.0), radius=-1.0)
    with pytest.raises(CourseError, match="tee: expected lower <= upper"):
        Tee((1.0, 0.0), (0.0, 0.0), 0.0)
    with pytest.raises(CourseError, match="part 'sail': mesh: expected a closed, one-sided"):
        Part("sail", OPEN_MESH, "wood")
    with pytest.raises(CourseError, match=r"part 'floor': material: expected one of .* did you mean 'felt'"):
        Part("floor", load_course("dogleg").parts[0].mesh, "fellt")  # type: ignore[arg-type]


def test_rejects_tee_inside_surface(dogleg: Course) -> None:
    """The overlap is found when the world is made."""
    sunk = dataclasses.replace(dogleg, tee=dataclasses.replace(dogleg.tee, height=-0.01))
    with pytest.raises(CourseError, match=r"course 'dogleg': .*m deep in a surface"):
        sunk.world()


def test_importing_courses_loads_no_mesh_library() -> None:
    """A fresh interpreter imports the package of courses without trimesh, shapely and pydantic."""
    code = "import sys, minigolf_env.courses as c; c.list_courses(); "
    code += "print({'trimesh', 'shapely', 'pydantic'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
