"""Writing of binary glTF 2.0 (.glb): named objects with triangles, positions and extra properties."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses.io.gltf_buffers import FLOAT_COMPONENT, JsonObject
from minigolf_env.courses.io.gltf_scene import (
    EXACT_VERTICES_KEY,
    IntArray,
    SceneObject,
)
from minigolf_env.courses.io.gltf_transforms import FloatArray, z_up_to_y_up

UINT32_COMPONENT = 5125
"""Component type of uint32 in glTF."""

VERTEX_BUFFER = 34962
"""Target of a buffer view of vertices in glTF."""

INDEX_BUFFER = 34963
"""Target of a buffer view of indices in glTF."""


def write_scene(objects: Sequence[SceneObject], extras: JsonObject) -> bytes:
    """Return the content of a .glb file with objects and a scene's extras."""
    writer = _SceneWriter()
    for item in objects:
        writer.add_object(item)
    return writer.content(extras)


class _SceneWriter:
    """Writer that collects the arrays and the JSON of a scene."""

    def __init__(self) -> None:
        self.nodes: list[JsonObject] = []
        self.meshes: list[JsonObject] = []
        self.accessors: list[JsonObject] = []
        self.views: list[JsonObject] = []
        self.materials: list[JsonObject] = []
        self.binary = b""

    def add_object(self, item: SceneObject) -> None:
        """Add a node, with its mesh and material if it is not an empty."""
        node: JsonObject = {"name": item.name, "extras": dict(item.extras)}
        if item.vertices is None or item.faces is None:
            node["translation"] = z_up_to_y_up(np.array([item.at]))[0].tolist()
        else:
            node["extras"][EXACT_VERTICES_KEY] = base64.b64encode(item.vertices.astype("<f8").tobytes()).decode()
            node["mesh"] = self._add_mesh(item.name, item.vertices, item.faces, item.color)
        self.nodes.append(node)

    def _add_mesh(
        self, name: str, vertices: FloatArray, faces: IntArray, color: tuple[float, float, float] | None
    ) -> int:
        """Add a mesh and its material, and return its number."""
        points = z_up_to_y_up(vertices).astype("<f4")
        box = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        position = self._add_array(
            points, VERTEX_BUFFER, componentType=FLOAT_COMPONENT, count=len(points), type="VEC3", **box
        )
        index = faces.astype("<u4").ravel()
        indices = self._add_array(index, INDEX_BUFFER, componentType=UINT32_COMPONENT, count=index.size, type="SCALAR")
        linear = [value**2.2 for value in color or (0.8, 0.8, 0.8)]
        appearance = {"baseColorFactor": [*linear, 1.0], "metallicFactor": 0.0}
        self.materials.append({"name": name, "pbrMetallicRoughness": appearance})
        primitive = {"attributes": {"POSITION": position}, "indices": indices, "material": len(self.materials) - 1}
        self.meshes.append({"name": name, "primitives": [primitive]})
        return len(self.meshes) - 1

    def _add_array(self, array: NDArray[Any], target: int, **fields: Any) -> int:
        """Add an array with a buffer view and an accessor, and return the number of the accessor."""
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": array.nbytes, "target": target}
        self.views.append(view)
        self.binary += array.tobytes()
        self.accessors.append({"bufferView": len(self.views) - 1, **fields})
        return len(self.accessors) - 1

    def content(self, extras: JsonObject) -> bytes:
        """Return the content of the .glb file."""
        data = {
            "asset": {"version": "2.0", "generator": "minigolf_env"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(self.nodes))), "extras": extras}],
            "nodes": self.nodes,
        }
        if self.meshes:
            data |= {"meshes": self.meshes, "accessors": self.accessors}
            data |= {"bufferViews": self.views, "materials": self.materials}
            data["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(data).encode()
        text += b" " * (-len(text) % 4)
        json_chunk = struct.pack("<I4s", len(text), b"JSON") + text
        body = json_chunk + struct.pack("<I4s", len(self.binary), b"BIN\0") + self.binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
