"""Mesh files that courses name: safe paths, formats, and the cost of hostile files."""

from __future__ import annotations

import io
import os
import random
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh

from minigolf_env.courses import CourseError, load_course
from minigolf_env.courses.io.mesh_files import _keep_triangles_only
from minigolf_env.courses.io.toml_course import build_course, parse_description
from minigolf_env.courses.schema.limits import Limits

MESH = 'name = "m"\ntee = {{ at = [0, 0] }}\n[[parts]]\nkind = "mesh"\nfile = "{}"\n'


@pytest.mark.parametrize("ending", ["obj", "stl", "ply", "glb"])
def test_mesh_part_loads_every_format_with_scale_turn_and_position(ending: str, tmp_path: Path) -> None:
    """Each format gives the same solid."""
    trimesh.creation.box((2, 2, 0.2)).export(tmp_path / f"slab.{ending}")
    (tmp_path / "m.toml").write_text(MESH.format(f"slab.{ending}") + "scale = 0.5\nturn = 90\nat = [0, 0, -0.05]\n")
    vertices = load_course(tmp_path / "m.toml").parts[0].mesh.vertices
    sides = np.ptp(vertices, axis=0)
    assert np.allclose(np.sort(sides), [0.1, 1.0, 1.0], atol=1e-6)


def test_changed_mesh_file_is_loaded_again(tmp_path: Path) -> None:
    """A course is loaded again when its mesh file changes, even if its course file does not."""
    (tmp_path / "m.toml").write_text(MESH.format("slab.stl"))
    slab = tmp_path / "slab.stl"
    heights = []
    for age, height in enumerate((0.2, 0.4)):
        trimesh.creation.box((2, 2, height)).export(slab)
        os.utime(slab, (age, age))
        course = load_course(tmp_path / "m.toml")
        assert load_course(tmp_path / "m.toml") is course
        heights.append(np.ptp(course.parts[0].mesh.vertices[:, 2]))
    np.testing.assert_allclose(heights, (0.2, 0.4))


@pytest.mark.parametrize(
    "name", ["../slab.obj", "/etc/passwd", "C:/slab.obj", "a/../../slab.obj", "link.obj", "x.py", "no.obj"]
)
def test_rejects_mesh_files_outside_course_folder(name: str, tmp_path: Path) -> None:
    """Dots, roots, drives and links that lead out of the folder, and other kinds of files, are errors."""
    (tmp_path / "slab.obj").write_text("v 0 0 0\n")
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "link.obj").symlink_to(tmp_path / "slab.obj")
    (inner / "m.toml").write_text(MESH.format(name))
    with pytest.raises(CourseError, match="file: expected"):
        load_course(inner / "m.toml")


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
PLY = (
    "ply\nformat {}\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar uchar i\nend_header\n"
)
FLAT = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
HOSTILE = {
    "faces.obj": TRIANGLE + "f 1 2 3\n" * 40_000,
    "polygon.obj": TRIANGLE + "f" + " 1 2 3" * 150_000,
    "groups.obj": TRIANGLE * 10_000 + "".join(f"usemtl {k}\no {k}\nf 1 2 3\n" for k in range(20_000)),
    "beyond.obj": TRIANGLE + "f 1 2 4000000000\n",
    "nan.obj": TRIANGLE.replace("1", "nan") + "f 1 2 3\n",
    "far.obj": TRIANGLE.replace("1", "1e308") + "f 1 2 3\n",
    "empty.obj": "\n" * 900_000,
    "count.stl": b"x" * 80 + b"\xff" * 4 + bytes(50),
    "solids.stl": "solid\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendsolid\n" * 15_000,
    "binary.stl": bytes(80) + (20_000).to_bytes(4, "little") + bytes(50 * 20_000),
    "text.ply": PLY.format("ascii 1.0", 40_000) + "0 0 0\n1 0 0\n0 1 0\n" + "3 0 1 2\n" * 40_000,
    "polygon.ply": PLY.format("binary_little_endian 1.0", 3900).encode() + FLAT + (b"\xff" + b"\0\1\2" * 85) * 3900,
    "count.ply": PLY.format("binary_little_endian 1.0", 2_000_000_000).encode() + FLAT + b"\3\0\1\2",
    "nothing.ply": "ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nend_header\n",
    "properties.ply": "ply\nformat ascii 1.0\nelement vertex 1\n" + "property float x\n" * 50_000 + "end_header\n",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_mesh_file_takes_at_most_about_hundred_times_its_size(name: str, tmp_path: Path) -> None:
    """Reading takes bounded memory whatever the file claims; a limit bounds the file's size."""
    content = HOSTILE[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    (tmp_path / "m.toml").write_text(MESH.format(name))
    size = (tmp_path / name).stat().st_size
    assert size < 1.2e6
    tracemalloc.start()
    with pytest.raises(CourseError):
        load_course(tmp_path / "m.toml", limits=Limits(triangles=10_000))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 120 * size + 5e6
    if name != "binary.stl":
        with pytest.raises(CourseError, match="expected at most 10 bytes"):
            load_course(tmp_path / "m.toml", limits=Limits(text_bytes=10))
    with pytest.raises(CourseError, match="expected at most 20 bytes"):
        load_course(tmp_path / "m.toml", limits=Limits(file_bytes=20))


def test_obj_groups_and_stl_solids_are_merged_before_reading() -> None:
    """Groups would cost a pass each; textures, normals, comments, continued lines and all line ends are accepted."""
    box = trimesh.creation.box((2, 2, 0.2))
    lines = ["mtllib ../m.mtl", *(f"v {x} {y} {z} 1 0 0 # caf\u00e9" for x, y, z in box.vertices), "vt 0 0", "vn 0 0 1"]
    for k, face in enumerate(box.faces + 1):
        lines += [f"g {k}", f"usemtl {k}", "f " + " \\\n".join(f"{corner}/1/1" for corner in face)]
    solids = box.export(file_type="stl_ascii").replace("endfacet", "endfacet\nendsolid a\nsolid b")
    texts = [("\n".join(lines), "obj"), (solids, "stl")]
    for text, ending in [(text.replace("\n", end), ending) for text, ending in texts for end in ("\n", "\r\n", "\r")]:
        alone = _keep_triangles_only(text.encode("latin-1"), f".{ending}")
        assert not {b"g", b"usemtl", b"mtllib"} & set(alone.split()) and alone.count(b"endsolid") == (ending == "stl")
        mesh = trimesh.load_mesh(io.BytesIO(alone), ending)
        assert mesh.is_watertight and mesh.volume == pytest.approx(box.volume) and len(mesh.faces) == 12


@pytest.mark.parametrize("ending", ["obj", "stl", "ascii.stl", "ply", "ascii.ply"])
def test_mutated_mesh_files_load_or_raise_course_error(ending: str, tmp_path: Path) -> None:
    """Changed bytes in a mesh file raise no other exception."""
    box, rng, refused = trimesh.creation.box((2, 2, 0.2)), random.Random(0), 0  # noqa: S311 (not for secrets)
    whole = {
        "obj": lambda: box.export(file_type="obj").encode(),
        "stl": lambda: box.export(file_type="stl"),
        "ascii.stl": lambda: box.export(file_type="stl_ascii").encode(),
        "ply": lambda: box.export(file_type="ply"),
        "ascii.ply": lambda: box.export(file_type="ply", encoding="ascii"),
    }[ending]()
    for _ in range(200):
        content = bytearray(whole[: rng.choice([len(whole), len(whole), rng.randrange(len(whole))])])
        for _ in range(rng.randint(1, 6)):
            if content:
                content[rng.randrange(len(content))] = rng.choice(b"0129- ef/\n\x00\xff")
        (tmp_path / f"m.{ending[-3:]}").write_bytes(bytes(content))
        try:
            build_course(parse_description(MESH.format(f"m.{ending[-3:]}")), tmp_path, limits=Limits(triangles=10_000))
        except CourseError:
            refused += 1
    assert refused > 50
