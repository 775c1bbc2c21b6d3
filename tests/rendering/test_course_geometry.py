"""The vertex arrays of a course have every triangle once, with smooth normals where faces meet gently."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from minigolf_env.courses import Course, Part, Tee, load_course
from minigolf_env.physics import TriangleMesh
from minigolf_env.rendering.course_geometry import MAX_CHUNK_TRIANGLES, build_course_geometry, part_corners


def make_part(mesh: trimesh.Trimesh, material: str = "stone") -> Part:
    """Return a mesh as a part of a course."""
    return Part("thing", TriangleMesh(mesh.vertices, mesh.faces), material)  # type: ignore[arg-type]


def make_course(*parts: Part) -> Course:
    """Return a course of some parts, without a cup."""
    bounds = ((-20.0, -20.0, -20.0), (20.0, 20.0, 20.0))
    return Course("test", parts, Tee((9, 9), (9, 9), 9.0), None, None, bounds, (), 1.0)


@pytest.mark.parametrize("name", ["dogleg", "room"])
def test_geometry_has_every_triangle_once_with_its_winding(name: str) -> None:
    """The sorted triangles of the vertex arrays and of the course are equal."""
    course = load_course(name)
    geometry = build_course_geometry(course)
    drawn = geometry.vertices["position"][geometry.indices.reshape(-1, 3)].astype(np.float32)
    given = np.concatenate([p.mesh.triangles for p in course.parts]).astype(np.float32)
    assert sorted(map(bytes, drawn)) == sorted(map(bytes, given))


def test_triangles_without_area_are_left_out() -> None:
    """Triangles without area, which have no normal, are not in the vertex arrays."""
    box = trimesh.creation.box()
    faces = np.concatenate([box.faces, [[0, 0, 1], [0, 1, 1]]])
    thing = Part("thing", TriangleMesh(box.vertices, faces), "stone")
    assert len(part_corners(thing)) == 12


def test_box_has_flat_normals_and_sphere_has_smooth_normals() -> None:
    """Normals of a box are those of its faces; those of a fine sphere point away from its centre."""
    corners = part_corners(make_part(trimesh.creation.box()))
    faces = np.cross(
        corners["position"][:, 1] - corners["position"][:, 0], corners["position"][:, 2] - corners["position"][:, 0]
    )
    np.testing.assert_allclose(corners["normal"], np.repeat(faces[:, None], 3, axis=1), atol=1e-6)
    ball = part_corners(make_part(trimesh.creation.icosphere(subdivisions=4)))
    np.testing.assert_allclose(ball["normal"], ball["position"], atol=0.01)


def test_grain_of_wood_follows_the_long_side_of_the_board() -> None:
    """Both triangles of each face have the same direction; other materials have none."""
    corners = part_corners(make_part(trimesh.creation.box((3.0, 0.2, 0.1)), "wood"))
    sides = np.abs(corners["normal"][:, 0, 0]) < 0.5
    np.testing.assert_allclose(np.abs(corners["grain"][sides][:, 0, 0]), 1.0, atol=1e-3)
    assert not part_corners(make_part(trimesh.creation.box()))["grain"].any()


def test_large_meshes_are_split_into_small_chunks_with_bounding_boxes() -> None:
    """Chunks have at most MAX_CHUNK_TRIANGLES triangles, contain all of them, and are much smaller than the course."""
    geometry = build_course_geometry(make_course(make_part(trimesh.creation.icosphere(subdivisions=5, radius=3.0))))
    assert len(geometry.chunks) > 4 and max(chunk.size for chunk in geometry.chunks) <= 3 * MAX_CHUNK_TRIANGLES
    assert sum(chunk.size for chunk in geometry.chunks) == len(geometry.indices) == 3 * 20480
    for chunk in geometry.chunks:
        points = geometry.vertices["position"][geometry.indices[chunk.start : chunk.start + chunk.size]]
        assert (points >= chunk.lower - 1e-6).all() and (points <= chunk.upper + 1e-6).all()
    # A chunk is much smaller than the course.
    assert np.mean([np.ptp([c.lower, c.upper], axis=0)[:2].max() for c in geometry.chunks]) < 4.0
