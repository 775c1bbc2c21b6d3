"""Mesh files that course files name: safe paths, and reading .obj, .stl, .ply and .glb files within limits."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

from trimesh import Trimesh

from minigolf_env._validation import quote, quote_error
from minigolf_env.courses.course import CourseError
from minigolf_env.courses.geometry.solids import join_meshes
from minigolf_env.courses.io.gltf_scene import read_scene
from minigolf_env.courses.io.polygon_files import read_obj, read_ply, read_stl
from minigolf_env.courses.schema.limits import Limits

READERS = {".obj": read_obj, ".stl": read_stl, ".ply": read_ply}
"""Readers of mesh files by suffix; a .glb file is a scene of objects."""

MESH_FILE_SUFFIXES = (*READERS, ".glb")
"""Suffixes of mesh files that can be read."""


def resolve_mesh_path(name: str, folder: Path | None, limits: Limits) -> Path:
    """Return the path of a mesh file below the course file's folder.

    Raises:
        CourseError: the path leaves the folder, is not that of a mesh file, or the file is missing or too large.
    """
    parts = (PurePosixPath(name), PureWindowsPath(name))
    if folder is None or any(path.is_absolute() or path.drive or ".." in path.parts for path in parts):
        raise CourseError(
            f"file: expected a path below the course file's folder, received {quote(name)}; "
            "put the mesh next to the course file."
        )
    try:
        path = (folder / name).resolve()
        is_file = path.is_file()
    except (OSError, RuntimeError, ValueError) as error:  # A name that is too long, a loop of links, a zero byte.
        raise CourseError(
            f"file: expected a file in the course's folder, received {quote(name)}: {quote_error(error)}."
        ) from error
    if not path.is_relative_to(folder.resolve()):
        raise CourseError(f"file: expected a file in the course's folder, received a link out of it: {quote(name)}.")
    if path.suffix.lower() not in MESH_FILE_SUFFIXES:
        raise CourseError(f"file: expected one of {', '.join(MESH_FILE_SUFFIXES)}, received {quote(name)}; convert it.")
    if not is_file:
        raise CourseError(
            f"file: expected a file in the course's folder, received {quote(name)}, which does not exist."
        )
    limits.check_bytes(f"file {quote(name)}", path.stat().st_size)
    return path


def read_mesh(name: str, folder: Path | None, limits: Limits) -> Trimesh:
    """Return the mesh in a file below the course file's folder, with coinciding vertices merged.

    Raises:
        CourseError: the file cannot be read as a mesh, or has too many triangles.
    """
    path = resolve_mesh_path(name, folder, limits)
    suffix = path.suffix.lower()
    try:
        content = path.read_bytes()
    except OSError as error:
        raise CourseError(f"file: expected a readable file, received {quote(name)}: {quote_error(error)}.") from error
    if suffix not in (".stl", ".glb"):
        limits.check_bytes(f"file {quote(name)}", len(content), text=True)
    try:
        if suffix == ".glb":
            objects, _ = read_scene(content, limits)
            meshes = [Trimesh(item.vertices, item.faces) for item in objects if item.vertices is not None]
            if not meshes:
                raise CourseError("expected triangles, received none.")
            return join_meshes(meshes)
        vertices, faces = READERS[suffix](content, limits)
    except CourseError as error:
        raise CourseError(f"file {quote(name)}: {error}") from error
    if not len(faces):
        raise CourseError(
            f"file: expected triangles, received {quote(name)} without any; export the mesh, not its outline."
        )
    limits.check_triangles(len(faces))
    return Trimesh(vertices, faces)
