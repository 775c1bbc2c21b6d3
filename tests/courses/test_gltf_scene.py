"""Reading of glTF scenes: transforms, arrays, scenes, exact vertices, and hostile files."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from minigolf_env.courses import CourseError, load_course
from minigolf_env.courses.io.gltf_scene import EXACT_VERTICES_KEY, SceneObject, read_scene
from minigolf_env.courses.io.gltf_writer import write_scene
from minigolf_env.courses.schema.limits import Limits
from tests.cost import measure_memory
from tests.courses.scenes import packed, solid, unpacked


def test_parent_transforms_apply_to_children() -> None:
    """The transform of a parent applies to its children; a cycle of parents is an error."""
    content = write_scene([solid("a", (1, 1, 1), (0, 0, 0)), SceneObject("b", (0.0, 0.0, 0.0), {}, None, None)], {})
    data, rest = unpacked(content)
    data["nodes"][1] |= {"children": [0], "translation": [1.0, 2.0, 3.0], "scale": [2.0, 2.0, 2.0]}
    data["scenes"][0]["nodes"] = [1]
    objects, _ = read_scene(packed(data, rest), Limits())
    assert [item.name for item in objects] == ["b", "a"] and objects[1].vertices is not None
    assert np.allclose(objects[1].vertices.mean(axis=0), [1.0, -3.0, 2.0])
    assert np.allclose(np.ptp(objects[1].vertices, axis=0), 2.0)
    data["nodes"][0]["children"] = [1]
    with pytest.raises(CourseError, match="node 1 is referenced twice or nested"):
        read_scene(packed(data, rest), Limits())


@pytest.mark.parametrize("seed", range(6))
def test_node_transforms_match_trimesh(seed: int) -> None:
    """Translations, rotations, scales and matrices of nested and mirrored nodes give trimesh's vertices."""
    rng = np.random.default_rng(seed)
    content = write_scene([solid(name, (1, 2, 3), (0.1, 0.2, 0.3)) for name in "abc"], {})
    data, rest = unpacked(content)
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
    file = packed(data, rest)
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
        (lambda d: d["accessors"][0].update(componentType=5125), "accessor 0 has a wrong component type"),
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
        (lambda d: d["nodes"][0].update(scale=[1e7, 1, 1]), "its transform exceeds 1e"),
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
    data, rest = unpacked(content)

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


def test_limits_count_each_use_of_an_array(tmp_path: Path) -> None:
    """A small file that repeats an array cannot allocate terabytes; its JSON has the limit of text."""
    content = write_scene([solid("a", (1, 1, 1), (0, 0, 0))], {})
    data, rest = unpacked(content)
    data["accessors"][0]["count"] = corners = 10_000
    data["bufferViews"].append({"buffer": 0, "byteOffset": 0, "byteLength": 12 * corners})
    data["accessors"][0]["bufferView"] = len(data["bufferViews"]) - 1
    data["meshes"][0]["primitives"] *= 10_000
    path = tmp_path / "again.glb"
    binary = rest[8:].ljust(12 * corners, b"\0")
    path.write_bytes(packed(data, struct.pack("<I4s", len(binary), b"BIN\0") + binary))
    with measure_memory() as memory, pytest.raises(CourseError, match="expected at most 20000 triangles"):
        load_course(path, limits=Limits(triangles=20_000))
    assert memory.peak < 30e6
    with pytest.raises(CourseError, match="JSON in it: expected at most 100 bytes"):
        load_course(path, limits=Limits(text_bytes=100))


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


def test_default_scene_is_read() -> None:
    """The default one of several scenes is read. A file without scenes has all nodes, each once."""
    nodes = [{"name": "a", "children": [2]}, {"name": "b"}, {"name": "c"}]
    for fields, names in (
        ({}, "acb"),
        ({"scenes": []}, "acb"),
        ({"scenes": [{"nodes": [1]}]}, "b"),
        ({"scenes": [{"nodes": [1]}, {"nodes": [0], "extras": {"par": 3}}], "scene": 1}, "ac"),
        ({"scenes": [{}]}, ""),
    ):
        objects, extras = read_scene(packed({"nodes": nodes} | fields, b""), Limits())
        assert "".join(item.name for item in objects) == names
        assert extras == ({"par": 3} if "scene" in fields else {})
    for fields, message in (
        ({"scenes": [{"nodes": [1]}, {"nodes": [0]}]}, "2 scenes, and none is the default"),
        ({"scenes": [{"nodes": [1]}], "scene": -1}, r"scenes\[-1\] does not exist"),
        ({"scenes": [{"nodes": [True]}]}, r"nodes\[True\] does not exist"),
        ({"scenes": [{"nodes": [-1]}]}, r"nodes\[-1\] does not exist; the file has 3 nodes"),
        ({"scenes": [{"nodes": [1, 1]}]}, "node 1 is referenced twice"),
    ):
        with pytest.raises(CourseError, match=message):
            read_scene(packed({"nodes": nodes} | fields, b""), Limits())


@pytest.mark.parametrize("data", [[], 7, None, "glTF"])
def test_rejects_json_that_is_no_object(data: Any) -> None:
    """The JSON chunk has to be an object."""
    with pytest.raises(CourseError, match="the JSON chunk is not an object"):
        read_scene(packed(data, b""), Limits())


def test_unnamed_nodes_are_named_by_number() -> None:
    """An empty name is none."""
    objects, _ = read_scene(packed({"nodes": [{"name": ""}, {}]}, b""), Limits())
    assert [item.name for item in objects] == ["node 0", "node 1"]
