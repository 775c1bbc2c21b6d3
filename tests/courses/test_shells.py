"""Shells of a mesh part: a ball meets each from outside, whatever way a program wound it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
import trimesh
from trimesh import Trimesh

from minigolf_env.courses import CourseError
from minigolf_env.courses.geometry import shells
from minigolf_env.courses.geometry.shells import orient_shells
from minigolf_env.courses.io.toml_course import build_course, validate_description
from minigolf_env.physics import TriangleMesh


def box(size: float, x: float = 0.0, inverted: bool = False) -> Trimesh:
    """Return a cube around (x, 0, 0), wound outwards or inwards."""
    solid = trimesh.creation.box((size, size, size))
    solid.apply_translation((x, 0.0, 0.0))
    return Trimesh(solid.vertices, solid.faces[:, ::-1] if inverted else solid.faces, process=False)


def join(*solids: Trimesh) -> Trimesh:
    """Return several solids as one mesh, their faces mixed."""
    vertices, faces = trimesh.util.append_faces([s.vertices for s in solids], [s.faces for s in solids])
    return Trimesh(vertices, np.random.default_rng(0).permutation(faces), process=False)


@pytest.mark.parametrize("inverted", list(itertools.product([False, True], repeat=3)))
def test_shells_face_outwards_and_cavities_inwards(inverted: tuple[bool, bool, bool]) -> None:
    """Shells of any winding become the same two blocks, one of them hollow: volume 8 - 1 + 8."""
    mesh = orient_shells(join(box(2.0, 0.0, inverted[0]), box(1.0, 0.0, inverted[1]), box(2.0, 5.0, inverted[2])))
    assert mesh.volume == pytest.approx(15.0)
    volumes = sorted(float(shell.volume) for shell in mesh.split(only_watertight=False))
    assert volumes == pytest.approx([-1.0, 8.0, 8.0])


def test_shells_that_only_touch_or_overlap_are_both_outside() -> None:
    """A shell that reaches out of another, or touches it from inside, is no cavity."""
    small = box(1.0, 0.5)  # Flush with the side of the large one.
    for other in (small, box(1.0, 1.2), box(2.0, 1.0)):
        assert orient_shells(join(box(2.0), other)).volume == pytest.approx(8.0 + other.volume)


def test_ball_bounces_off_every_shell_of_a_part() -> None:
    """A ball cannot enter a block because another of the same part is wound the other way."""
    posts = join(box(0.4, 2.0, inverted=True), box(0.4, 3.5), box(0.4, 5.0))
    part = {"kind": "mesh", "vertices": posts.vertices.tolist(), "faces": posts.faces.tolist()}
    lane = {"kind": "lane", "outline": [{"box": [-1, -1, 7, 1]}]}
    data = {"name": "c", "tee": {"at": [0, 0]}, "parts": [lane, part]}
    world = build_course(validate_description(data, "c")).world()
    shot = world.simulate((0.0, 0.0, world.ball_radius), (2.0, 0.0, 0.0), record=True)
    assert shot.path is not None and shot.bounces > 0
    assert 1.75 < shot.path[:, 0].max() < 1.8 - world.ball_radius + 1e-9


def block(low: tuple[float, float, float], inverted: bool) -> Trimesh:
    """Return a C-shaped block of volume 7 from a corner on, wound outwards or inwards."""
    outline = shapely.Polygon([(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (3, 2), (3, 3), (0, 3)])
    solid = trimesh.creation.extrude_polygon(outline, 1.0)
    return Trimesh(solid.vertices + low, solid.faces[:, ::-1] if inverted else solid.faces, process=False)


@pytest.mark.parametrize("inverted", list(itertools.product([False, True], repeat=3)))
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_shells_that_share_whole_faces_are_oriented_one_by_one(turn: float, inverted: tuple[bool, bool, bool]) -> None:
    """Blocks stacked face on face and cubes side by side are solid, however each is wound and the faces are mixed."""
    stack = join(*(block((0, 0, k), inverted[k]) for k in range(3)))
    row = join(*(box(1.0, k, inverted[k]) for k in range(3)))
    for mesh, volume in ((stack, 21.0), (row, 3.0)):
        mesh.apply_transform(trimesh.transformations.rotation_matrix(turn, (1, 2, 3)))
        merged = Trimesh(mesh.vertices, mesh.faces)  # As read from a file: vertices of different blocks are one.
        oriented = orient_shells(merged)
        assert TriangleMesh(oriented.vertices, oriented.faces).is_closed
        assert oriented.volume == pytest.approx(volume)


@pytest.mark.parametrize("inverted", [False, True])
def test_solid_of_repeated_faces_is_wound_outwards(inverted: bool) -> None:
    """A box each of whose faces is there twice is two boxes at one place, and no room."""
    cube = box(2.0, inverted=inverted)
    assert orient_shells(Trimesh(cube.vertices, np.tile(cube.faces, (2, 1)), process=False)).volume == pytest.approx(16)


def test_many_shells_over_or_on_a_large_one_are_no_error() -> None:
    """Two thousand stones above a slab, within its outline, lie outside it."""
    slab = trimesh.creation.box((200, 200, 1))
    stones = [box(0.5, k % 50) for k in range(2000)]
    for k, stone in enumerate(stones):
        stone.apply_translation((0.0, k // 50, 2.0))
    assert orient_shells(join(slab, *stones)).volume == pytest.approx(40_000 + 2000 * 0.125)


def test_cost_of_nested_shells_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mesh for which too many solid angles would have to be computed is an error before they are."""
    nested = join(*(box(1.0 + k) for k in range(10)))
    computed = 0
    winding_number = TriangleMesh.winding_number

    def count_solid_angles(mesh: TriangleMesh, points: np.ndarray) -> np.ndarray:
        nonlocal computed
        computed += len(points) * len(mesh.faces)
        return winding_number(mesh, points)

    monkeypatch.setattr(TriangleMesh, "winding_number", count_solid_angles)
    orient_shells(nested)
    assert computed == 45 * 12 * (1 + 8)  # Pairs, triangles of a box, and corners: the first, then all.
    monkeypatch.setattr(shells, "MAX_SOLID_ANGLES", computed // 2)
    computed = 0
    with pytest.raises(CourseError, match="few pieces lie within the boxes around others, received one of 10 pieces"):
        orient_shells(nested)
    assert 0 < computed <= shells.MAX_SOLID_ANGLES


def test_open_mesh_names_a_place_and_an_edge() -> None:
    """The message says where a hole is."""
    cube = box(2.0)
    part = {"kind": "mesh", "vertices": cube.vertices.tolist(), "faces": cube.faces[:-1].tolist()}
    data = {"name": "c", "tee": {"at": [0, 0]}, "parts": [part]}
    with pytest.raises(CourseError, match="closed solid, received one that is open") as error:
        build_course(validate_description(data, "c"))
    missing = cube.vertices[cube.faces[-1]]
    edges = [(tuple(missing[k].tolist()), tuple(missing[k - 1].tolist())) for k in range(3)]
    assert any(f"edge from {start} to {end}" in str(error.value) for start, end in edges)


def test_shells_without_volume_are_compared_with_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """A polygon that names one corner 3,000 times is that many triangles at one place."""
    monkeypatch.setattr(shells, "MAX_BOX_PAIRS", 10)
    points = Trimesh(np.zeros((3, 3)), np.zeros((3000, 3), np.int64), process=False)
    assert orient_shells(points) is points


def test_number_of_compared_shells_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Copies of a shell at one place are each in the others' boxes."""
    copies = join(*[box(1.0)] * 10)
    monkeypatch.setattr(shells, "_split_into_shells", lambda *_: np.arange(120).reshape(10, 12))
    monkeypatch.setattr(shells, "MAX_BOX_PAIRS", 100)
    orient_shells(copies)
    monkeypatch.setattr(shells, "MAX_BOX_PAIRS", 99)
    with pytest.raises(CourseError, match="few pieces lie within the boxes around others, received one of 10 pieces"):
        orient_shells(copies)


def test_corners_of_a_shell_are_sampled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A shell within many others is tested with the same corners in each."""
    sampled = []
    sample_corners = shells._sample_corners

    def count_samples(triangles: np.ndarray) -> np.ndarray:
        sampled.append(len(triangles))
        return sample_corners(triangles)

    monkeypatch.setattr(shells, "_sample_corners", count_samples)
    orient_shells(join(*(box(1.0 + k) for k in range(10))))
    assert sampled == [12] * 9
