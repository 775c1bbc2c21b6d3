"""Reading of binary glTF 2.0 (.glb): named objects with triangles, positions and extra properties.

The reader uses positions, indices, transforms, names and extras only (glTF 2.0, Khronos Group, sections 3.5 to 3.7 and
4.4). The y axis of glTF points up: (x, y, z) here is (x, z, -y) there, which changes only signs.

trimesh also reads and writes .glb files, but it stores positions as float32 and allocates arrays by the counts in a
file. Here the exact float64 vertices are kept in extras, and every array is a slice of the file and within limits, so
that an untrusted file is safe to read.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import quote
from minigolf_env.courses.course import CourseError
from minigolf_env.courses.io.gltf_buffers import (
    REPAIR_HINT,
    JsonObject,
    element_of,
    read_indices,
    read_positions,
    split_chunks,
)
from minigolf_env.courses.io.gltf_features import (
    MeshTraits,
    animated_targets,
    check_mesh,
    check_node,
    check_requirements,
    check_shape_keys,
    is_hidden,
)
from minigolf_env.courses.io.gltf_transforms import (
    FloatArray,
    check_transform,
    node_matrix,
    y_up_to_z_up,
    z_up_to_y_up,
)
from minigolf_env.courses.schema.limits import MAX_COURSE_COORDINATE, Limits

IntArray: TypeAlias = NDArray[np.int64]

EXACT_VERTICES_KEY = "exact_vertices"
"""Extra property of an object: its vertices as base64 of little-endian float64, because glTF stores positions as
float32."""

TRIANGLES_MODE = 4
"""Mode of a primitive of triangles in glTF."""

STRIP_MODE = 5
"""Mode of a primitive that is a strip of triangles in glTF."""

FAN_MODE = 6
"""Mode of a primitive that is a fan of triangles in glTF."""

OTHER_MODES = {0: "points", 1: "lines", 2: "a loop of lines", 3: "a strip of lines"}
"""Modes of primitives without triangles in glTF."""

MAX_NODE_DEPTH = 64
"""Largest depth of the hierarchy of nodes."""


class SceneObject(NamedTuple):
    """Named object of a scene: a mesh, or an empty that marks a position."""

    name: str
    """Name of the object."""
    at: tuple[float, float, float]
    """Origin of the object, z up, m."""
    extras: JsonObject
    """Extra properties."""
    vertices: FloatArray | None
    """Vertices (V, 3), z up, m; None: an empty."""
    faces: IntArray | None
    """Faces (F, 3) as indices of vertices; None: an empty."""
    color: tuple[float, float, float] | None = None
    """Colour (sRGB) for programs that draw the scene; None: grey."""
    data_keys: frozenset[str] = frozenset()
    """Names of the extra properties of its mesh and its materials, as far as no object before has these."""
    is_animated: bool = False
    """True if an animation changes the object, or one above it; no mesh is."""


def read_scene(content: bytes, limits: Limits) -> tuple[list[SceneObject], JsonObject]:
    """Return the objects of a .glb file's default scene, and the scene's extras.

    Raises:
        CourseError: the file is not a glTF binary of plain triangles, or has too many of them.
    """
    before = "expected a binary glTF 2.0 file of plain triangles, received one with a fault: "
    with _describe_faults(before, "; export it as .glb without compression or other extensions."):
        data, binary = split_chunks(content, limits)
        check_requirements(data)
        scene, roots = _default_scene(data)
        reader = _SceneReader(data, binary, limits)
        for root in roots:
            reader.visit(root, np.eye(4), 0, is_animated=False)
        return reader.objects, _extras_of(scene)


def title_of(name: str) -> str:
    """Return how messages name an object: as Blender shows it, whose names are at most 63 bytes long."""
    return f"object {quote(name)}"


@contextmanager
def _describe_faults(before: str, after: str) -> Iterator[None]:
    """Convert errors about the content of a file into CourseErrors; those that are CourseErrors stay as they are."""
    try:
        yield
    except CourseError:
        raise
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error) as error:
        fault = f"a value has a wrong type or size ({error})"
        if isinstance(error, KeyError):
            fault = f"the key {error} is missing"
        elif isinstance(error, ValueError):
            fault = str(error)
        raise CourseError(f"{before}{fault:.200}{after}") from error


def _default_scene(data: JsonObject) -> tuple[JsonObject, list[int]]:
    """Return the default scene and its root nodes. A file without scenes has all nodes in one (section 3.5.1)."""
    scenes = data.get("scenes")
    if not scenes:
        nodes = data.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", ())}
        return {}, [number for number in range(len(nodes)) if number not in children]
    if "scene" not in data and len(scenes) > 1:
        raise ValueError(f"it has {len(scenes)} scenes, and none is the default; export one scene")
    scene = element_of(data, "scenes", data.get("scene", 0))
    return scene, scene.get("nodes", [])


class _SceneReader:
    """Reader of nodes and their meshes; it counts triangles over the whole scene."""

    def __init__(self, data: JsonObject, binary: bytes, limits: Limits) -> None:
        self.data = data
        self.binary = binary
        self.limits = limits
        self.objects: list[SceneObject] = []
        self.visited: set[int] = set()
        self.traits: dict[int, MeshTraits] = {}
        self.reported_owners: set[int] = set()
        self.animated = animated_targets(data)
        self.num_triangles = 0
        self.num_corners = 0

    def visit(self, number: int, parent_matrix: FloatArray, depth: int, is_animated: bool) -> None:
        """Append the object of a node, and those of its children, unless they are hidden.

        ``is_animated``: an animation changes a node above.
        """
        node = element_of(self.data, "nodes", number)
        if number in self.visited or depth > MAX_NODE_DEPTH:
            raise ValueError(f"node {number} is referenced twice or nested more than {MAX_NODE_DEPTH} deep")
        self.visited.add(number)
        name = str(node.get("name") or f"node {number}")
        with _describe_faults(f"{title_of(name)}: ", "."):
            if is_hidden(node) and ("visibility", number) not in self.animated:
                return
            check_node(node)
            is_animated = is_animated or ("nodes", number) in self.animated
            matrix = check_transform(parent_matrix @ node_matrix(node))
            x, y, z = matrix[:3, 3].tolist()
            item = SceneObject(name, (x, -z, y), _extras_of(node), None, None, is_animated=is_animated)
            self.objects.append(self._add_mesh(item, node, matrix) if "mesh" in node else item)
            for child in node.get("children", ()):
                self.visit(child, matrix, depth + 1, is_animated)

    def _add_mesh(self, item: SceneObject, node: JsonObject, matrix: FloatArray) -> SceneObject:
        """Return an object with the mesh of its node."""
        mesh = element_of(self.data, "meshes", node["mesh"])
        # Check a mesh once: a small file can use a large one in many objects.
        if node["mesh"] not in self.traits:
            self.traits[node["mesh"]] = check_mesh(mesh)
        check_shape_keys(node, self.traits[node["mesh"]])
        if item.is_animated or ("meshes", node["mesh"]) in self.animated:
            raise ValueError("it is moved by an animation; remove the animation")
        vertices, faces = self._read_mesh(mesh, matrix, item.extras)
        return item._replace(vertices=vertices, faces=faces, data_keys=self._find_data_keys(mesh))

    def _find_data_keys(self, mesh: JsonObject) -> frozenset[str]:
        """Return the names of the extra properties of a mesh and its materials; those of each are returned once."""
        numbers = {primitive["material"] for primitive in mesh["primitives"] if "material" in primitive}
        owners = [mesh, *mesh["primitives"], *(element_of(self.data, "materials", number) for number in numbers)]
        extras = [owner.get("extras") for owner in owners if id(owner) not in self.reported_owners]
        self.reported_owners.update(id(owner) for owner in owners)
        return frozenset(key for owned in extras if isinstance(owned, dict) for key in owned)

    def _read_mesh(self, mesh: JsonObject, matrix: FloatArray, extras: JsonObject) -> tuple[FloatArray, IntArray]:
        """Return the vertices and faces of a mesh, in the coordinates of the scene."""
        points = []
        faces = []
        num_points = 0
        for primitive in mesh["primitives"]:
            # Read the corners and their indices.
            mode = primitive.get("mode", TRIANGLES_MODE)
            if mode not in (TRIANGLES_MODE, STRIP_MODE, FAN_MODE):
                raise ValueError(f"its mesh consists of {OTHER_MODES.get(mode) or quote(mode)}, not of triangles")
            corners = read_positions(self.data, self.binary, primitive["attributes"]["POSITION"])
            index = np.arange(len(corners))
            if "indices" in primitive:
                index = read_indices(self.data, self.binary, primitive["indices"])
            triangles = _triangles_of(index, mode)
            points.append(corners)
            faces.append(triangles + num_points)
            if index.size and index.max() >= len(corners):
                raise ValueError("a mesh has indices beyond its positions")
            # Check the limits at once: a small file can use the same array again and again.
            num_points += len(corners)
            self.num_corners += len(corners)
            self.limits.check_triangles(self.num_corners // 3)
            self.num_triangles += len(triangles)
            self.limits.check_triangles(self.num_triangles)
        if not points:
            raise ValueError("its mesh has no triangles; give it faces, or replace it by an empty")
        # Transform the points; a mirrored object is wound the other way around.
        vertices = y_up_to_z_up(_transform_points(np.concatenate(points), extras, matrix))
        if not np.abs(vertices).max(initial=0.0) <= MAX_COURSE_COORDINATE:
            raise ValueError(f"a mesh has positions beyond {MAX_COURSE_COORDINATE:g} m")
        all_faces = np.concatenate(faces)
        is_mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        return vertices, all_faces[:, ::-1] if is_mirrored else all_faces


def _triangles_of(index: IntArray, mode: int) -> IntArray:
    """Return the triangles (F, 3) of a primitive's indices (glTF 2.0, section 3.7.2.1)."""
    if mode == TRIANGLES_MODE:
        if len(index) % 3:
            raise ValueError(f"its mesh has {len(index)} corners, which is no multiple of three; {REPAIR_HINT}")
        return index.reshape(-1, 3)
    if len(index) < 3:
        raise ValueError("its mesh has a strip or a fan of fewer than three corners")
    k = np.arange(len(index) - 2)
    if mode == FAN_MODE:
        return np.stack([index[k + 1], index[k + 2], index[0 * k]], axis=1)
    return np.stack([index[k], index[k + 1 + k % 2], index[k + 2 - k % 2]], axis=1)


def _transform_points(stored: NDArray[Any], extras: JsonObject, matrix: FloatArray) -> FloatArray:
    """Return positions in the scene: the exact ones in the extras, unless the object was changed since its export."""
    points = stored.astype(np.float64)
    if EXACT_VERTICES_KEY in extras:
        try:
            exact = np.frombuffer(base64.b64decode(extras[EXACT_VERTICES_KEY], validate=True), "<f8").reshape(-1, 3)
        except (binascii.Error, TypeError, ValueError):
            exact = np.empty((0, 3))
        if exact.shape == points.shape and np.abs(exact).max(initial=0.0) <= MAX_COURSE_COORDINATE:
            is_unchanged = np.array_equal(z_up_to_y_up(exact).astype(np.float32), stored)
            points = z_up_to_y_up(exact) if is_unchanged else points
    if np.array_equal(matrix, np.eye(4)):
        return points
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def _extras_of(owner: JsonObject) -> JsonObject:
    extras = owner.get("extras") or {}
    if not isinstance(extras, dict):
        raise ValueError("extras are not a JSON object")
    return extras
