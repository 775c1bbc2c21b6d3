"""Holes as .glb files: bit-equal round trips, and files from 3D programs."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
import trimesh

from minigolf_env.courses import CourseError, list_courses, load_course
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.courses.io.glb_course import to_glb
from minigolf_env.courses.io.gltf_scene import EXACT_VERTICES_KEY, SceneObject
from minigolf_env.courses.io.gltf_writer import write_scene
from minigolf_env.courses.schema.limits import Limits
from minigolf_env.physics import Status
from tests.cost import measure_memory
from tests.courses.scenes import same_mesh, solid

HOLE = {"name": "made", "par": 2, "top_speed": 4.0}


@pytest.mark.parametrize("name", [*list_courses(), "room"])
def test_course_survives_glb_round_trip_bitwise(name: str, tmp_path: Path) -> None:
    """A course that is written as .glb and read has the same bits, although glTF stores positions as float32."""
    course, path = load_course(name), tmp_path / "copy.glb"
    path.write_bytes(to_glb(course))
    again = load_course(path)
    assert same_mesh(course, again)
    for field in ("name", "tee", "cup", "par", "bounds", "route", "top_speed", "ball_radius", "gravity"):
        assert getattr(course, field) == getattr(again, field), field


def test_cup_depth_survives_glb_round_trip(tmp_path: Path) -> None:
    """A cup that is written as .glb and read has the same depth and radius."""
    cup = {"position": (2.5, 0.5, 0.0), "radius": 0.06, "depth": 0.2}
    made = (
        CourseBuilder("deep", tee=(0.3, 0.5), cup=cup)
        .add("lane", outline=[{"box": (0, 0, 3, 1)}], thickness=0.3)
        .course()
    )
    path = tmp_path / "deep.glb"
    path.write_bytes(to_glb(made))
    assert load_course(path).cup == made.cup and made.cup is not None and made.cup.depth == 0.2


def test_putt_on_glb_copy_has_same_path_bitwise(tmp_path: Path) -> None:
    """The whole path of a putt through the loop is equal."""
    course, path = load_course("loop"), tmp_path / "copy.glb"
    path.write_bytes(to_glb(course))
    start = (*course.tee.centre, course.ball_radius)
    a, b = (item.world().simulate(start, (5.0, 0.1, 0.0), record=True) for item in (course, load_course(path)))
    assert a.path.tobytes() == b.path.tobytes() and a.bounces > 0


def test_trimesh_reads_written_glb(tmp_path: Path) -> None:
    """A written file has the same parts in trimesh, with y up."""
    path = tmp_path / "copy.glb"
    path.write_bytes(to_glb(load_course("dogleg")))
    scene = trimesh.load_scene(path)
    assert set(scene.geometry) == {"floor", "cup", "border", "block", "bollard"}
    assert np.allclose(scene.bounds, [[-0.07, -0.123, -2.57], [4.07, 0.19, 0.07]], atol=0.01)


def by_hand(**change: SceneObject | None) -> list[SceneObject]:
    """Return a hole of boxes and empties; ``change`` replaces or removes objects."""
    objects = {
        "tee": SceneObject("tee", (-1.2, 0.0, 0.0), {}, None, None),
        "cup": SceneObject("Cup", (1.0, 0.2, 0.0), {"radius": 0.06}, None, None),
        "floor": solid("Floor", (3.0, 1.0, 0.2), (0.0, 0.0, -0.1)),
        "north": solid("wood.001", (3.2, 0.1, 0.3), (0.0, 0.55, 0.0)),
        "south": solid("wood.002", (3.2, 0.1, 0.3), (0.0, -0.55, 0.0)),
        "east": solid("rail", (0.1, 1.2, 0.3), (1.55, 0.0, 0.0), surface="brick", color="#802010"),
        "west": solid("end", (0.1, 1.2, 0.3), (-1.55, 0.0, 0.0), damping=0.9),
    }
    return [item for item in {**objects, **change}.values() if item is not None]


def write(objects: list[SceneObject], path: Path, exact: bool = False) -> Path:
    """Write objects as a 3D program does, without the exact vertices."""
    content = write_scene(objects, HOLE)
    path.write_bytes(content if exact else content.replace(EXACT_VERTICES_KEY.encode(), b"x" * len(EXACT_VERTICES_KEY)))
    return path


def test_glb_without_extras_can_be_played(tmp_path: Path) -> None:
    """Names determine surfaces, extras override them, and the cup is cut into the floor."""
    across = SceneObject("cup", (0.6, 0.2, 0.0), {}, None, None)  # On an edge of the floor's triangles.
    assert len(load_course(write(by_hand(cup=across), tmp_path / "across.glb")).parts) == 6
    course = load_course(write(by_hand(), tmp_path / "hand.glb"))
    assert course.name == "made" and course.par == 2 and course.cup is not None and course.cup.radius == 0.06
    surfaces = {part.name: part.mesh.surface for part in course.parts}
    assert surfaces["Floor"].tangential == 1.0 and surfaces["end"].damping == 0.9
    appearances = {part.name: (part.material, part.color) for part in course.parts}
    assert appearances["rail"][0] == "brick" and appearances["rail"][1] == pytest.approx(
        (128 / 255, 32 / 255, 16 / 255)
    )
    world = course.world()
    shot = world.simulate((1.0, 0.2, 0.1), (0.0, 0.0, 0.0))
    assert shot.status == Status.REST and shot.position[2] == pytest.approx(course.ball_radius - 0.1, abs=1e-9)
    rolls = world.simulate((*course.tee.centre, course.ball_radius), (1.5, 0.0, 0.0))
    assert rolls.status == Status.REST and rolls.position[2] == pytest.approx(course.ball_radius, abs=1e-6)
    assert load_course(tmp_path / "hand.glb", cup_radius=0.1).cup.radius == 0.1  # type: ignore[union-attr]


def test_tee_mesh_gives_tee_box(tmp_path: Path) -> None:
    """The ball starts anywhere above its bounding box, at the level of its lowest corner."""
    box = solid("tee box", (0.4, 0.6, 0.02), (-1.1, 0.0, 0.01))
    course = load_course(write(by_hand(tee=box), tmp_path / "hand.glb"))
    assert course.tee.lower == pytest.approx((-1.3, -0.3)) and course.tee.upper == pytest.approx((-0.9, 0.3))
    assert course.tee.height == pytest.approx(0.0) and len(course.parts) == 6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tee": None}, "expected one object named 'tee'"),
        (
            {"cup": SceneObject("cup", (9.0, 0.0, 0.0), {}, None, None)},
            "cup: position: expected a place on a lane or a floor",
        ),
        ({"cup": SceneObject("cup", (1.47, 0.0, 0.0), {}, None, None)}, "cup radius: expected less than"),
        ({"floor": solid("floor", (3.0, 1.0, 0.05), (0.0, 0.0, -0.025))}, "cup depth: expected a floor thicker than"),
        ({"east": solid("rail", (0.1, 1.2, 0.3), (1.55, 0.0, 0.0), surface="brik")}, "did you mean 'brick'"),
        ({"east": solid("rail", (0.1, 1.2, 0.3), (1.55, 0.0, 0.0), color="red")}, "color: string should match pattern"),
    ],
)
def test_glb_errors_name_object_and_fault(change: dict[str, SceneObject | None], message: str, tmp_path: Path) -> None:
    """Missing objects, cups that do not fit, unknown surfaces and colours are errors."""
    with pytest.raises(CourseError, match=message):
        load_course(write(by_hand(**change), tmp_path / "hand.glb"))


def test_rejects_open_mesh(tmp_path: Path) -> None:
    """Balls could enter a mesh that is not closed."""
    wall = solid("rail", (0.1, 1.2, 0.3), (1.55, 0.0, 0.0))
    assert wall.faces is not None
    with pytest.raises(CourseError, match="object 'rail': expected a closed solid"):
        load_course(write(by_hand(east=wall._replace(faces=wall.faces[1:])), tmp_path / "hand.glb"))


def test_mutated_glb_loads_or_raises_course_error(tmp_path: Path) -> None:
    """Changed bytes and huge numbers raise only CourseErrors, and counts in a file allocate nothing."""
    rng = random.Random(0)  # noqa: S311 (not for secrets)
    stored = write_scene(by_hand(), HOLE)
    refused = 0
    with measure_memory() as memory:
        for number in range(1500):
            content = bytearray(stored[: rng.choice([len(stored), len(stored), rng.randrange(len(stored))])])
            for _ in range(rng.randint(1, 6)):
                if content:
                    content[rng.randrange(min(len(content), 6000))] = rng.choice(b'0129-[]{}"e\x00\xff')
            path = tmp_path / f"{number}.glb"
            path.write_bytes(bytes(content))
            try:
                load_course(path, limits=Limits(triangles=10_000))
            except CourseError:
                refused += 1
    assert refused > 500 and memory.peak < 100e6
