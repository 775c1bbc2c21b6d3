"""What is sent to the graphics card is the course: every triangle, once, with sensible normals."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from minigolf_env.courses import Course, Part, Tee, load_course
from minigolf_env.physics import TriangleMesh
from minigolf_env.rendering.course_geometry import MAX_CHUNK_TRIANGLES, build_course_geometry, part_corners


def part(mesh: trimesh.Trimesh, material: str = "stone") -> Part:
    """Return a mesh as a part of a course."""
    return Part("thing", TriangleMesh(mesh.vertices, mesh.faces), material)  # type: ignore[arg-type]


def course_of(*parts: Part) -> Course:
    """Return a course of parts, without golf."""
    bounds = ((-20.0, -20.0, -20.0), (20.0, 20.0, 20.0))
    return Course("test", parts, Tee((9, 9), (9, 9), 9.0), None, None, bounds, (), 1.0)


@pytest.mark.parametrize("name", ["dogleg", "room"])
def test_every_triangle_is_drawn_once_and_looks_the_same_way(name: str) -> None:
    """As sets, the triangles of scene and course agree, winding included."""
    course = load_course(name)
    geometry = build_course_geometry(course)
    drawn = geometry.vertices["position"][geometry.indices.reshape(-1, 3)].astype(np.float32)
    given = np.concatenate([p.mesh.triangles for p in course.parts]).astype(np.float32)
    assert sorted(map(bytes, drawn)) == sorted(map(bytes, given))


def test_triangles_without_area_are_left_out() -> None:
    """They have no normal and no pixels."""
    box = trimesh.creation.box()
    faces = np.concatenate([box.faces, [[0, 0, 1], [0, 1, 1]]])
    thing = Part("thing", TriangleMesh(box.vertices, faces), "stone")
    assert len(part_corners(thing)) == 12


def test_a_box_has_edges_and_a_ball_has_none() -> None:
    """Normals of a box are its faces'; those of a fine sphere point away from its middle, to the size of its facets."""
    corners = part_corners(part(trimesh.creation.box()))
    faces = np.cross(
        corners["position"][:, 1] - corners["position"][:, 0], corners["position"][:, 2] - corners["position"][:, 0]
    )
    np.testing.assert_allclose(corners["normal"], np.repeat(faces[:, None], 3, axis=1), atol=1e-6)
    ball = part_corners(part(trimesh.creation.icosphere(subdivisions=4)))
    np.testing.assert_allclose(ball["normal"], ball["position"], atol=0.01)


def test_wood_has_a_grain_along_the_board() -> None:
    """Both halves of each face of a board get the direction of its long side."""
    corners = part_corners(part(trimesh.creation.box((3.0, 0.2, 0.1)), "wood"))
    sides = np.abs(corners["normal"][:, 0, 0]) < 0.5
    np.testing.assert_allclose(np.abs(corners["grain"][sides][:, 0, 0]), 1.0, atol=1e-3)
    assert not part_corners(part(trimesh.creation.box()))["grain"].any()


def test_large_meshes_come_in_chunks_within_their_boxes() -> None:
    """No chunk has more than MAX_CHUNK_TRIANGLES triangles; together they are everything; each lies in its box."""
    geometry = build_course_geometry(course_of(part(trimesh.creation.icosphere(subdivisions=5, radius=3.0))))
    assert len(geometry.chunks) > 4 and max(chunk.size for chunk in geometry.chunks) <= 3 * MAX_CHUNK_TRIANGLES
    assert sum(chunk.size for chunk in geometry.chunks) == len(geometry.indices) == 3 * 20480
    for chunk in geometry.chunks:
        points = geometry.vertices["position"][geometry.indices[chunk.start : chunk.start + chunk.size]]
        assert (points >= chunk.lower - 1e-6).all() and (points <= chunk.upper + 1e-6).all()
    # Neighbours: chunks are much smaller than the whole.
    assert np.mean([np.ptp([c.lower, c.upper], axis=0)[:2].max() for c in geometry.chunks]) < 4.0
