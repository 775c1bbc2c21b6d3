"""Mesh files that course files name: safe paths, and reading .obj, .stl, .ply and .glb files within limits."""

from __future__ import annotations

import re
from io import BytesIO
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
import trimesh
from trimesh import Trimesh

from minigolf_env.courses.course import CourseError
from minigolf_env.courses.geometry.solids import join_meshes
from minigolf_env.courses.io.gltf_scene import read_scene
from minigolf_env.courses.schema.limits import Limits

MESH_FILE_SUFFIXES = (".obj", ".stl", ".ply", ".glb")
"""Suffixes of mesh files that can be read."""


def resolve_mesh_path(name: str, folder: Path | None, limits: Limits) -> Path:
    """Return the path of a mesh file below the course file's folder.

    Raises:
        CourseError: the path leaves the folder, is not that of a mesh file, or the file is missing or too large.
    """
    parts = (PurePosixPath(name), PureWindowsPath(name))
    if folder is None or any(path.is_absolute() or path.drive or ".." in path.parts for path in parts):
        raise CourseError(
            f"file: expected a path below the course file's folder, received {name!r}; "
            "put the mesh next to the course file."
        )
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise CourseError(f"file: expected a file in the course's folder, received a link out of it: {name!r}.")
    if path.suffix.lower() not in MESH_FILE_SUFFIXES:
        raise CourseError(f"file: expected one of {', '.join(MESH_FILE_SUFFIXES)}, received {name!r}; convert it.")
    if not path.is_file():
        raise CourseError(f"file: expected a file in the course's folder, received {name!r}, which does not exist.")
    limits.check_bytes(f"file {name!r}", path.stat().st_size)
    return path


def read_mesh(name: str, folder: Path | None, limits: Limits) -> Trimesh:
    """Return the mesh in a file below the course file's folder, with coinciding vertices merged.

    Raises:
        CourseError: the file cannot be read as a mesh, or has too many triangles.
    """
    path = resolve_mesh_path(name, folder, limits)
    suffix = path.suffix.lower()
    content = path.read_bytes()
    if suffix == ".glb":
        objects, _ = read_scene(content, limits)
        meshes = [Trimesh(item.vertices, item.faces) for item in objects if item.vertices is not None]
        if not meshes:
            raise CourseError(f"file: expected triangles, received {name!r} without any.")
        return join_meshes(meshes)
    if not _is_binary_stl(content):
        limits.check_bytes(f"file {name!r}", len(content), text=True)
        content = _keep_triangles_only(content, suffix)
    try:
        mesh: object = trimesh.load_mesh(BytesIO(content), suffix[1:])
    except Exception as error:  # Mesh readers raise errors of many kinds on broken files.
        raise CourseError(f"file: expected a mesh, received {name!r} that cannot be read: {error!r:.200}.") from error
    if not isinstance(mesh, Trimesh) or not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise CourseError(f"file: expected triangles with finite corners, received {name!r}: {mesh!r:.100}.")
    limits.check_triangles(len(mesh.faces))
    return mesh


def _is_binary_stl(content: bytes) -> bool:
    """Return whether a mesh file is a header of 80 bytes, the number of its triangles, and 50 bytes for each."""
    return len(content) == 84 + 50 * int.from_bytes(content[80:84], "little")


def _keep_triangles_only(content: bytes, suffix: str) -> bytes:
    """Return the content of a mesh file with nothing in its text but vertices and faces, as one group.

    For each group, material or solid the reader passes over the whole file, and a hostile file has many of them.
    """
    if suffix == ".ply":
        return content
    text = re.sub("\r\n?", "\n", content.decode("ascii", "ignore"))
    if suffix == ".stl":
        return "\n".join(["solid", *re.findall("vertex[ \t].*", text, re.IGNORECASE), "endsolid\n"]).encode()
    lines = re.findall("^[ \t]*([vf][ \t].*)", text.replace("\\\n", ""), re.MULTILINE)
    # Remove comments, and the indices of texture coordinates and normals in faces.
    return re.sub("/[^ \t\n]*|#.*", "", "\n".join(lines)).encode()
