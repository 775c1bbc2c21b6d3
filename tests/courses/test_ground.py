"""Cups and tees within rounding of a floor stand on it exactly, and only the floor of the cup is cut."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from minigolf_env.courses import Course, CourseError, load_course
from minigolf_env.courses.geometry.ground import LEVEL_TOLERANCE, ground_level
from minigolf_env.courses.io.gltf_scene import SceneObject
from minigolf_env.courses.io.gltf_writer import write_scene
from minigolf_env.courses.io.toml_course import build_course, validate_description
from minigolf_env.physics import Status


def floor(lower: tuple[float, float, float], upper: tuple[float, float, float], **keys: Any) -> dict[str, Any]:
    """Return a mesh part that is a block of felt."""
    block = trimesh.creation.box(bounds=[lower, upper])
    return {
        "kind": "mesh",
        "floor": True,
        "surface": "felt",
        "vertices": block.vertices.tolist(),
        "faces": block.faces.tolist(),
    } | keys


def hole(parts: list[dict[str, Any]], cup: tuple[float, float, float], tee_height: float = 0.0) -> Course:
    """Return a course of these parts with a tee at the origin."""
    tee = {"at": [0, 0], "height": tee_height}
    data = {"name": "c", "par": 2, "tee": tee, "cup": {"position": cup}, "parts": parts}
    return build_course(validate_description(data, "c"))


def is_holed_from_above(course: Course) -> bool:
    """Return whether a ball dropped over the cup rests at its bottom."""
    assert course.cup is not None
    x, y, rim = course.cup.position
    shot = course.world().simulate((x, y, rim + 0.05), (0, 0, 0))
    return shot.status == Status.REST and abs(shot.position[2] - (rim - course.cup.depth + course.ball_radius)) < 1e-6


@pytest.mark.parametrize("offset", [0.0, 5e-8, -5e-8, 0.9 * LEVEL_TOLERANCE, -0.9 * LEVEL_TOLERANCE])
def test_cup_and_tee_within_rounding_of_a_floor_stand_on_it(offset: float) -> None:
    """The levels are those of the floor, to the bit, and a ball falls into the cup and rolls over the seam."""
    level = 0.3
    course = hole([floor((-1, -1, 0), (4, 1, level))], (3, 0, level + offset), level + offset)
    assert course.cup is not None and course.cup.position[2] == level and course.tee.height == level
    assert is_holed_from_above(course)


def test_cup_beyond_rounding_of_a_floor_is_an_error() -> None:
    """A cup that is clearly above or below the floor is refused."""
    for offset in (-1e-4, 1e-4):
        with pytest.raises(CourseError, match="cup: position: expected a place on a lane or a floor"):
            hole([floor((-1, -1, -0.2), (4, 1, 0))], (3, 0, offset))


def test_floor_with_uneven_rounding_is_level_around_the_cup() -> None:
    """A floor whose top corners differ by the rounding of float32, as exporters write them, holds a cup."""
    block = floor((-1, -1, 0.0), (4, 1, 0.3))
    vertices = np.array(block["vertices"])
    top = vertices[:, 2] == 0.3
    vertices[top, 2] += np.array([0, 3e-8, -3e-8, 1e-8])[: top.sum()]
    course = hole([block | {"vertices": vertices.tolist()}], (3, 0, 0.3), 0.3)
    assert is_holed_from_above(course)
    course.world()


@pytest.mark.parametrize("scale", [(2.0, 0.1, 1.0), (1.7, 0.3, 0.9)])
@pytest.mark.parametrize("height", [0.0, 0.3, 1.7, -0.6])
def test_floors_as_blender_exports_them_hold_a_cup(scale: tuple[float, ...], height: float, tmp_path: Path) -> None:
    """Positions, scales and empties in float32, whose sums differ in the last bits, make a course."""
    unit = trimesh.creation.box((2, 2, 2))
    vertices = (unit.vertices.astype("f4") * np.array([scale[0], scale[2], scale[1]], "f4")).astype("f8")
    vertices[:, 2] += float(np.float32(height)) - float(np.float32(scale[1]))
    empties = [
        SceneObject(name, (x, 0.0, float(np.float32(height))), {}, None, None)
        for name, x in (("tee", 0.0), ("cup", 1.0))
    ]
    objects = [SceneObject("floor", (0, 0, 0), {}, vertices, unit.faces), *empties]
    (tmp_path / "hole.glb").write_bytes(write_scene(objects, {}))
    course = load_course(tmp_path / "hole.glb")
    course.world()
    assert is_holed_from_above(course)


@pytest.mark.parametrize("order", [1, -1])
def test_only_the_floor_that_holds_the_cup_is_cut(order: int) -> None:
    """A floor next to, below or above the one that holds the cup stays whole."""
    parts = [
        floor((-1, -1, -0.2), (2, 1, 0), name="tee floor"),
        floor((2, -1, -0.2), (4, 1, 0), name="cup floor"),
        floor((4, -1, -0.4), (6, 1, -0.2), name="low floor"),
        floor((2, -1, 0.8), (4, 1, 1.0), name="bridge"),
    ][::order]
    course = hole(parts, (3, 0, 0))
    counts = {part.name: len(part.mesh.faces) for part in course.parts}
    assert is_holed_from_above(course)
    assert {name for name, count in counts.items() if count == 12} == {"tee floor", "low floor", "bridge"}


def test_two_islands_of_one_floor_hold_a_cup() -> None:
    """A floor may be one mesh of two pieces; the cup may lie on a seam of its triangles."""
    first, second = (trimesh.creation.box(bounds=b) for b in ([(-1, -1, -0.2), (1, 1, 0)], [(2, -1, -0.2), (4, 1, 0)]))
    both = trimesh.util.concatenate([first, second])
    part = floor((0, 0, 0), (1, 1, 1), vertices=both.vertices.tolist(), faces=both.faces.tolist())
    assert is_holed_from_above(hole([part], (3, 0, 0)))  # On the diagonal of the top.


def test_ground_level_is_that_of_the_mesh() -> None:
    """Level ground has the bits of its corners; a slope has the height of its plane; elsewhere there is none."""
    level = np.array([[[0, 0, 0.1], [1, 0, 0.1], [0, 1, 0.1]]])
    assert ground_level(level, 0.2, 0.2, 0.1 + 1e-7) == 0.1
    assert ground_level(level, 0.5, 0.5, 0.1) == 0.1
    assert ground_level(level, 0.6, 0.6, 0.1) is None and ground_level(level, 0.2, 0.2, 0.2) is None
    assert ground_level(level[:, ::-1], 0.2, 0.2, 0.1) is None
    slope = np.array([[[0, 0, 0.0], [1, 0, 0.5], [0, 1, 0.0]]])
    assert ground_level(slope, 0.4, 0.2, 0.2) == pytest.approx(0.2, abs=1e-15)


def test_faults_of_tee_cup_and_parts_name_their_line(tmp_path: Path) -> None:
    """Faults that only the geometry shows name the line of the tee, the cup or the part."""
    lane = '[[parts]]\nkind = "lane"\noutline = [{ box = [0, 0, 5, 1] }]\n'
    cup = '[cup]\nposition = [4, 0.5, 0]\nsurface = "lining"\n'
    text = f'name = "c"\npar = 2\ntee = {{ at = [1, 0.5] }}\n\n{cup}\n{lane}'
    for old, new, message in (
        ("at = [1,", "at = [9,", r"c.toml: line 3: .*tee: expected a place over a floor, received \(9"),
        ("0.5, 0]", "0.5, 0.2]", r"c.toml: line 5: .*cup: position: expected a place on a lane or a floor"),
        ('"lining"', '"linning"', r"c.toml: line 7: .*did you mean 'lining'"),
        ('"lining"', '"lining"\ndepth = "x"', r"line 8: cup.depth"),
        (lane, f'{lane}{lane}surface = "fellt"\n', r"c.toml: line 12: .*part 'lane 2': .*did you mean 'felt'"),
    ):
        (tmp_path / "c.toml").write_text(text.replace(old, new))
        with pytest.raises(CourseError, match=message) as error:
            load_course(tmp_path / "c.toml")
        assert "enlarge the bounds" not in str(error.value)


def test_byte_order_mark_is_read_over(tmp_path: Path) -> None:
    """Some editors begin a file with one; text in UTF-16 is an error that asks for UTF-8."""
    text = 'name = "c"\ntee = { at = [0.4, 0.5] }\n[[parts]]\nkind = "lane"\noutline = [{ box = [0, 0, 5, 1] }]\n'
    (tmp_path / "c.toml").write_text(text, encoding="utf-8-sig")
    assert load_course(tmp_path / "c.toml").name == "c"
    (tmp_path / "d.toml").write_text(text, encoding="utf-16")
    with pytest.raises(CourseError, match="save it as UTF-8"):
        load_course(tmp_path / "d.toml")


def test_bridge_of_the_same_mesh_does_not_hide_the_cup() -> None:
    """A piece of the floor's mesh above the cup is no floor under it."""
    pieces = [trimesh.creation.box(bounds=b) for b in ([(-1, -1, -0.2), (4, 1, 0)], [(2.5, -1, 0.8), (3.5, 1, 1.0)])]
    both = trimesh.util.concatenate(pieces)
    part = floor((0, 0, 0), (1, 1, 1), vertices=both.vertices.tolist(), faces=both.faces.tolist())
    assert is_holed_from_above(hole([part], (3, 0, 0)))


def test_default_bounds_hold_lanes_with_heights_and_mesh_floors() -> None:
    """A ball on high or low ground, or on a floor next to the lanes, is within the default bounds."""
    rise = {"kind": "along", "at": [0, 0], "profile": [(0, 0), (2, 3), (4, -1)]}
    lane = {"kind": "lane", "outline": [{"box": [0, 0, 4, 1]}], "heights": [rise]}
    part = floor((-3, -1, -0.2), (-1, 1, 0))
    data = {"name": "c", "tee": {"at": [-2, 0]}, "parts": [lane, part]}
    course = build_course(validate_description(data, "c"))
    points = np.concatenate([part.mesh.vertices for part in course.parts])
    assert (np.array(course.bounds[0]) <= points.min(axis=0)).all()
    assert (np.array(course.bounds[1]) >= points.max(axis=0)).all()
    assert course.bounds[1][2] >= points[:, 2].max() + 2 * course.ball_radius
