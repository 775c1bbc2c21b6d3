"""Mesh files that courses name: safe paths, formats, and the cost of hostile files."""

from __future__ import annotations

import os
import random
import struct
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh

from minigolf_env.courses import CourseError, load_course
from minigolf_env.courses.io.mesh_files import read_mesh
from minigolf_env.courses.io.toml_course import build_course, parse_description
from minigolf_env.courses.schema.limits import Limits
from minigolf_env.physics import TriangleMesh
from tests.cost import measure_memory

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
    "name", ["../slab.obj", "/etc/passwd", "C:/slab.obj", "a/../../slab.obj", "link.obj", "loop.obj", "x.py", "no.obj"]
)
def test_rejects_mesh_files_outside_course_folder(name: str, tmp_path: Path) -> None:
    """Dots, roots, drives and links that lead out of the folder, and other kinds of files, are errors."""
    (tmp_path / "slab.obj").write_text("v 0 0 0\n")
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "link.obj").symlink_to(tmp_path / "slab.obj")
    (inner / "loop.obj").symlink_to(inner / "loop.obj")
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
    with measure_memory() as memory, pytest.raises(CourseError):
        load_course(tmp_path / "m.toml", limits=Limits(triangles=10_000))
    assert memory.peak < 120 * size + 5e6
    if name != "binary.stl":
        with pytest.raises(CourseError, match="expected at most 10 bytes"):
            load_course(tmp_path / "m.toml", limits=Limits(text_bytes=10))
    with pytest.raises(CourseError, match="expected at most 20 bytes"):
        load_course(tmp_path / "m.toml", limits=Limits(file_bytes=20))


def read(content: str | bytes, ending: str, folder: Path) -> trimesh.Trimesh:
    """Return the mesh in a file of this content."""
    (folder / f"m.{ending}").write_bytes(content.encode("latin-1") if isinstance(content, str) else content)
    return read_mesh(f"m.{ending}", folder, Limits())


def is_box(mesh: trimesh.Trimesh, volume: float) -> bool:
    """Return whether a mesh is closed, wound outwards, and has this volume."""
    solid = TriangleMesh(mesh.vertices, mesh.faces)
    return solid.is_closed and abs(solid.volume - volume) < 1e-6


def test_groups_colours_comments_and_line_ends_do_not_change_the_mesh(tmp_path: Path) -> None:
    """Textures, normals, groups, comments, tabs, continued lines, line ends and a byte order mark are read over."""
    box = trimesh.creation.box((2, 2, 0.2))
    lines = [
        "mtllib ../m.mtl",
        *(f"v {x}\t{y} {z} 1 0 0 # caf\u00e9" for x, y, z in box.vertices),
        "vt 0 0",
        "vn 0 0 1",
    ]
    for k, face in enumerate(box.faces + 1):
        lines += [f"g {k}", f"usemtl {k}", "l 1 2", "f\t" + " \\\n".join(f"{corner}/1/1" for corner in face)]
    solids = box.export(file_type="stl_ascii").replace("endfacet", "endfacet\nendsolid a\nsolid b")
    texts = [
        ("\n".join(lines), "obj"),
        (solids, "stl"),
        (solids.upper(), "stl"),
        ("\u00ef\u00bb\u00bf" + "\n".join(lines), "obj"),
    ]
    for text, ending in [(text.replace("\n", end), ending) for text, ending in texts for end in ("\n", "\r\n", "\r")]:
        assert is_box(read(text, ending, tmp_path), 0.8)


L_SHAPE = [(2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 0)]
"""Corners of a concave polygon of area 3, the notch at (1..2, 1..2)."""


def prism(outline: list[tuple[float, float]]) -> tuple[list[tuple[float, ...]], list[list[int]]]:
    """Return the vertices and polygons of an upright prism of height 1, as modelling programs write them."""
    n = len(outline)
    vertices = [(*corner, z) for z in (0.0, 1.0) for corner in outline]
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    return vertices, [list(range(n, 2 * n)), list(range(n))[::-1], *sides]


def as_obj(vertices: list[tuple[float, ...]], polygons: list[list[int]]) -> str:
    """Return the text of an .obj file."""
    rows = [f"v {x} {y} {z}" for x, y, z in vertices]
    return "\n".join([*rows, *("f " + " ".join(str(k + 1) for k in polygon) for polygon in polygons)])


def as_ply(vertices: list[tuple[float, ...]], polygons: list[list[int]], order: str, colours: bool = False) -> bytes:
    """Return the content of a .ply file: order "" for text, "<" or ">" for binary numbers."""
    kind = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    rgb = "property uchar red\nproperty uchar green\n" if colours else ""
    header = (
        f"ply\nformat {kind} 1.0\ncomment TextureFile colours.png\nelement vertex {len(vertices)}\n"
        f"property float x\nproperty float y\nproperty float z\n{rgb}element face {len(polygons)}\n{rgb}"
        "property list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nend_header\n"
    )
    extra = [9, 8] if colours else []
    if not order:
        rows = [[*vertex, *extra] for vertex in vertices] + [[*extra, len(p), *p] for p in polygons] + [[0]]
        return (header + "\n".join(" ".join(map(str, row)) for row in rows)).encode()
    colour = struct.pack(f"{len(extra)}B", *extra)
    body = b"".join(struct.pack(f"{order}3f", *vertex) + colour for vertex in vertices)
    body += b"".join(colour + struct.pack(f"{order}B{len(p)}i", len(p), *p) for p in polygons)
    return header.encode() + body + struct.pack(f"{order}i", 0)


ON_EDGES = [(2, 0), (2, 0.5), (2, 1), (1, 1), (1, 2), (0.5, 2), (0, 2), (0, 2), (0, 0), (1, 0)]
"""The same polygon with corners on straight edges and a repeated one."""

OUTLINES = {"concave": L_SHAPE, "on edges": ON_EDGES, "turned": [(-y, x) for x, y in L_SHAPE[2:] + L_SHAPE[:2]]}


@pytest.mark.parametrize("ending", ["obj", "ply", "<ply", ">ply", "colours ply", "<colours ply"])
@pytest.mark.parametrize("outline", OUTLINES)
def test_polygons_of_a_file_are_filled_exactly(outline: str, ending: str, tmp_path: Path) -> None:
    """A concave polygon, also with corners on its edges, becomes triangles of its own area that fit its neighbours."""
    solid = prism(OUTLINES[outline])
    order = ending[0] if ending[0] in "<>" else ""
    content = as_obj(*solid) if ending == "obj" else as_ply(*solid, order, "colours" in ending)
    mesh = read(content, ending[-3:], tmp_path)
    assert is_box(mesh, 3.0)
    tops = mesh.triangles[(mesh.triangles[:, :, 2] == 1.0).all(axis=1)]
    assert shapely.area(shapely.polygons(tops[:, :, :2])).sum() == pytest.approx(3.0)


def test_slanted_polygon_is_filled_along_its_normal(tmp_path: Path) -> None:
    """A concave polygon in any plane has its own area."""
    rotation = trimesh.transformations.rotation_matrix(1.0, (1, 2, 3))[:3, :3]
    vertices, polygons = prism(L_SHAPE)
    turned = [tuple(rotation @ vertex) for vertex in np.array(vertices)]
    assert is_box(read(as_obj(turned, polygons), "obj", tmp_path), 3.0)


def test_polygon_whose_edges_cross_is_an_error_with_its_line(tmp_path: Path) -> None:
    """A polygon that crosses itself has no inside; the message names its line or face."""
    vertices, polygons = prism([(0, 0), (2, 0), (0, 1), (2, 1), (3, 3)])
    with pytest.raises(CourseError, match="line 11: expected a polygon whose edges do not cross"):
        read(as_obj(vertices, polygons), "obj", tmp_path)
    with pytest.raises(CourseError, match="face 0: expected a polygon"):
        read(as_ply(vertices, polygons, "<"), "ply", tmp_path)
    bow_tie = prism([(0, 0), (1, 1), (1, 0), (0, 1)])  # Its halves have opposite areas.
    with pytest.raises(CourseError, match="line 9: expected a polygon whose edges do not cross"):
        read(as_obj(*bow_tie), "obj", tmp_path)


def test_polygon_with_a_hole_through_a_double_edge_is_filled_exactly(tmp_path: Path) -> None:
    """A polygon may reach its hole along an edge and return along it."""
    corners = [(0, 0), (4, 0), (4, 4), (0, 4), (1, 1), (1, 3), (3, 3), (3, 1)]
    vertices = [(*corner, z) for z in (0.0, 1.0) for corner in corners]
    ring = [0, 1, 2, 3, 0, 4, 5, 6, 7, 4]
    loops = [[0, 1, 2, 3], [4, 5, 6, 7]]
    edges = [edge for loop in loops for edge in zip(loop, loop[1:] + loop[:1], strict=True)]
    polygons = [[k + 8 for k in ring], ring[::-1], *([a, b, b + 8, a + 8] for a, b in edges)]
    assert is_box(read(as_obj(vertices, polygons), "obj", tmp_path), 12.0)


def test_comment_that_ends_with_a_backslash_does_not_hide_the_next_line(tmp_path: Path) -> None:
    """Programs write folders into comments."""
    solid = as_obj(*prism([(0, 0), (1, 0), (1, 1), (0, 1)]))
    assert is_box(read("# C:\\models\\\n" + solid, "obj", tmp_path), 1.0)


def test_relative_obj_indices_count_back_from_their_line(tmp_path: Path) -> None:
    """Each object of a file may refer to its own vertices by negative indices, with textures and normals or without."""
    vertices, polygons = prism([(0, 0), (1, 0), (1, 1), (0, 1)])
    blocks = []
    for shift in (0.0, 5.0):
        blocks += [f"o {shift}", *(f"v {x + shift} {y} {z}" for x, y, z in vertices), "vt 0 0"]
        blocks += ["f " + " ".join(f"{k - 8}/-1/" for k in polygon) for polygon in polygons]
    parts = read("\n".join(blocks), "obj", tmp_path).split()
    assert [tuple(part.bounds[:, 0]) for part in sorted(parts, key=lambda part: part.bounds[0, 0])] == [(0, 1), (5, 6)]
    assert all(is_box(part, 1.0) for part in parts)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("f 1 2", "line 4: expected three or more"),
        ("f 0 1 2", "line 4: expected three or more vertices, counted from 1"),
        ("f 1 2 9", "line 4: expected one of 3 vertices"),
        ("f -4 1 2", "line 4: expected one of 3 vertices"),
        ("f 1 2 x", "line 4: expected x, y, z or the numbers"),
        ("v 1 2", "line 4: expected x, y, z"),
    ],
)
def test_fault_in_an_obj_file_names_its_line(line: str, message: str, tmp_path: Path) -> None:
    """The message says which line, what was expected and what was received."""
    with pytest.raises(CourseError, match=message):
        read(TRIANGLE + line + "\n", "obj", tmp_path)


def test_binary_stl_count_must_agree_with_the_length(tmp_path: Path) -> None:
    """Bytes after the last triangle are read over; a count of zero or beyond the file is an error that names it."""
    whole = trimesh.creation.box((2, 2, 0.2)).export(file_type="stl")
    assert is_box(read(whole + b"\0\0", "stl", tmp_path), 0.8)
    assert is_box(read(b"solid vertex".ljust(80) + whole[80:], "stl", tmp_path), 0.8)
    for count in (0, 13, 2**31):
        with pytest.raises(CourseError, match=f"the {count} triangles that the header counts .* enough for 12"):
            read(whole[:80] + count.to_bytes(4, "little") + whole[84:], "stl", tmp_path)
    with pytest.raises(CourseError, match=r"expected an \.stl file of 84 bytes or more, .* received 40 bytes"):
        read(whole[:40], "stl", tmp_path)


@pytest.mark.parametrize("start", ["", "# made by hand\n", "\n\n", "Solid part\n", "facets\n"])
@pytest.mark.parametrize("word", ["vertex", "Vertex", "VERTEX"])
def test_text_stl_may_begin_with_anything(start: str, word: str, tmp_path: Path) -> None:
    """A text is told from a binary file by its vertices, not by its first word."""
    text = trimesh.creation.box((2, 2, 0.2)).export(file_type="stl_ascii").split("\n", 1)[1]
    assert is_box(read(start + text.replace("vertex", word), "stl", tmp_path), 0.8)


def test_numbers_of_a_text_stl_take_memory_in_proportion(tmp_path: Path) -> None:
    """One long number does not make all others as long."""
    text = "solid\n" + "vertex 0 0 0\n" * 2_997 + f"vertex {'0' * 100_000} 0 0\n" * 3
    with measure_memory() as memory:
        read(text, "stl", tmp_path)
    assert memory.peak < 100 * len(text)


@pytest.mark.parametrize("number", ["nan", "inf", "2.5", "12", "-1"])
def test_ply_index_that_is_no_vertex_is_an_error_that_names_its_face(number: str, tmp_path: Path) -> None:
    """A text may hold any number in place of an index."""
    text = as_ply(*prism(L_SHAPE), "").decode()
    first = text.index("\n6 ") + 1
    with pytest.raises(CourseError, match="face 0: expected three or more of 12 vertices"):
        read(text[:first] + "6 6 7 8 9 10 " + number + text[text.index("\n", first) :], "ply", tmp_path)


@pytest.mark.parametrize("length", ["nan", "inf", "1e300"])
def test_ply_list_of_impossible_length_is_an_error(length: str, tmp_path: Path) -> None:
    """A text may hold any number in place of the length of a list."""
    text = as_ply(*prism(L_SHAPE), "").decode()
    with pytest.raises(CourseError, match=r"expected 8 rows of an element of a \.ply file, received fewer or others"):
        read(text.replace("\n6 ", f"\n{length} ", 1), "ply", tmp_path)


def test_ply_element_without_properties_has_no_rows_to_read(tmp_path: Path) -> None:
    """The count of such an element costs neither time nor memory."""
    text = as_ply(*prism(L_SHAPE), "").decode().replace("element vertex", "element none 400000\nelement vertex")
    with measure_memory() as memory:
        assert is_box(read(text, "ply", tmp_path), 3.0)
    assert memory.peak < 2e6


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("element vertex 3\nproperty float x\n", "x or y or z of each vertex"),
        ("element vertex x\n", "a line of a .ply header"),
        ("element face 1\nproperty int vertex_indices\n", "of each face"),
        ("element vertex 1\nproperty float128 x\n", "a line of a .ply header"),
    ],
)
def test_fault_in_a_ply_header_is_named(header: str, message: str, tmp_path: Path) -> None:
    """The message says what is missing."""
    with pytest.raises(CourseError, match=message):
        read(f"ply\nformat ascii 1.0\n{header}end_header\n0 0 0\n", "ply", tmp_path)


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
