"""Holes as .glb files: bit-equal round trips, files from 3D programs, and hostile files."""

from __future__ import annotations

import base64
import io
import json
import random
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from minigolf_env.courses import Course, CourseError, list_courses, load_course
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.courses.io.glb_course import to_glb
from minigolf_env.courses.io.gltf_scene import EXACT_VERTICES_KEY, SceneObject, read_scene
from minigolf_env.courses.io.gltf_writer import write_scene
from minigolf_env.courses.schema.limits import Limits
from minigolf_env.physics import Status

HOLE = {"name": "made", "par": 2, "top_speed": 4.0}


def same_mesh(a: Course, b: Course) -> bool:
    """Return whether two courses have the same bits."""
    pairs = list(zip(a.parts, b.parts, strict=True))
    return all(
        p.mesh.vertices.tobytes() == q.mesh.vertices.tobytes()
        and np.array_equal(p.mesh.faces, q.mesh.faces)
        and (p.name, p.material, p.color, p.mesh.surface) == (q.name, q.material, q.color, q.mesh.surface)
        for p, q in pairs
    )


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


def solid(name: str, size: tuple[float, float, float], at: tuple[float, float, float], **extras: Any) -> SceneObject:
    """Return a box as 3D programs store it: with separate vertices for each face."""
    box = trimesh.creation.box(size)
    box.apply_translation(at)
    box.unmerge_vertices()
    return SceneObject(name, (0.0, 0.0, 0.0), extras, np.array(box.vertices), np.array(box.faces))


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
    with pytest.raises(CourseError, match="part 'rail': expected a closed solid"):
        load_course(write(by_hand(east=wall._replace(faces=wall.faces[1:])), tmp_path / "hand.glb"))


def test_parent_transforms_apply_to_children() -> None:
    """The transform of a parent applies to its children; a cycle of parents is an error."""
    content = write_scene([solid("a", (1, 1, 1), (0, 0, 0)), SceneObject("b", (0.0, 0.0, 0.0), {}, None, None)], {})
    size = struct.unpack_from("<I", content, 12)[0]
    data = json.loads(content[20 : 20 + size])
    data["nodes"][1] |= {"children": [0], "translation": [1.0, 2.0, 3.0], "scale": [2.0, 2.0, 2.0]}
    data["scenes"][0]["nodes"] = [1]
    objects, _ = read_scene(packed(data, content[20 + size :]), Limits())
    assert [item.name for item in objects] == ["b", "a"] and objects[1].vertices is not None
    assert np.allclose(objects[1].vertices.mean(axis=0), [1.0, -3.0, 2.0])
    assert np.allclose(np.ptp(objects[1].vertices, axis=0), 2.0)
    data["nodes"][0]["children"] = [1]
    with pytest.raises(CourseError, match="node 1 is referenced twice or nested"):
        read_scene(packed(data, content[20 + size :]), Limits())


@pytest.mark.parametrize("seed", range(6))
def test_node_transforms_match_trimesh(seed: int) -> None:
    """Translations, rotations, scales and matrices of nested and mirrored nodes give trimesh's vertices."""
    rng = np.random.default_rng(seed)
    content = write_scene([solid(name, (1, 2, 3), (0.1, 0.2, 0.3)) for name in "abc"], {})
    size = struct.unpack_from("<I", content, 12)[0]
    data = json.loads(content[20 : 20 + size])
    for node in data["nodes"]:
        del node["extras"][EXACT_VERTICES_KEY]
        turn = rng.normal(size=4)
        node["rotation"] = (turn / np.linalg.norm(turn)).tolist()
        node["translation"] = rng.uniform(-5, 5, 3).tolist()
        node["scale"] = (rng.uniform(0.5, 2, 3) * rng.choice([-1, 1], 3)).tolist()
    transform = trimesh.transformations.random_rotation_matrix(rng.random(3))
    transform[:3, 3] = rng.uniform(-5, 5, 3)
    data["nodes"][2] = {"name": "c", "mesh": 2, "matrix": transform.T.ravel().tolist()}
    data["nodes"][0]["children"], data["scenes"][0]["nodes"] = [1], [0, 2]
    file = packed(data, content[20 + size :])
    objects, _ = read_scene(file, Limits())
    scene = trimesh.load_scene(io.BytesIO(file), file_type="glb")
    for item in objects:
        matrix, geometry = scene.graph[item.name]
        expected = trimesh.transform_points(scene.geometry[geometry].vertices, matrix)
        assert item.vertices is not None and item.faces is not None
        assert item.vertices == pytest.approx(expected @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]], abs=1e-5)
        assert item.at == pytest.approx(matrix[:3, 3] @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]], abs=1e-9)
        assert trimesh.Trimesh(item.vertices, item.faces).volume > 0.0


@pytest.mark.parametrize("kind", ["u1", "<u2", "<u4", None])
def test_reads_arrays_of_any_index_type_and_stride(kind: str | None) -> None:
    """Indices of any size or none, strides and offsets are read; accessors beyond the file are errors."""
    corners = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4], [2, 0, 4], [0, 3, 4]], "<f4")
    faces = np.array([[0, 2, 1], [3, 4, 5]])
    rows = np.zeros((6, 5), "<f4")
    rows[:, :3] = corners
    index = b"" if kind is None else faces.astype(kind).tobytes()
    binary = b"\0" * 8 + b"\0" * 4 + rows.tobytes() + b"\0" * 4 + index
    numbers = {"u1": 5121, "<u2": 5123, "<u4": 5125}
    primitive: dict[str, Any] = {"attributes": {"POSITION": 0}}
    data: dict[str, Any] = {
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [{"bufferView": 0, "byteOffset": 4, "componentType": 5126, "count": 6, "type": "VEC3"}],
        "bufferViews": [{"byteOffset": 8, "byteLength": 4 + rows.nbytes, "byteStride": 20}],
    }
    if kind is not None:
        primitive["indices"] = 1
        data["accessors"].append({"bufferView": 1, "componentType": numbers[kind], "count": 6, "type": "SCALAR"})
        data["bufferViews"].append({"byteOffset": len(binary) - len(index), "byteLength": len(index)})
    rest = struct.pack("<I4s", len(binary), b"BIN\0") + binary
    objects, extras = read_scene(packed(data, rest), Limits())
    (item,) = objects
    assert extras == {} and item.name == "node 0" and item.at == (0.0, 0.0, 0.0) and item.vertices is not None
    assert np.array_equal(item.vertices, corners.astype(np.float64) @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert np.array_equal(item.faces, [[0, 1, 2], [3, 4, 5]] if kind is None else faces)
    for break_it, message in (
        (lambda d: d["accessors"][0].update(count=7), "beyond its view"),
        (lambda d: d["accessors"][0].update(count=0), "beyond its view"),
        (lambda d: d["accessors"][0].update(count=-1), "beyond the file"),
        (lambda d: d["accessors"][0].update(count=True), "beyond the file"),
        (lambda d: d["accessors"][0].update(byteOffset=13), "beyond its view"),
        (lambda d: d["accessors"][0].update(sparse={}), "accessor 0 is sparse or not of type VEC3"),
        (lambda d: d["accessors"][0].update(type="VEC2"), "accessor 0 is sparse or not of type VEC3"),
        (lambda d: d["accessors"][0].update(componentType=5125), "accessor 0 refers to another file"),
        (lambda d: d["bufferViews"][0].update(byteStride=8), "beyond its view"),
        (lambda d: d["bufferViews"][0].update(byteOffset=len(binary) - 100), "beyond its view"),
        (lambda d: d["bufferViews"][0].update(byteOffset=10_000), "beyond the file"),
        (lambda d: d["bufferViews"][0].update(buffer=1), "accessor 0 refers to another file"),
        (lambda d: d["meshes"][0]["primitives"][0].update(mode=1), "consists of lines, not of triangles"),
        (
            lambda d: d["accessors"][0].update(count=3) if kind else d["nodes"][0].update(extras=7),
            "indices beyond its positions|not a JSON object",
        ),
        (lambda d: d["nodes"][0].update(extras=[1]), "extras are not a JSON object"),
        (lambda d: d["nodes"][0].update(scale=[1e7, 1, 1]), "a transform that is not finite"),
        (lambda d: d["nodes"][0].update(translation=[0, 2000, 0]), "positions beyond 1000 m"),
    ):
        broken = json.loads(json.dumps(data))
        break_it(broken)
        with pytest.raises(CourseError, match=message):
            read_scene(packed(broken, rest), Limits())


def test_rejects_files_with_invalid_glb_header() -> None:
    """A wrong magic number or version, and chunks longer than the file, are errors."""
    alone = packed({"nodes": [{"name": "tee"}]}, b"")  # JSON to the last byte.
    assert [item.name for item in read_scene(alone, Limits())[0]] == ["tee"]
    stored = write_scene([solid("a", (1, 1, 1), (0, 0, 0))], {"par": 3})
    assert read_scene(stored, Limits())[1] == {"par": 3} and read_scene(stored + b"more", Limits())
    for at, new, message in (
        (0, b"glTG", "the header is not that of a complete"),
        (4, b"\3", "the header is not that of a complete"),
        (8, struct.pack("<I", len(stored) + 1), "the header is not that of a complete"),
        (12, struct.pack("<I", len(stored)), "the JSON chunk is missing"),
        (16, b"JSOM", "the JSON chunk is missing"),
    ):
        with pytest.raises(CourseError, match=message):
            read_scene(stored[:at] + new + stored[at + len(new) :], Limits())


def test_exact_vertices_are_ignored_if_object_changed() -> None:
    """Exact vertices are used while they round to the stored positions; damaged ones are ignored."""
    corners = np.array([[0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [0.1, 1.2, 0.3]])
    content = write_scene([SceneObject("a", (0.0, 0.0, 0.0), {}, corners, np.array([[0, 1, 2]]))], {})
    size = struct.unpack_from("<I", content, 12)[0]
    rest = content[20 + size :]
    data = json.loads(content[20 : 20 + size])

    def read(extra: Any, **node: Any) -> Any:
        changed = json.loads(json.dumps(data))
        changed["nodes"][0] |= {"extras": {EXACT_VERTICES_KEY: extra}, **node}
        return read_scene(packed(changed, rest), Limits())[0][0].vertices

    stored = data["nodes"][0]["extras"][EXACT_VERTICES_KEY]
    rounded = corners.astype(np.float32).astype(np.float64)
    assert np.array_equal(read(stored), corners)
    assert np.array_equal(read(stored, translation=[1.0, 0.0, 0.0]), corners + np.eye(3)[0])
    changed_vertices = base64.b64encode((corners + 0.5).astype("<f8").tobytes()).decode()
    for damaged in (changed_vertices, stored[:-4], "?", 7, stored[:32], ""):
        assert np.array_equal(read(damaged), rounded)


def packed(data: dict[str, Any], rest: bytes) -> bytes:
    """Return a .glb file with another JSON chunk."""
    text = json.dumps(data).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + rest
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def test_limits_count_each_use_of_an_array(tmp_path: Path) -> None:
    """A small file that repeats an array cannot allocate terabytes; its JSON has the limit of text."""
    content = write_scene([solid("a", (1, 1, 1), (0, 0, 0))], {})
    size = struct.unpack_from("<I", content, 12)[0]
    data = json.loads(content[20 : 20 + size])
    data["accessors"][0]["count"] = corners = 10_000
    data["bufferViews"].append({"buffer": 0, "byteOffset": 0, "byteLength": 12 * corners})
    data["accessors"][0]["bufferView"] = len(data["bufferViews"]) - 1
    data["meshes"][0]["primitives"] *= 10_000
    path = tmp_path / "again.glb"
    binary = content[20 + size + 8 :].ljust(12 * corners, b"\0")
    path.write_bytes(packed(data, struct.pack("<I4s", len(binary), b"BIN\0") + binary))
    tracemalloc.start()
    with pytest.raises(CourseError, match="expected at most 20000 triangles"):
        load_course(path, limits=Limits(triangles=20_000))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 30e6
    with pytest.raises(CourseError, match="JSON in it: expected at most 100 bytes"):
        load_course(path, limits=Limits(text_bytes=100))


def test_mutated_glb_loads_or_raises_course_error(tmp_path: Path) -> None:
    """Changed bytes and huge numbers raise only CourseErrors, and counts in a file allocate nothing."""
    rng = random.Random(0)  # noqa: S311 (not for secrets)
    stored = write_scene(by_hand(), HOLE)
    refused = 0
    tracemalloc.start()
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
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert refused > 500 and peak < 100e6


def blender_scene(change: Callable[[dict[str, Any]], None] = lambda data: None, parts: int = 1) -> bytes:
    """Return a .glb file of a floor, a tee, a cup and a wooden block, whose JSON was changed."""
    objects = [solid("floor", (4.0, 2.0, 0.4), (1.5, 0.0, -0.2))]
    objects += [SceneObject(name, (x, 0.0, 0.0), {}, None, None) for name, x in (("tee", 0.0), ("cup", 3.0))]
    objects += [solid(f"wood {k}", (0.2, 0.2, 0.2), (1.0, 0.6, 0.1)) for k in range(parts)]
    content = write_scene(objects, {})
    size = struct.unpack_from("<I", content, 12)[0]
    data = json.loads(content[20 : 20 + size])
    change(data)
    return packed(data, content[20 + size :])


def load_scene(folder: Path, change: Callable[[dict[str, Any]], None] = lambda data: None) -> Course:
    """Return the course of a changed scene."""
    (folder / "scene.glb").write_bytes(blender_scene(change))
    return load_course(folder / "scene.glb")


def test_scene_without_changes_is_a_course(tmp_path: Path) -> None:
    """The scene that the tests below change is a course of a floor, a cup and a block."""
    assert [part.name for part in load_scene(tmp_path).parts] == ["floor", "cup", "wood 0"]


WOOD = 3
"""Number of the wooden block's node."""


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["nodes"][WOOD].update(skin=0), "object 'wood 0': .*armature"),
        (
            lambda d: (d["meshes"][1].update(weights=[0.5]), d["meshes"][1]["primitives"][0].update(targets=[{}])),
            "object 'wood 0': .*shape keys",
        ),
        (
            lambda d: (d["nodes"][WOOD].update(weights=[0.5]), d["meshes"][1]["primitives"][0].update(targets=[{}])),
            "object 'wood 0': .*shape keys",
        ),
        (lambda d: d["nodes"][WOOD].update(extensions={"EXT_mesh_gpu_instancing": {}}), "object 'wood 0': .*instances"),
        (
            lambda d: d.update(animations=[{"channels": [{"target": {"node": WOOD, "path": "translation"}}]}]),
            "object 'wood 0': .*animation",
        ),
        (lambda d: d["meshes"][1]["primitives"][0].update(mode=3), "object 'wood 0': .*a strip of lines"),
        (lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"]), "export it without compression"),
        (lambda d: d.update(extensionsRequired=["ACME_bend"]), "requires the extension 'ACME_bend'"),
        (lambda d: d["nodes"][2].update(mesh=1), "object 'cup': expected an empty"),
        (lambda d: d["nodes"][WOOD]["extras"].update(restituton=0.5), "object 'wood 0': .*did you mean 'restitution'"),
        (lambda d: d["nodes"][WOOD]["extras"].update(Damping=0.5), "object 'wood 0': .*did you mean 'damping'"),
        (lambda d: d["nodes"][2]["extras"].update(radus=0.06), "object 'cup': .*did you mean 'radius'"),
        (lambda d: d["nodes"][1]["extras"].update(hight=0.06), "object 'tee': .*did you mean 'height'"),
        (lambda d: d["scenes"][0]["extras"].update(top_sped=3.0), "scene: .*did you mean 'top_speed'"),
        (lambda d: d["scenes"][0]["extras"].update(par=2.5), "par: expected a valid integer"),
    ],
)
def test_features_that_are_not_applied_name_their_object(
    change: Callable[[dict[str, Any]], None], message: str, tmp_path: Path
) -> None:
    """A feature that would move a mesh, or a misspelt property, is an error that names the object."""
    with pytest.raises(CourseError, match=message):
        load_scene(tmp_path, change)


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d.update(extensionsRequired=["KHR_materials_unlit", "KHR_texture_transform"]),
        lambda d: d.update(extensionsUsed=["ACME_bend"]),
        lambda d: d["meshes"][1].update(weights=[0.0]) or d["meshes"][1]["primitives"][0].update(targets=[{}]),
        lambda d: d["nodes"][WOOD]["extras"].update(cycles={}, my_addon_data=7),
    ],
)
def test_features_that_change_no_geometry_are_read_over(
    change: Callable[[dict[str, Any]], None], tmp_path: Path
) -> None:
    """Materials, shape keys without weight and properties of other programs leave the course as it is."""
    assert same_mesh(load_scene(tmp_path, change), load_scene(tmp_path))


def test_hidden_nodes_are_not_part_of_the_course(tmp_path: Path) -> None:
    """A node that is not visible, and its children, are left out."""

    def hide(data: dict[str, Any]) -> None:
        data["nodes"].append({"name": "group", "children": [WOOD]})
        data["nodes"][-1]["extensions"] = {"KHR_node_visibility": {"visible": False}}
        data["scenes"][0]["nodes"] = [0, 1, 2, 4]
        data["extensionsRequired"] = ["KHR_node_visibility"]

    assert [part.name for part in load_scene(tmp_path, hide).parts] == ["floor", "cup"]


def test_numbers_as_blender_stores_them_are_read(tmp_path: Path) -> None:
    """A whole number may be 3.0, and a list of points a flat array."""
    extras = {"par": 3.0, "bounds": [-1.0, -2.0, -1.0, 6.0, 2.0, 3.0], "route": [1.0, 0.3, 2.0, -0.3]}
    course = load_scene(tmp_path, lambda data: data["scenes"][0]["extras"].update(extras))
    assert course.par == 3 and course.bounds == ((-1, -2, -1), (6, 2, 3))
    assert course.route[1:-1] == ((1.0, 0.3), (2.0, -0.3))


@pytest.mark.parametrize(
    ("mode", "index", "triangles"),
    [
        (5, [0, 1, 2, 3, 4], [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        (6, [0, 1, 2, 3, 4], [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),
    ],
)
def test_strips_and_fans_are_triangles_of_one_winding(mode: int, index: list[int], triangles: list[list[int]]) -> None:
    """Every second triangle of a strip is wound the other way around in the file (glTF 2.0, section 3.7.2.1)."""
    corners = np.random.default_rng(0).random((5, 3)).astype("<f4")
    binary = corners.tobytes() + np.array(index, "<u2").tobytes() + b"\0\0"
    data = {
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 5, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": len(index), "type": "SCALAR"},
        ],
        "bufferViews": [{"byteLength": 60}, {"byteOffset": 60, "byteLength": 2 * len(index)}],
    }
    ((item,), _) = read_scene(packed(data, struct.pack("<I4s", len(binary), b"BIN\0") + binary), Limits())
    assert item.faces is not None and item.faces.tolist() == triangles


def test_quantized_positions_are_read() -> None:
    """Positions may be integers, normalized to [-1, 1] or not (KHR_mesh_quantization)."""
    corners = np.array([[0, 0, 0], [127, 0, 0], [0, -127, 0], [-128, 0, 64]], "i1")
    data: dict[str, Any] = {
        "extensionsRequired": ["KHR_mesh_quantization"],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}],
        "accessors": [{"bufferView": 0, "componentType": 5120, "count": 4, "type": "VEC3", "normalized": True}],
        "bufferViews": [{"byteLength": 12}],
    }
    rest = struct.pack("<I4s", 12, b"BIN\0") + corners.tobytes()
    ((item,), _) = read_scene(packed(data, rest), Limits())
    expected = np.maximum(corners / 127.0, -1.0) @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    assert item.vertices == pytest.approx(expected)
    data["accessors"][0].pop("normalized")
    ((item,), _) = read_scene(packed(data, rest), Limits())
    assert item.vertices == pytest.approx(corners @ [[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
