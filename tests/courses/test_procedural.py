"""Procedural levels: equal on every machine, closed, free of overlaps, and playable."""

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
from minigolf_env.courses.procedural import layout as layout_module
from minigolf_env.courses.procedural.lane_features import FEATURES_BY_DIFFICULTY, MIN_SLOPE, LaneFeature
from minigolf_env.courses.procedural.layout import Layout, generate_layout
from minigolf_env.courses.procedural.level import BORDER_WIDTH, FELT_SURFACE, LINING_SURFACE, WOOD_SURFACE, build_level
from minigolf_env.courses.procedural.portable_rng import PortableRng
from minigolf_env.courses.schema.surfaces import collect_surfaces
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.config import _cached_world
from minigolf_env.physics import Surface

PINNED_FINGERPRINTS = {
    ("easy", 0): "7032471adce0945f",
    ("easy", 2**31 - 1): "fb05a00a7563dc17",
    ("medium", 1): "00bfe365a5ccc638",
    ("hard", 1): "35434fd33e342dcb",
    ("hard", 2): "70695ee18b5f94eb",
    ("hard", 7): "9064d9f988e03743",
    ("hard", 12345): "8672e534c544804e",
}
"""Fingerprint of each level. To change levels on purpose, raise GENERATOR_VERSION and pin the new ones."""

LEVEL_PARAMS = [
    pytest.param(difficulty, level, id=f"{difficulty}-{level}") for difficulty in DIFFICULTY_NAMES for level in range(8)
]


def fingerprint(course: Course) -> str:
    """Return a hash of everything in a course that affects a ball."""
    digest = hashlib.sha256(repr((course.tee, course.cup, course.route, course.bounds)).encode())
    for part in course.parts:
        digest.update(repr((part.name, part.material, part.mesh.surface)).encode())
        digest.update(part.mesh.vertices.tobytes() + part.mesh.faces.tobytes())
    return digest.hexdigest()[:16]


@pytest.mark.parametrize(("difficulty", "level"), PINNED_FINGERPRINTS)
def test_level_meshes_match_pinned_fingerprints(difficulty: str, level: int) -> None:
    """The meshes are those of every other machine and version, bit for bit."""
    assert fingerprint(build_level(difficulty, level)) == PINNED_FINGERPRINTS[difficulty, level]


def test_pinned_levels_contain_every_feature(monkeypatch: pytest.MonkeyPatch) -> None:
    """A change of any feature changes a pinned fingerprint."""
    added: list[str] = []

    def sample_and_record(difficulty: str, rng: PortableRng, legs: int) -> Layout:
        added.clear()  # The level has the last lane that was drawn.
        return sample_layout(difficulty, rng, legs)

    def recorded(feature: LaneFeature) -> LaneFeature:
        return lambda lane, rng: (added.append(feature.__name__), feature(lane, rng))[1]

    sample_layout = layout_module._sample_layout
    monkeypatch.setattr(layout_module, "_sample_layout", sample_and_record)
    monkeypatch.setattr(
        layout_module,
        "FEATURES_BY_DIFFICULTY",
        {key: tuple(map(recorded, features)) for key, features in FEATURES_BY_DIFFICULTY.items()},
    )
    pinned = set()
    for difficulty, level in PINNED_FINGERPRINTS:
        generate_layout(difficulty, PortableRng(GENERATOR_VERSION, DIFFICULTY_NAMES.index(difficulty), level))
        pinned |= set(added)
    assert pinned == {feature.__name__ for features in FEATURES_BY_DIFFICULTY.values() for feature in features}


@pytest.mark.parametrize(
    ("name", "surface"), [("felt", FELT_SURFACE), ("wood", WOOD_SURFACE), ("lining", LINING_SURFACE)]
)
def test_level_surfaces_equal_builtin_surfaces_of_course_files(name: str, surface: Surface) -> None:
    """Levels define their surfaces without pydantic, with the same values."""
    assert collect_surfaces({})[name].surface == surface


def test_another_process_generates_same_level() -> None:
    """A process with another hash seed, which imports no mesh library, gives the same bits."""
    code = (
        "import sys; from minigolf_env.courses.procedural.level import build_level;"
        "import hashlib; course = build_level('hard', 5);"
        "print(hashlib.sha256(b''.join(part.mesh.vertices.tobytes() for part in course.parts)).hexdigest(),"
        "{'trimesh', 'shapely'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    here = b"".join(part.mesh.vertices.tobytes() for part in build_level("hard", 5).parts)
    assert done.stdout.split(maxsplit=1) == [hashlib.sha256(here).hexdigest(), "set()\n"]


def test_par_grows_with_number_of_legs() -> None:
    """Par is two for one leg, one more for every two further legs, and four at most."""
    legs = set()
    for difficulty, level in itertools.product(DIFFICULTY_NAMES, range(8)):
        layout = generate_layout(difficulty, PortableRng(GENERATOR_VERSION, DIFFICULTY_NAMES.index(difficulty), level))
        legs.add(layout.legs)
        assert build_level(difficulty, level).par == {1: 2, 2: 3, 3: 3, 4: 4, 5: 4}[layout.legs]
    assert legs == {1, 2, 3, 4, 5}


def test_levels_differ_by_number_and_difficulty() -> None:
    """No two of thirty levels are equal."""
    prints = [fingerprint(build_level(difficulty, level)) for difficulty in DIFFICULTY_NAMES for level in range(10)]
    assert len(set(prints)) == len(prints)


@pytest.mark.parametrize(("difficulty", "level"), LEVEL_PARAMS)
def test_level_parts_are_closed_solids(difficulty: str, level: int) -> None:
    """Parts are watertight and wound outwards; the ball fits on the tee and into the cup."""
    course = load_course(level_name(difficulty, level))
    for part in course.parts:
        solid = trimesh.Trimesh(part.mesh.vertices, part.mesh.faces)
        assert solid.is_watertight and solid.is_winding_consistent and solid.volume > 0.0, part.name
    course.world()


@pytest.mark.parametrize("difficulty", DIFFICULTY_NAMES)
def test_lane_does_not_overlap_itself(difficulty: str) -> None:
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


@pytest.mark.parametrize(("difficulty", "level"), LEVEL_PARAMS)
def test_floor_covers_lane_exactly_once(difficulty: str, level: int) -> None:
    """Seen from above the floor's faces fill the outline except for the hole, without overlaps or gaps."""
    layout = generate_layout(difficulty, PortableRng(GENERATOR_VERSION, DIFFICULTY_NAMES.index(difficulty), level))
    outline = shapely.Polygon([layout.lane.points[k][:2] for k in layout.lane.boundary()])
    floor, cup = build_level(difficulty, level).parts[:2]
    a, b, c = np.moveaxis(floor.mesh.triangles[:, :, :2], 1, 0)
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2.0
    hole = shapely.MultiPoint(cup.mesh.vertices[:, :2]).convex_hull
    assert areas[areas > 0.0].sum() == pytest.approx(outline.area - hole.area, rel=1e-4)


@pytest.mark.parametrize(("difficulty", "level"), LEVEL_PARAMS)
def test_slopes_are_level_or_steeper_than_rolling_resistance(difficulty: str, level: int) -> None:
    """No ball comes to rest on a slope of felt."""
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
def test_search_holes_out_and_random_play_never_gets_stuck(difficulty: str, level: int) -> None:
    """Random play rests where it can continue or is out over the border; no step exhausts its sub-steps."""
    env = MiniGolfEnv("procedural", difficulty=difficulty, tee="fixed", max_strokes=11)
    seen = examine_level(env, difficulty, level, Args(balls=10))
    assert seen.strokes <= 10
    assert (seen.exhausted, seen.low_out, seen.inside, seen.stuck, seen.late) == (0, 0, 0, 0, 0)


def test_cup_radius_changes_only_cup_and_floor() -> None:
    """Lane, tee and obstacles stay; a cup that does not fit is an error."""
    default, wide = build_level("medium", 3), build_level("medium", 3, cup_radius=0.15)
    assert wide.cup is not None and wide.cup.radius == 0.15
    assert [part.name for part in default.parts] == [part.name for part in wide.parts]
    for a, b in list(zip(default.parts, wide.parts, strict=True))[2:]:
        assert np.array_equal(a.mesh.vertices, b.mesh.vertices)
    assert (default.tee, default.route) == (wide.tee, wide.route)
    wide.world()
    for radius, message in ((0.25, "expected at most 0.2 m, received 0.25"), (0.02, "more than the ball's radius")):
        with pytest.raises(CourseError, match=message):
            load_course(level_name("easy", 0), cup_radius=radius)


def test_levels_load_by_name() -> None:
    """A level loads by the name in info; the cache holds a usual training set."""
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
def test_invalid_level_name_error_says_why(name: str, message: str) -> None:
    """The message contains the expected and received value."""
    with pytest.raises(CourseError, match=message):
        load_course(name)
