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
import json
import struct
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from trimesh.transformations import quaternion_matrix

from minigolf_env.courses.course import CourseError
from minigolf_env.courses.io.gltf_features import (
    JsonObject,
    animated_nodes,
    check_mesh_node,
    check_required_extensions,
    is_hidden,
)
from minigolf_env.courses.schema.limits import MAX_COURSE_COORDINATE, Limits

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]

EXACT_VERTICES_KEY = "exact_vertices"
"""Extra property of an object: its vertices as base64 of little-endian float64, because glTF stores positions as
float32."""

INDEX_DTYPES: dict[int, np.dtype[Any]] = {5121: np.dtype("u1"), 5123: np.dtype("<u2"), 5125: np.dtype("<u4")}
"""Types of indices by their glTF component type."""

QUANTIZED_DTYPES: dict[int, np.dtype[Any]] = {
    5120: np.dtype("i1"),
    5121: np.dtype("u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
}
"""Types of positions of the extension KHR_mesh_quantization by their glTF component type."""

FLOAT_COMPONENT = 5126
"""Component type of float32 in glTF."""

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

MAX_TRANSFORM_VALUE = 1e6
"""Largest value in the transform of a node."""


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


def read_scene(content: bytes, limits: Limits) -> tuple[list[SceneObject], JsonObject]:
    """Return the objects of a .glb file's scene, and the scene's extras.

    Raises:
        CourseError: the file is not a glTF binary of plain triangles, or has too many of them.
    """
    try:
        data, binary = _split_chunks(content, limits)
        check_required_extensions(data)
        nodes = data.get("nodes", [])
        scene = data.get("scenes", [{}])[data.get("scene", 0)]
        reader = _SceneReader(data, binary, limits)
        objects: list[SceneObject] = []
        for root in scene.get("nodes", range(len(nodes))):
            reader.visit(root, np.eye(4), 0, objects, False)
        return objects, _extras_of(scene)
    except CourseError:
        raise
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error) as error:
        fault = str(error) if isinstance(error, ValueError) else repr(error)
        raise CourseError(
            f"expected a binary glTF 2.0 file of plain triangles, received one with a fault: {fault:.200}; "
            "export it as .glb without compression."
        ) from error


class _SceneReader:
    """Reader of nodes and their meshes; it counts triangles over the whole scene."""

    def __init__(self, data: JsonObject, binary: bytes, limits: Limits) -> None:
        self.data = data
        self.binary = binary
        self.limits = limits
        self.visited: set[int] = set()
        self.animated = animated_nodes(data)
        self.num_triangles = 0
        self.num_corners = 0

    def visit(
        self, number: int, parent_matrix: FloatArray, depth: int, objects: list[SceneObject], is_animated: bool
    ) -> None:
        """Append the object of a node, and those of its children, unless they are hidden.

        ``is_animated``: an animation moves a node above.
        """
        if number in self.visited or depth > MAX_NODE_DEPTH:
            raise ValueError(f"node {number} is referenced twice or nested more than {MAX_NODE_DEPTH} deep")
        self.visited.add(number)
        node = self.data["nodes"][number]
        if is_hidden(node):
            return
        name = str(node.get("name", f"node {number}"))
        is_animated = is_animated or number in self.animated
        try:
            extras = _extras_of(node)
            matrix = parent_matrix @ _node_matrix(node)
            vertices = faces = None
            if "mesh" in node:
                mesh = self.data["meshes"][node["mesh"]]
                check_mesh_node(node, mesh, is_animated)
                vertices, faces = self._read_mesh(mesh, matrix, extras)
        except CourseError:
            raise
        except ValueError as error:
            raise CourseError(f"object {name!r:.60}: expected triangles that stand still; {error}.") from error
        x, y, z = matrix[:3, 3].tolist()
        objects.append(SceneObject(name, (x, -z, y), extras, vertices, faces))
        for child in node.get("children", ()):
            self.visit(child, matrix, depth + 1, objects, is_animated)

    def _read_mesh(self, mesh: JsonObject, matrix: FloatArray, extras: JsonObject) -> tuple[FloatArray, IntArray]:
        """Return the vertices and faces of a mesh, in the coordinates of the scene."""
        points = []
        faces = []
        num_points = 0
        for primitive in mesh["primitives"]:
            # Read the corners and their indices.
            mode = primitive.get("mode", TRIANGLES_MODE)
            if mode not in (TRIANGLES_MODE, STRIP_MODE, FAN_MODE):
                raise ValueError(f"its mesh consists of {OTHER_MODES.get(mode, mode)}, not of triangles")
            corners = self._read_array(primitive["attributes"]["POSITION"], 3)
            index = np.arange(len(corners))
            if "indices" in primitive:
                index = self._read_array(primitive["indices"], 1)
            triangles = _triangles_of(index.astype(np.int64), mode)
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
        # Transform the points; a mirrored object is wound the other way around.
        vertices = _y_up_to_z_up(_transform_points(np.concatenate(points), extras, matrix))
        if not np.abs(vertices).max(initial=0.0) <= MAX_COURSE_COORDINATE:
            raise ValueError(f"a mesh has positions beyond {MAX_COURSE_COORDINATE:g} m")
        all_faces = np.concatenate(faces)
        is_mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        return vertices, all_faces[:, ::-1] if is_mirrored else all_faces

    def _read_array(self, number: int, width: int) -> NDArray[Any]:
        """Return a copy of an accessor's array: float32 positions (N, 3), or indices (N,) if ``width`` is 1."""
        # Check that the accessor is one of positions or indices, in this file.
        accessor = self.data["accessors"][number]
        expected_type = "VEC3" if width == 3 else "SCALAR"
        if "sparse" in accessor or accessor["type"] != expected_type:
            raise ValueError(f"accessor {number} is sparse or not of type {expected_type}")
        component = accessor["componentType"]
        is_float = component == FLOAT_COMPONENT
        integers = QUANTIZED_DTYPES if width == 3 else INDEX_DTYPES
        dtype = np.dtype("<f4") if width == 3 and is_float else integers.get(component)
        view = self.data["bufferViews"][accessor["bufferView"]]
        if view.get("buffer", 0) != 0 or dtype is None:
            raise ValueError(f"accessor {number} refers to another file or has a wrong component type")
        # Check that the array lies within its view, and the view within the file.
        start = view.get("byteOffset", 0)
        length = view["byteLength"]
        offset = accessor.get("byteOffset", 0)
        count = accessor["count"]
        row = dtype.itemsize * width
        stride = view.get("byteStride", row)
        numbers = (start, length, offset, count, stride)
        if not all(type(value) is int and 0 <= value <= len(self.binary) for value in numbers):
            raise ValueError(f"accessor {number} has a size or an offset beyond the file")
        end_in_view = offset + (count - 1) * stride + row
        if not count or stride < row or end_in_view > length or start + length > len(self.binary):
            raise ValueError(f"accessor {number} is empty, or extends beyond its view or the file")
        # Copy the rows.
        raw = np.frombuffer(self.binary, np.uint8, (count - 1) * stride + row, start + offset)
        rows = np.lib.stride_tricks.as_strided(raw, (count, row), (stride, 1))
        array: NDArray[Any] = np.ascontiguousarray(rows).view(dtype)
        if width == 1:
            return array.reshape(-1)
        if not is_float and accessor.get("normalized", False):
            array = np.maximum(array / np.iinfo(dtype).max, -1.0)
        if not np.isfinite(array).all():
            raise ValueError(f"accessor {number} has positions that are not finite")
        return array


def _triangles_of(index: IntArray, mode: int) -> IntArray:
    """Return the triangles (F, 3) of a primitive's indices (glTF 2.0, section 3.7.2.1)."""
    if mode == TRIANGLES_MODE:
        return index.reshape(-1, 3)
    if len(index) < 3:
        raise ValueError("its mesh has a strip or a fan of fewer than three corners")
    k = np.arange(len(index) - 2)
    if mode == FAN_MODE:
        return np.stack([index[k + 1], index[k + 2], index[0 * k]], axis=1)
    return np.stack([index[k], index[k + 1 + k % 2], index[k + 2 - k % 2]], axis=1)


def _split_chunks(content: bytes, limits: Limits) -> tuple[JsonObject, bytes]:
    """Return the JSON and the binary chunk of a .glb file."""
    magic, version, length = struct.unpack_from("<4sII", content)
    if magic != b"glTF" or version != 2 or length > len(content):
        raise ValueError("the header is not that of a complete glTF 2.0 file")
    size, kind = struct.unpack_from("<I4s", content, 12)
    if kind != b"JSON" or 20 + size > len(content):
        raise ValueError("the JSON chunk is missing or incomplete")
    limits.check_bytes("JSON in it", size, text=True)
    data = json.loads(content[20 : 20 + size])
    rest = content[20 + size :]
    binary = b""
    if len(rest) >= 8:
        size, kind = struct.unpack_from("<I4s", rest)
        binary = rest[8 : 8 + size] if kind == b"BIN\0" else b""
    return data, binary


def _node_matrix(node: JsonObject) -> FloatArray:
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    else:
        matrix = np.eye(4)
        if "rotation" in node:
            x, y, z, w = node["rotation"]
            matrix = quaternion_matrix([w, x, y, z])  # type: ignore[no-untyped-call]
        matrix[:3, :3] = matrix[:3, :3] * np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
        matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    if not np.isfinite(matrix).all() or np.abs(matrix).max() > MAX_TRANSFORM_VALUE:
        raise ValueError(f"a node has a transform that is not finite or exceeds {MAX_TRANSFORM_VALUE:g}")
    return matrix


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


def _y_up_to_z_up(points: FloatArray) -> FloatArray:
    return np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)


def z_up_to_y_up(points: FloatArray) -> FloatArray:
    """Return points (N, 3) with z up in the coordinates of glTF, with y up."""
    return np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)


def _extras_of(owner: JsonObject) -> JsonObject:
    extras = owner.get("extras") or {}
    if not isinstance(extras, dict):
        raise ValueError("extras are not a JSON object")
    return extras
