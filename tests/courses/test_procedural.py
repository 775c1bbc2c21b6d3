"""Endless levels: the same everywhere, closed, free of overlaps, and playable."""

from __future__ import annotations

import hashlib
import itertools
import subprocess
import sys

import numpy as np
import pytest
import shapely
import trimesh

from benchmarks.levels import Args, examine_level
from minigolf_env.courses import Course, CourseError, load_course
from minigolf_env.courses.procedural import (
    DIFFICULTY_NAMES,
    GENERATOR_VERSION,
    LEVEL_CACHE_SIZE,
    _build_cached,
    level_name,
)
from minigolf_env.courses.procedural import layout as layouts
from minigolf_env.courses.procedural.lane_features import FEATURES_BY_DIFFICULTY, MIN_SLOPE, LaneFeature
from minigolf_env.courses.procedural.layout import Layout, generate_layout
from minigolf_env.courses.procedural.level import BORDER_WIDTH, FELT_SURFACE, build_level
from minigolf_env.courses.procedural.portable_rng import PortableRng
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.config import _cached_world

PINNED = {
    ("easy", 0): "7032471adce0945f",
    ("easy", 2**31 - 1): "fb05a00a7563dc17",
    ("medium", 1): "00bfe365a5ccc638",
    ("hard", 1): "35434fd33e342dcb",
    ("hard", 2): "70695ee18b5f94eb",
    ("hard", 7): "9064d9f988e03743",
    ("hard", 12345): "8672e534c544804e",
}
"""Each level's fingerprint. If a change of the levels is meant, raise GENERATOR and pin the new ones."""

SAMPLE = [
    pytest.param(difficulty, level, id=f"{difficulty}-{level}") for difficulty in DIFFICULTY_NAMES for level in range(8)
]


def fingerprint(course: Course) -> str:
    """Return a hash of all that a ball can notice of a course."""
    digest = hashlib.sha256(repr((course.tee, course.cup, course.route, course.bounds)).encode())
    for part in course.parts:
        digest.update(repr((part.name, part.material, part.mesh.surface)).encode())
        digest.update(part.mesh.vertices.tobytes() + part.mesh.faces.tobytes())
    return digest.hexdigest()[:16]


@pytest.mark.parametrize(("difficulty", "level"), PINNED)
def test_a_level_stays_what_it_is(difficulty: str, level: int) -> None:
    """The meshes are those of every other machine and version, bit for bit."""
    assert fingerprint(build_level(difficulty, level)) == PINNED[difficulty, level]


def test_every_feature_is_in_a_pinned_level(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that a change of any of them is noticed."""
    laid: list[str] = []

    def attempt(difficulty: str, rng: PortableRng, legs: int) -> Layout:
        laid.clear()  # Only the last lane that is tried is the level's.
        return intact(difficulty, rng, legs)

    def noted(feature: LaneFeature) -> LaneFeature:
        return lambda lane, rng: (laid.append(feature.__name__), feature(lane, rng))[1]

    intact = layouts._draw_layout
    monkeypatch.setattr(layouts, "_draw_layout", attempt)
    monkeypatch.setattr(
        layouts,
        "FEATURES_BY_DIFFICULTY",
        {key: tuple(map(noted, some)) for key, some in FEATURES_BY_DIFFICULTY.items()},
    )
    pinned = set()
    for difficulty, level in PINNED:
        generate_layout(difficulty, PortableRng(GENERATOR_VERSION, DIFFICULTY_NAMES.index(difficulty), level))
        pinned |= set(laid)
    assert pinned == {feature.__name__ for some in FEATURES_BY_DIFFICULTY.values() for feature in some}


def test_another_process_makes_the_same_level() -> None:
    """Whatever seeds its hashes; and without the libraries of meshes, which take long to load."""
    code = (
        "import sys; from minigolf_env.courses.procedural.level import build_level;"
        "import hashlib; course = build_level('hard', 5);"
        "print(hashlib.sha256(b''.join(part.mesh.vertices.tobytes() for part in course.parts)).hexdigest(),"
        "{'trimesh', 'shapely'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    here = b"".join(part.mesh.vertices.tobytes() for part in build_level("hard", 5).parts)
    assert done.stdout.split(maxsplit=1) == [hashlib.sha256(here).hexdigest(), "set()\n"]


def test_par_counts_the_legs() -> None:
    """Two for a lane of one leg, one more for every two further ones, four at most."""
    legs = set()
    for difficulty, level in itertools.product(DIFFICULTY_NAMES, range(8)):
        layout = generate_layout(difficulty, PortableRng(GENERATOR_VERSION, DIFFICULTY_NAMES.index(difficulty), level))
        legs.add(layout.legs)
        assert build_level(difficulty, level).par == {1: 2, 2: 3, 3: 3, 4: 4, 5: 4}[layout.legs]
    assert legs == {1, 2, 3, 4, 5}


def test_levels_differ() -> None:
    """By number and by difficulty."""
    prints = [fingerprint(build_level(difficulty, level)) for difficulty in DIFFICULTY_NAMES for level in range(10)]
    assert len(set(prints)) == len(prints)


@pytest.mark.parametrize(("difficulty", "level"), SAMPLE)
def test_every_part_is_a_closed_solid(difficulty: str, level: int) -> None:
    """Watertight, wound outwards; the world finds room for the ball on the tee and in the cup."""
    course = load_course(level_name(difficulty, level))
    for part in course.parts:
        solid = trimesh.Trimesh(part.mesh.vertices, part.mesh.faces)
        assert solid.is_watertight and solid.is_winding_consistent and solid.volume > 0.0, part.name
    course.world()


@pytest.mark.parametrize("difficulty", DIFFICULTY_NAMES)
def test_a_lane_keeps_clear_of_itself(difficulty: str) -> None:
    """The outlines of a hundred lanes with their borders are simple polygons, connected from tee to cup."""
    for level in range(100):
        layout = generate_layout(difficulty, PortableRng(GENERATOR_VERSION, DIFFICULTY_NAMES.index(difficulty), level))
        outline = shapely.Polygon([layout.lane.points[k][:2] for k in layout.lane.boundary()])
        assert outline.is_valid and shapely.is_ccw(outline.exterior)
        outside = outline.buffer(BORDER_WIDTH, join_style="mitre")
        assert len(outside.interiors) == 0, f"{difficulty} {level}: borders touch"
        assert outline.buffer(-0.1).contains(shapely.Point(layout.cup))
        route = shapely.LineString([(0.0, 0.0), *layout.lane.route])
        assert outline.buffer(1e-6).contains(route), f"{difficulty} {level}: the route leaves the lane"


@pytest.mark.parametrize(("difficulty", "level"), SAMPLE)
def test_the_floor_covers_its_lane_once(difficulty: str, level: int) -> None:
    """Seen from above its faces fill the outline but for the hole, without overlaps or gaps."""
    layout = generate_layout(difficulty, PortableRng(GENERATOR_VERSION, DIFFICULTY_NAMES.index(difficulty), level))
    outline = shapely.Polygon([layout.lane.points[k][:2] for k in layout.lane.boundary()])
    floor, cup = build_level(difficulty, level).parts[:2]
    a, b, c = np.moveaxis(floor.mesh.triangles[:, :, :2], 1, 0)
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2.0
    hole = shapely.MultiPoint(cup.mesh.vertices[:, :2]).convex_hull
    assert areas[areas > 0.0].sum() == pytest.approx(outline.area - hole.area, rel=1e-4)


@pytest.mark.parametrize(("difficulty", "level"), SAMPLE)
def test_balls_roll_down_every_slope(difficulty: str, level: int) -> None:
    """Felt is level, or steeper than rolling resistance holds a ball on."""
    course = build_level(difficulty, level)
    for part in (part for part in course.parts if part.mesh.surface == FELT_SURFACE):
        a, b, c = np.moveaxis(part.mesh.triangles, 1, 0)
        normals = np.cross(b - a, c - a)
        upward = normals[normals[:, 2] > 1e-9]
        slopes = np.hypot(upward[:, 0], upward[:, 1]) / upward[:, 2]
        assert ((slopes < 1e-6) | (slopes > 0.99 * MIN_SLOPE)).all()


@pytest.mark.parametrize(
    ("difficulty", "level"), [(d, 50 + k) for d, k in itertools.product(DIFFICULTY_NAMES, range(3))]
)
def test_a_level_can_be_played(difficulty: str, level: int) -> None:
    """Search holes out; random play rests where it can go on, or is out over the border; no step loses time."""
    env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed", max_strokes=11)
    seen = examine_level(env, difficulty, level, Args(balls=10))
    assert seen.strokes <= 10
    assert (seen.exhausted, seen.low_out, seen.inside, seen.stuck, seen.late) == (0, 0, 0, 0, 0)


def test_a_wider_cup_changes_nothing_else() -> None:
    """Lane, tee and obstacles stay; a cup that does not fit is refused."""
    usual, wide = build_level("medium", 3), build_level("medium", 3, cup_radius=0.15)
    assert wide.cup is not None and wide.cup.radius == 0.15
    assert [part.name for part in usual.parts] == [part.name for part in wide.parts]
    for a, b in list(zip(usual.parts, wide.parts, strict=True))[2:]:
        assert np.array_equal(a.mesh.vertices, b.mesh.vertices)
    assert (usual.tee, usual.route) == (wide.tee, wide.route)
    wide.world()
    for radius, message in ((0.25, "expected at most 0.2 m, received 0.25"), (0.02, "more than the ball's radius")):
        with pytest.raises(CourseError, match=message):
            load_course(level_name("easy", 0), cup_radius=radius)


def test_levels_are_found_by_name() -> None:
    """A level's name, as info has it, loads it; as many are kept as a usual training set has."""
    course = load_course(f"procedural-v{GENERATOR_VERSION}-easy-17")
    assert course.name == f"procedural-v{GENERATOR_VERSION}-easy-17"
    assert load_course(course.name) is course
    wide = load_course(course.name, cup_radius=0.06).cup
    assert wide is not None and wide.radius == 0.06
    assert _build_cached.cache_info().maxsize == _cached_world.cache_info().maxsize == LEVEL_CACHE_SIZE


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (f"procedural-v{GENERATOR_VERSION}-esay-1", "difficulty: expected one of .* did you mean 'easy'"),
        (f"procedural-v{GENERATOR_VERSION + 1}-easy-1", f"this version makes levels v{GENERATOR_VERSION}"),
        (f"procedural-v{GENERATOR_VERSION}-easy--1", "expected a level named like 'procedural-v"),
        ("procedural-17", "expected a level named like"),
    ],
)
def test_names_of_no_level_say_why(name: str, message: str) -> None:
    """The message holds what was expected and received."""
    with pytest.raises(CourseError, match=message):
        load_course(name)
