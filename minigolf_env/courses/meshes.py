"""Meshes from files and lists, and the cup cut into a mesh that has a level top."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
import shapely
import trimesh
from trimesh import Trimesh

from minigolf_env.courses.course import CourseError, Cup
from minigolf_env.courses.description import Mesh
from minigolf_env.courses.limits import Limits
from minigolf_env.courses.solids import LINER, Outline, cup_hole
from minigolf_env.courses.terrain import triangulated

ENDINGS = (".obj", ".stl", ".ply", ".glb")

FARTHEST = 1000.0
"""Largest coordinate taken, m."""


def inline_mesh(record: Mesh, limits: Limits) -> Trimesh:
    """Return the mesh that a course file writes out."""
    vertices, faces = np.array(record.vertices, dtype=np.float64), np.array(record.faces, dtype=np.int64)
    limits.check_triangles(len(faces))
    if not len(faces) or not np.isfinite(vertices).all() or np.abs(vertices).max() > FARTHEST:
        raise CourseError(f"vertices and faces: expected finite numbers within {FARTHEST:g} m, and at least one face.")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise CourseError(f"faces: expected rows 0 to {len(vertices) - 1} of vertices, received up to {faces.max()}.")
    return Trimesh(vertices, faces, process=False)


def safe_path(name: str, folder: Path | None, limits: Limits) -> Path:
    """Return the path of a file beside the course file.

    Raises:
        CourseError: it is not a readable mesh file in the folder, or it is too large.
    """
    parts = PurePosixPath(name), PureWindowsPath(name)
    if folder is None or any(path.is_absolute() or path.drive or ".." in path.parts for path in parts):
        raise CourseError(
            f"file: expected a path below the course file's folder, received {name!r}; put the mesh beside the course."
        )
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise CourseError(f"file: expected a file in the course's folder, received a link out of it: {name!r}.")
    if path.suffix.lower() not in ENDINGS:
        raise CourseError(f"file: expected one of {', '.join(ENDINGS)}, received {name!r}; convert it.")
    if not path.is_file():
        raise CourseError(f"file: expected a file in the course's folder, received {name!r}, which is not there.")
    limits.check_bytes(f"file {name!r}", path.stat().st_size)
    return path


def read_mesh(name: str, folder: Path | None, limits: Limits) -> Trimesh:
    """Return the mesh in a file, its vertices merged.

    Raises:
        CourseError: the file cannot be read as a mesh, or has too many triangles.
    """
    path = safe_path(name, folder, limits)
    if path.suffix.lower() == ".glb":
        from minigolf_env.courses.gltf import read_scene

        objects, _ = read_scene(path.read_bytes(), limits)
        solids = [Trimesh(one.vertices, one.faces) for one in objects if one.vertices is not None]
        if not solids:
            raise CourseError(f"file: expected triangles, received {name!r} without any.")
        return _joined(solids)
    content, ending = path.read_bytes(), path.suffix[1:].lower()
    if not _is_binary_stl(content):
        limits.check_bytes(f"file {name!r}", len(content), text=True)
        content = _triangles_alone(content, ending)
    try:
        mesh: object = trimesh.load_mesh(BytesIO(content), ending)
    except Exception as error:  # Whatever a reader makes of a broken file.
        raise CourseError(f"file: expected a mesh, received {name!r} that cannot be read: {error!r:.200}.") from error
    if not isinstance(mesh, Trimesh) or not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise CourseError(f"file: expected triangles with finite corners, received {name!r}: {mesh!r:.100}.")
    limits.check_triangles(len(mesh.faces))
    return mesh


def _is_binary_stl(content: bytes) -> bool:
    """Return whether a mesh file is a header of 80 bytes, the number of its triangles, and 50 bytes for each."""
    return len(content) == 84 + 50 * int.from_bytes(content[80:84], "little")


def _triangles_alone(content: bytes, ending: str) -> bytes:
    """Return a mesh file with nothing in its text but corners and faces, as one group.

    Each group, material and solid, of which a hostile file has many, would cost the reader a pass over the whole file.
    """
    if ending == "ply":
        return content
    text = re.sub("\r\n?", "\n", content.decode("ascii", "ignore"))
    if ending == "stl":
        return "\n".join(["solid", *re.findall("vertex[ \t].*", text, re.IGNORECASE), "endsolid\n"]).encode()
    lines = re.findall("^[ \t]*([vf][ \t].*)", text.replace("\\\n", ""), re.MULTILINE)
    # Of a face the corners alone, no textures and normals; and no comments.
    return re.sub("/[^ \t\n]*|#.*", "", "\n".join(lines)).encode()


def check_place(mesh: Trimesh) -> None:
    """Raise a CourseError if a mesh has a corner farther than FARTHEST from the origin."""
    if not np.abs(mesh.vertices).max(initial=0.0) <= FARTHEST:
        raise CourseError(f"mesh: expected corners within {FARTHEST:g} m, received some beyond; give a `scale`.")


def cut_cup(mesh: Trimesh, cup: Cup, obstacles: Sequence[Outline]) -> Trimesh:
    """Return a floor's mesh whose level top at the cup's rim has the hole for the cup, with a pocket around its liner.

    Raises:
        CourseError: the top is not level around the cup, or the floor is thinner than the cup is deep.
    """
    mesh = Trimesh(mesh.vertices, mesh.faces)  # Corners that programs keep apart for each face become one.
    rim = cup.position[2]
    corners = mesh.triangles
    level = (np.abs(corners[:, :, 2] - rim) <= 1e-6).all(axis=1)
    up = mesh.face_normals[:, 2] > 0.5
    level &= up
    plans = shapely.polygons(corners[:, :, :2])
    top = shapely.union_all(plans[level])
    for taken in obstacles:
        top = top - taken
    hole = cup_hole(top, cup)
    touched = level & shapely.intersects(plans, hole)
    bottom = rim - cup.depth - LINER
    below = shapely.intersects(plans, hole) & ~touched & (corners[:, :, 2].min(axis=1) > bottom - 1e-6)
    if below.any():
        raise CourseError(
            f"cup depth: expected a floor thicker than {cup.depth + LINER:g} m under the cup, "
            f"received one that ends at z = {corners[below][:, :, 2].max():g} m; thicken it."
        )
    # The outline of the faces that are cut keeps their corners, so that the neighbours still fit.
    area = shapely.union_all(plans[touched])
    rings = shapely.get_parts(shapely.polygonize([shapely.linestrings(edge) for edge in _rim(mesh, touched)]))
    pieces = [ring - hole for ring in rings if area.contains(ring.point_on_surface())]
    kept = Trimesh(mesh.vertices, mesh.faces[~touched], process=False)
    return _joined([kept, *_pocket(pieces, hole, rim, bottom)])


def _joined(solids: Sequence[Trimesh]) -> Trimesh:
    return Trimesh(*trimesh.util.append_faces([one.vertices for one in solids], [one.faces for one in solids]))


def _pocket(around: Sequence[Outline], hole: Outline, rim: float, bottom: float) -> Iterator[Trimesh]:
    """Yield the level floor around a hole, the wall down from its edge, and the bottom."""
    for areas, z in ((around, rim), ([hole], bottom)):
        points, faces = triangulated(areas)
        yield Trimesh(np.c_[points, np.full(len(points), z)], faces)
    ring = np.array(shapely.geometry.polygon.orient(hole).exterior.coords)[:-1]
    n = len(ring)
    k, after = np.arange(n), np.roll(np.arange(n), -1)
    # Seen from the hole, the wall is passed clockwise.
    wall = np.concatenate([np.c_[k, after, k + n], np.c_[after, after + n, k + n]])
    yield Trimesh(np.concatenate([np.c_[ring, np.full(n, rim)], np.c_[ring, np.full(n, bottom)]]), wall)


def _rim(mesh: Trimesh, chosen: np.ndarray) -> np.ndarray:
    """Return the edges (E, 2, 2) in plan that bound chosen faces."""
    edges = np.sort(mesh.faces[chosen][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(mesh.vertices[unique[count == 1]][:, :, :2])
