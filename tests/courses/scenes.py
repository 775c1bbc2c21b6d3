"""Scenes of boxes and empties for the tests of .glb files."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from minigolf_env.courses import Course, load_course
from minigolf_env.courses.io.gltf_scene import SceneObject
from minigolf_env.courses.io.gltf_writer import write_scene

TEE = 1
"""Number of the tee's node in ``blender_scene``."""

CUP = 2
"""Number of the cup's node."""

WOOD = 3
"""Number of the wooden block's node."""


def solid(name: str, size: tuple[float, float, float], at: tuple[float, float, float], **extras: Any) -> SceneObject:
    """Return a box as 3D programs store it: with separate vertices for each face."""
    box = trimesh.creation.box(size)
    box.apply_translation(at)
    box.unmerge_vertices()
    return SceneObject(name, (0.0, 0.0, 0.0), extras, np.array(box.vertices), np.array(box.faces))


def packed(data: dict[str, Any], rest: bytes) -> bytes:
    """Return a .glb file with another JSON chunk."""
    text = json.dumps(data).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + rest
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def unpacked(content: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON of a .glb file and the bytes after it."""
    size = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + size]), content[20 + size :]


def blender_scene(change: Callable[[dict[str, Any]], None] = lambda data: None) -> bytes:
    """Return a .glb file of a floor, a tee, a cup and a wooden block, whose JSON was changed."""
    objects = [solid("floor", (4.0, 2.0, 0.4), (1.5, 0.0, -0.2))]
    objects += [SceneObject(name, (x, 0.0, 0.0), {}, None, None) for name, x in (("tee", 0.0), ("cup", 3.0))]
    objects += [solid("wood 0", (0.2, 0.2, 0.2), (1.0, 0.6, 0.1))]
    data, rest = unpacked(write_scene(objects, {}))
    change(data)
    return packed(data, rest)


def load_scene(folder: Path, change: Callable[[dict[str, Any]], None] = lambda data: None) -> Course:
    """Return the course of a changed scene."""
    (folder / "scene.glb").write_bytes(blender_scene(change))
    return load_course(folder / "scene.glb")


def same_mesh(a: Course, b: Course) -> bool:
    """Return whether two courses have the same bits."""
    pairs = list(zip(a.parts, b.parts, strict=True))
    return all(
        p.mesh.vertices.tobytes() == q.mesh.vertices.tobytes()
        and np.array_equal(p.mesh.faces, q.mesh.faces)
        and (p.name, p.material, p.color, p.mesh.surface) == (q.name, q.material, q.color, q.mesh.surface)
        for p, q in pairs
    )
