"""Binary glTF 2.0 (.glb) as far as a hole needs it: named objects with triangles, places and extra properties.

The reader looks at nothing but positions, indices, transforms, names and extras (glTF 2.0, Khronos Group, sections 3.5
to 3.7 and 4.4), and takes no count on trust: every array is a slice of the file. glTF's y axis points up: (x, y, z)
here is (x, z, -y) there, which changes no bit of a number but signs.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from trimesh.transformations import quaternion_matrix

from minigolf_env.courses.course import CourseError
from minigolf_env.courses.limits import Limits

FloatArray = NDArray[np.float64]
Data = dict[str, Any]

EXACT = "exact_vertices"
"""Extra property of an object: its vertices as base64 of little-endian float64, which positions in glTF cannot hold."""

INDEX: dict[int, np.dtype[Any]] = {5121: np.dtype("u1"), 5123: np.dtype("<u2"), 5125: np.dtype("<u4")}
"""glTF's numbers for the types of indices."""

FLOAT, TRIANGLES, DEEPEST = 5126, 4, 64

FARTHEST = 1000.0
"""Largest coordinate taken, m, as in course files."""


class Object(NamedTuple):
    """A named thing of a scene."""

    name: str
    at: tuple[float, float, float]
    """Its origin, m, z up."""
    extras: Data
    vertices: FloatArray | None
    """(V, 3) m, z up; None: an empty."""
    faces: NDArray[np.int64] | None
    """(F, 3)."""
    color: tuple[float, float, float] | None = None
    """For programs that draw; sRGB."""


def read_scene(content: bytes, limits: Limits) -> tuple[list[Object], Data]:
    """Return the objects of a .glb file's scene and the scene's extras.

    Raises:
        CourseError: the file is not a glTF binary of plain triangles, or has too many of them.
    """
    try:
        data, binary = _chunks(content, limits)
        nodes = data.get("nodes", [])
        scene = data.get("scenes", [{}])[data.get("scene", 0)]
        reader = _Reader(data, binary, limits)
        objects: list[Object] = []
        for root in scene.get("nodes", range(len(nodes))):
            reader.visit(root, np.eye(4), 0, objects)
        return objects, _extras(scene)
    except CourseError:
        raise
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error) as error:
        raise CourseError(
            f"expected a binary glTF 2.0 file of plain triangles, received one that breaks at {error!r:.200}; "
            "export it as .glb without compression."
        ) from error


class _Reader:
    def __init__(self, data: Data, binary: bytes, limits: Limits) -> None:
        self.data, self.binary, self.limits = data, binary, limits
        self.visited: set[int] = set()
        self.triangles = self.corners = 0

    def visit(self, number: int, above: FloatArray, depth: int, objects: list[Object]) -> None:
        """Append the object of a node, and those below it."""
        if number in self.visited or depth > DEEPEST:
            raise ValueError(f"node {number}, which is its own child or too deep")
        self.visited.add(number)
        node = self.data["nodes"][number]
        matrix = above @ _matrix(node)
        vertices = faces = None
        if "mesh" in node:
            vertices, faces = self._mesh(self.data["meshes"][node["mesh"]], matrix, _extras(node))
        x, y, z = matrix[:3, 3].tolist()
        objects.append(Object(str(node.get("name", f"node {number}")), (x, -z, y), _extras(node), vertices, faces))
        for child in node.get("children", ()):
            self.visit(child, matrix, depth + 1, objects)

    def _mesh(self, mesh: Data, matrix: FloatArray, extras: Data) -> tuple[FloatArray, NDArray[np.int64]]:
        points, faces, first = [], [], 0
        for primitive in mesh["primitives"]:
            if primitive.get("mode", TRIANGLES) != TRIANGLES:
                raise ValueError("a mesh of lines or points")
            corners = self._array(primitive["attributes"]["POSITION"], 3)
            index = np.arange(len(corners)) if "indices" not in primitive else self._array(primitive["indices"], 1)
            points.append(corners)
            faces.append(index.astype(np.int64).reshape(-1, 3) + first)
            if index.size and index.max() >= len(corners):
                raise ValueError("indices beyond the positions")
            first += len(corners)
            self.corners += len(corners)  # Of one array again and again, they cost a file nothing.
            self.limits.check_triangles(self.corners // 3)
            self.triangles += index.size // 3
            self.limits.check_triangles(self.triangles)
        vertices = _y_to_z(_exact(np.concatenate(points), extras, matrix))
        if not np.abs(vertices).max(initial=0.0) <= FARTHEST:
            raise ValueError(f"positions beyond {FARTHEST:g} m")
        turned = np.linalg.det(matrix[:3, :3]) < 0.0
        joined = np.concatenate(faces)
        return vertices, joined[:, ::-1] if turned else joined

    def _array(self, number: int, width: int) -> NDArray[Any]:
        """Return an accessor's array, a copy of a slice of the file."""
        accessor = self.data["accessors"][number]
        if "sparse" in accessor or accessor["type"] != ("VEC3" if width == 3 else "SCALAR"):
            raise ValueError("an accessor of another kind")
        kind = accessor["componentType"]
        dtype: np.dtype[Any] = np.dtype("<f4") if width == 3 and kind == FLOAT else INDEX[kind]
        view = self.data["bufferViews"][accessor["bufferView"]]
        if view.get("buffer", 0) != 0 or (width == 3) != (kind == FLOAT):
            raise ValueError("data outside of the file")
        start, length = view.get("byteOffset", 0), view["byteLength"]
        offset, count = accessor.get("byteOffset", 0), accessor["count"]
        row = dtype.itemsize * width
        stride = view.get("byteStride", row)
        numbers = (start, length, offset, count, stride)
        if not all(type(value) is int and 0 <= value <= len(self.binary) for value in numbers):
            raise ValueError("an accessor beyond the file")
        if (
            not count
            or stride < row
            or offset + (count - 1) * stride + row > length
            or start + length > len(self.binary)
        ):
            raise ValueError("an accessor beyond its view")
        part = np.frombuffer(self.binary, np.uint8, (count - 1) * stride + row, start + offset)
        rows = np.lib.stride_tricks.as_strided(part, (count, row), (stride, 1))
        array: NDArray[Any] = np.ascontiguousarray(rows).view(dtype)
        if width == 3 and not np.isfinite(array).all():
            raise ValueError("positions that are not finite")
        return array if width == 3 else array.reshape(-1)


def _chunks(content: bytes, limits: Limits) -> tuple[Data, bytes]:
    """Return the JSON and the binary chunk of a .glb file."""
    magic, version, length = struct.unpack_from("<4sII", content)
    if magic != b"glTF" or version != 2 or length > len(content):
        raise ValueError("the header")
    size, kind = struct.unpack_from("<I4s", content, 12)
    if kind != b"JSON" or 20 + size > len(content):
        raise ValueError("the JSON chunk")
    limits.check_bytes("JSON in it", size, text=True)
    data = json.loads(content[20 : 20 + size])
    rest = content[20 + size :]
    binary = b""
    if len(rest) >= 8:
        size, kind = struct.unpack_from("<I4s", rest)
        binary = rest[8 : 8 + size] if kind == b"BIN\0" else b""
    return data, binary


def _matrix(node: Data) -> FloatArray:
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    else:
        matrix = np.eye(4)
        if "rotation" in node:
            x, y, z, w = node["rotation"]
            matrix = quaternion_matrix([w, x, y, z])  # type: ignore[no-untyped-call]
        matrix[:3, :3] = matrix[:3, :3] * np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
        matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    if not np.isfinite(matrix).all() or np.abs(matrix).max() > 1e6:
        raise ValueError("a transform that is not finite")
    return matrix


def _exact(stored: NDArray[np.float32], extras: Data, matrix: FloatArray) -> FloatArray:
    """Return positions in the scene: the exact ones that come with them, unless the object was changed since."""
    points = stored.astype(np.float64)
    if EXACT in extras:
        try:
            exact = np.frombuffer(base64.b64decode(extras[EXACT], validate=True), "<f8").reshape(-1, 3)
        except (binascii.Error, TypeError, ValueError):
            exact = np.empty((0, 3))
        if exact.shape == points.shape and np.abs(exact).max(initial=0.0) <= FARTHEST:
            same = np.array_equal(_z_to_y(exact).astype(np.float32), stored)
            points = _z_to_y(exact) if same else points
    if np.array_equal(matrix, np.eye(4)):
        return points
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def _y_to_z(points: FloatArray) -> FloatArray:
    return np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)


def _z_to_y(points: FloatArray) -> FloatArray:
    return np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)


def _extras(owner: Data) -> Data:
    extras = owner.get("extras") or {}
    if not isinstance(extras, dict):
        raise ValueError("extras that are not named")
    return extras


def write_scene(objects: Sequence[Object], extras: Data) -> bytes:
    """Return a .glb file with objects and a scene's extras."""
    nodes, meshes, accessors, views, materials = [], [], [], [], []
    binary = b""

    def add(array: NDArray[Any], target: int, **about: Any) -> int:
        nonlocal binary
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": array.nbytes, "target": target})
        binary += array.tobytes()
        accessors.append({"bufferView": len(views) - 1, **about})
        return len(accessors) - 1

    for one in objects:
        node: Data = {"name": one.name, "extras": dict(one.extras)}
        if one.vertices is None or one.faces is None:
            node["translation"] = _z_to_y(np.array([one.at]))[0].tolist()
        else:
            node["extras"][EXACT] = base64.b64encode(one.vertices.astype("<f8").tobytes()).decode()
            points = _z_to_y(one.vertices).astype("<f4")
            box = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
            place = add(points, 34962, componentType=FLOAT, count=len(points), type="VEC3", **box)
            index = one.faces.astype("<u4").ravel()
            corners = add(index, 34963, componentType=5125, count=index.size, type="SCALAR")
            linear = [share**2.2 for share in one.color or (0.8, 0.8, 0.8)]
            materials.append(
                {"name": one.name, "pbrMetallicRoughness": {"baseColorFactor": [*linear, 1.0], "metallicFactor": 0.0}}
            )
            primitive = {"attributes": {"POSITION": place}, "indices": corners, "material": len(materials) - 1}
            meshes.append({"name": one.name, "primitives": [primitive]})
            node["mesh"] = len(meshes) - 1
        nodes.append(node)
    data = {
        "asset": {"version": "2.0", "generator": "minigolf_env"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes))), "extras": extras}],
        "nodes": nodes,
    }
    if meshes:
        data |= {"meshes": meshes, "accessors": accessors, "bufferViews": views, "materials": materials}
        data["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(data).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
