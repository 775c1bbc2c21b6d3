"""Shells of a mesh part: a ball meets each from outside, whatever way a program wound it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from trimesh import Trimesh

from minigolf_env.courses import CourseError
from minigolf_env.courses.geometry.shells import MAX_NESTED_SHELLS, orient_shells
from minigolf_env.courses.io.toml_course import build_course, validate_description


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


def test_too_many_nested_shells_are_an_error() -> None:
    """The number of pairs that are compared is bounded, so that a small file cannot take minutes."""
    count = int(np.sqrt(2 * MAX_NESTED_SHELLS)) + 2
    with pytest.raises(CourseError, match="pieces of a mesh over or within each other"):
        orient_shells(join(*(box(1.0 + k) for k in range(count))))


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
