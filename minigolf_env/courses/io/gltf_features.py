"""Features of glTF that change where a mesh is: those that the reader does not apply are errors that name the object.

Ignoring one in silence would put a wall where nobody sees it.
"""

from __future__ import annotations

from typing import Any, TypeAlias

JsonObject: TypeAlias = dict[str, Any]

APPLIED_EXTENSIONS = ("KHR_mesh_quantization", "KHR_node_visibility")
"""Extensions that the reader applies."""

APPEARANCE_EXTENSIONS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "KHR_xmp")
"""Beginnings of the names of extensions that change no geometry."""

INSTANCING_EXTENSION = "EXT_mesh_gpu_instancing"
"""Extension that draws a mesh at several places."""

COMPRESSION_EXTENSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
"""Extensions that compress meshes."""


def check_required_extensions(data: JsonObject) -> None:
    """Raise a ValueError if the file requires an extension that the reader lacks (glTF 2.0, section 3.12)."""
    for name in data.get("extensionsRequired", ()):
        if name in COMPRESSION_EXTENSIONS:
            raise ValueError(f"it requires {name}; export it without compression")
        if name == INSTANCING_EXTENSION:
            continue  # The node that uses it is named.
        if name not in APPLIED_EXTENSIONS and not str(name).startswith(APPEARANCE_EXTENSIONS):
            raise ValueError(f"it requires the extension {name!r:.60}, which is not read; export it without")


def is_hidden(node: JsonObject) -> bool:
    """Return whether a node, and so its children, are not part of the scene (KHR_node_visibility)."""
    return node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible", True) is False


def animated_nodes(data: JsonObject) -> set[int]:
    """Return the numbers of the nodes that animations move."""
    channels = [channel for animation in data.get("animations", ()) for channel in animation["channels"]]
    return {channel["target"]["node"] for channel in channels if "node" in channel["target"]}


def check_mesh_node(node: JsonObject, mesh: JsonObject, is_animated: bool) -> None:
    """Raise a ValueError if a node places its mesh in a way that the reader does not apply.

    Args:
        node: the node.
        mesh: its mesh.
        is_animated: an animation moves the node or one above it.
    """
    if "skin" in node:
        raise ValueError("it is bent by an armature (skin); apply the Armature modifier, and remove the armature")
    weights = node.get("weights") or mesh.get("weights") or ()
    if any(weights) and any(primitive.get("targets") for primitive in mesh["primitives"]):
        raise ValueError("it has shape keys (morph targets) with a weight; apply the shape keys")
    if INSTANCING_EXTENSION in node.get("extensions", {}):
        raise ValueError(f"it is drawn at several places ({INSTANCING_EXTENSION}); realize the instances as objects")
    if is_animated:
        raise ValueError("it is moved by an animation; remove the animation")
