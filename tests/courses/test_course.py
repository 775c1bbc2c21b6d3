"""Course records: validation, identity of copies, and loading by name or file."""

from __future__ import annotations

import copy
import dataclasses
import itertools
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
import trimesh

from minigolf_env.courses import CourseError, Cup, Tee, list_courses, load_course, par_of
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.courses.course import rolling_resistance_from_stimp
from minigolf_env.courses.io import toml_course
from minigolf_env.courses.schema.course_file import CourseFile
from minigolf_env.courses.schema.surfaces import SurfaceRecord, collect_surfaces
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.physics import Status, Surface


@pytest.mark.parametrize("k", [0, 1, 2])
def test_rejects_route_with_repeated_point(k: int) -> None:
    """A segment without length has no direction: distances along the route would be NaN."""
    course = load_course("dogleg")
    with pytest.raises(CourseError, match=r"route.*repeated"):
        dataclasses.replace(course, route=(*course.route[: k + 1], *course.route[k:]))


def test_copied_environment_shares_course_and_world() -> None:
    """Both are immutable, so a copy for planning builds neither again; it continues with the same results."""
    env = MiniGolfEnv()
    env.reset(seed=0)
    copied = copy.deepcopy(env)
    assert copied.task.course is env.task.course and copied.task.world is env.task.world
    putt = np.array([0.3, 0.2], np.float32)
    np.testing.assert_array_equal(env.step(putt)[0], copied.step(putt)[0])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(env)).step(putt)[0], env.step(putt)[0])  # noqa: S301


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_bounds_must_contain_ball_on_tee_and_in_cup(axis: int, side: int) -> None:
    """A face of the bounds through a corner of the tee or the cup's bottom is an error; one just beyond is accepted."""
    course = load_course("dogleg")
    assert course.cup is not None
    x, y, rim = course.cup.position
    tee = [(*corner, course.tee.height + course.ball_radius) for corner in (course.tee.lower, course.tee.upper)]
    positions = np.array([*tee, (x, y, rim - course.cup.depth + course.ball_radius)])
    extreme = (positions.min(axis=0), positions.max(axis=0))[side][axis]
    for step, fits in ((0.0, False), (1e-6, True), (-1e-6, False)):
        bounds = np.array(course.bounds)
        bounds[side, axis] = extreme + (step if side else -step)
        change = {"bounds": tuple(map(tuple, bounds.tolist()))}
        if fits:
            assert dataclasses.replace(course, **change).bounds == change["bounds"]
        else:
            with pytest.raises(CourseError, match="expected a ball within the bounds"):
                dataclasses.replace(course, **change)


def test_world_has_ball_gravity_and_bounds_of_course() -> None:
    """A wall at a corner of the tee is an error when the world is made."""
    course = dataclasses.replace(load_course("dogleg"), gravity=(0.0, 0.0, -1.62))
    world = course.world(dt=0.01, impact="conservative")
    assert world.dt == 0.01 and world.ball_radius == course.ball_radius
    start = np.array([*course.tee.centre, 0.5])
    fallen = world.simulate(start, (0.0, 0.0, 0.0), max_time=0.5)
    assert fallen.position[2] == pytest.approx(0.5 - 1.62 * 0.125)
    gone = world.simulate(start, (0.0, 0.0, 500.0), max_time=0.5)
    assert gone.status == Status.OUT_OF_BOUNDS
    for x, y in itertools.product((0.2, 1.0), (0.325, 0.925)):
        hole = CourseBuilder("post", tee={"lower": (0.2, 0.325), "upper": (1.0, 0.925)})
        hole.add("lane", outline=[{"box": (0, 0, 3, 1.25)}]).add("cylinder", at=(x, y, -0.1), radius=0.03, height=0.2)
        with pytest.raises(CourseError, match="is inside 'cylinder 2'"):
            hole.course().world()


def test_records_validate_each_field() -> None:
    """Messages name the field; a route needs two points, and its ends may differ from tee and cup by a nanometre."""
    for make, message in (
        (lambda: Cup((0.0, 0.0)), "cup: position"),  # type: ignore[arg-type]
        (lambda: Cup((0.0, 0.0, 0.0), depth=0.0), "cup: depth"),
        (lambda: Tee((0.0, np.nan), (1.0, 1.0), 0.0), "tee: lower"),
        (lambda: Tee((0.0, 0.0), (1.0,), 0.0), "tee: upper"),  # type: ignore[arg-type]
        (lambda: Tee((0.0, 0.0), (1.0, 1.0), np.inf), "tee: height"),
        (lambda: Tee((0.0, 2.0), (1.0, 1.0), 0.0), "tee: expected lower <= upper"),
    ):
        with pytest.raises(CourseError, match=message):
            make()
    assert Tee((0.0, 1.0), (0.0, 3.0), 0.0).centre == (0.0, 2.0)
    cup = Cup((0.0, 0.0, 0.0), 0.05, 0.03)
    cup.check_ball_fits(0.029)
    for radius, message in ((0.03, "cup depth: expected more"), (0.06, "cup radius: expected more")):
        with pytest.raises(CourseError, match=message):
            cup.check_ball_fits(radius)
    course = load_course("dogleg")
    part = course.parts[0]
    for color in ((0.0, 0.5, 1.01), (-0.01, 0.5, 1.0), (0.5, 0.5)):
        with pytest.raises(CourseError, match=f"part '{part.name}': color"):
            dataclasses.replace(part, color=color)
    assert dataclasses.replace(part, color=(0.0, 0.5, 1.0)).color == (0.0, 0.5, 1.0)
    start, end = course.route[0], course.route[-1]
    near = dataclasses.replace(course, route=((start[0] + 1e-10, start[1]), end))
    assert len(near.route) == 2
    for route in ((start,), (start, (end[0], end[1] + 1e-8)), ((start[0] - 1e-8, start[1]), end)):
        with pytest.raises(CourseError, match="route: expected points from the tee's centre to the cup"):
            dataclasses.replace(course, route=route)
    assert dataclasses.replace(course, par=1).par == 1
    for parts in ((), ("floor",), (part, "floor")):
        with pytest.raises(CourseError, match="parts: expected at least one Part"):
            dataclasses.replace(course, parts=parts)
    room = load_course("room")
    for change in ({"par": 3}, {"route": ((0.0, 0.0), (1.0, 1.0))}):
        with pytest.raises(CourseError, match="expected None and"):
            dataclasses.replace(room, **change)


@pytest.mark.parametrize("stimp", [6.0, 10.0, 13.5])
def test_stimp_is_distance_in_feet_that_ball_rolls(stimp: float) -> None:
    """From 1.829 m/s on level ground. A value that is not given is the default, and rolling takes precedence."""
    assert 1.829**2 / (2.0 * 9.81 * rolling_resistance_from_stimp(stimp)) == pytest.approx(0.3048 * stimp)
    described = {
        "felt": SurfaceRecord(stimp=stimp),
        "mat": SurfaceRecord(rolling=0.2, stimp=stimp, restitution=0.1),
        "plain": SurfaceRecord(damping=0.4, tangential=0.9, material="stone", color="#010203"),
    }
    surfaces = collect_surfaces(described)
    assert (
        surfaces["felt"].surface.rolling == rolling_resistance_from_stimp(stimp)
        and surfaces["mat"].surface.rolling == 0.2
    )
    plain = surfaces["plain"].surface
    assert (plain.damping, plain.tangential, plain.rolling) == (0.4, 0.9, Surface.rolling)
    assert (surfaces["plain"].material, surfaces["plain"].color) == ("stone", "#010203")
    assert surfaces["mat"].surface.restitution == 0.1 and surfaces["wood"].surface.damping == 0.7


@pytest.mark.parametrize("name", [*list_courses(), "room"])
def test_par_of_equals_par_of_loaded_course(name: str) -> None:
    """The par is read from the file, without building the meshes of a bundled course."""
    assert par_of(name) == load_course(name).par


def test_changed_course_file_is_loaded_again(tmp_path: Path) -> None:
    """While the file is unchanged, the same request returns the same course."""
    path = tmp_path / "lane.toml"
    CourseBuilder("lane", tee=(0.3, 0.5), cup=(2.5, 0.5, 0.0), par=2).add("lane", outline=[{"box": (0, 0, 3, 1)}]).save(
        path
    )
    first = load_course(path)
    assert load_course(path) is load_course(str(path)) is first and load_course(path, cup_radius=0.06) is not first
    path.write_text(path.read_text().replace("par = 2", "par = 3"))
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1_000_000_000))
    assert (first.par, load_course(path).par) == (2, 3)
    assert load_course("procedural-v1-easy-17").name == "procedural-v1-easy-17"
    with pytest.raises(CourseError, match=r"^course: expected one of .*'room', received 'windmill'"):
        load_course("windmill")


def test_course_file_is_parsed_once_per_load(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its mesh files are found, its par is read and its course is built from one parsed description."""
    path = tmp_path / "lane.toml"
    builder = CourseBuilder("lane", tee=(0.3, 0.5), cup=(2.5, 0.5, 0.0))
    builder.add("lane", outline=[{"box": (0, 0, 3, 1)}]).add("mesh", file="post.stl", at=(1.5, 0.5, 0.1)).save(path)
    trimesh.creation.box((0.1, 0.1, 0.2)).export(tmp_path / "post.stl")
    parsed: list[str] = []
    parse = toml_course.parse_description

    def count_and_parse(text: str, name: str) -> CourseFile:
        parsed.append(name)
        return parse(text, name)

    monkeypatch.setattr(toml_course, "parse_description", count_and_parse)
    course = load_course(path)
    assert parsed == ["lane.toml"]
    assert load_course(path) is course and par_of(str(path)) == 2
    assert parsed == ["lane.toml"]
    assert load_course(path, cup_radius=0.06) is not course
    assert parsed == ["lane.toml"] * 2
