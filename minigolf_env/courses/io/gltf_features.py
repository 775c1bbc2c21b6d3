"""Features of glTF that change where a mesh is: those that the reader does not apply are errors that name the object.

Ignoring one in silence would put a wall where nobody sees it.
"""

from __future__ import annotations

from typing import NamedTuple

from minigolf_env._validation import quote
from minigolf_env.courses.io.gltf_buffers import JsonObject, element_of

VISIBILITY_EXTENSION = "KHR_node_visibility"
"""Extension that hides nodes."""

APPLIED_EXTENSIONS = ("KHR_mesh_quantization", VISIBILITY_EXTENSION)
"""Extensions that the reader applies."""

INSTANCING_EXTENSION = "EXT_mesh_gpu_instancing"
"""Extension that draws a mesh at several places."""

POINTER_EXTENSION = "KHR_animation_pointer"
"""Extension that animates any property of the file."""

REFUSED_EXTENSIONS = (INSTANCING_EXTENSION, POINTER_EXTENSION)
"""Extensions that are errors only at the objects that use them."""

COMPRESSION_EXTENSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
"""Extensions that compress meshes. A file that does not require them has the uncompressed mesh, too."""

APPEARANCE_EXTENSIONS = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "MSFT_packing_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_audio",
    "KHR_xmp",
    "KHR_node_selectability",
    "KHR_node_hoverability",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "MSFT_lod",
)
"""Beginnings of the names of extensions that change no geometry. MSFT_lod adds coarser meshes for distant views."""

APPEARANCE_LISTS = ("materials", "textures", "images", "samplers", "cameras")
"""Lists of a file whose elements change no geometry."""


class MeshTraits(NamedTuple):
    """Shape keys of a mesh."""

    has_shape_keys: bool
    """True if there are any."""
    has_weights: bool
    """True if one has a weight in objects that give none."""


def check_requirements(data: JsonObject) -> None:
    """Raise a ValueError if the file requires an extension or a version that the reader lacks (glTF 2.0, 3.2, 3.12)."""
    version = data.get("asset", {}).get("minVersion", "2.0")
    if version != "2.0":
        raise ValueError(f"it requires glTF {quote(version)}, which is not read")
    for name in data.get("extensionsRequired", ()):
        if name not in (*APPLIED_EXTENSIONS, *REFUSED_EXTENSIONS) and not str(name).startswith(APPEARANCE_EXTENSIONS):
            raise ValueError(f"it requires the extension {quote(name)}, which is not read")


def is_hidden(node: JsonObject) -> bool:
    """Return whether a node, and so its children, are not part of the scene (KHR_node_visibility)."""
    is_visible = node.get("extensions", {}).get(VISIBILITY_EXTENSION, {}).get("visible", True)
    if not isinstance(is_visible, bool):
        raise ValueError(
            f"{VISIBILITY_EXTENSION}: expected true or false, received {quote(is_visible)}; show or hide it"
        )
    return not is_visible


def animated_targets(data: JsonObject) -> set[tuple[str, int]]:
    """Return what animations change: ("nodes", number), ("meshes", number), and ("visibility", number) of a node."""
    targets: set[tuple[str, int]] = set()
    for animation in data.get("animations", ()):
        for channel in animation["channels"]:
            target = channel["target"]
            if "node" in target:
                element_of(data, "nodes", target["node"])
                targets.add(("nodes", target["node"]))
            for name, extension in target.get("extensions", {}).items():
                if name != POINTER_EXTENSION:
                    raise ValueError(f"an animation uses the extension {quote(name)}; remove the animation")
                targets |= _pointer_targets(extension["pointer"])
    return targets


def _pointer_targets(pointer: str) -> set[tuple[str, int]]:
    """Return what an animation changes through a pointer such as "/nodes/3/translation"."""
    kind, key, path = (*pointer.split("/", 3)[1:], "", "", "")[:3]
    if kind in ("nodes", "meshes") and key.isdecimal():
        shown = {("visibility", int(key))} if VISIBILITY_EXTENSION in path else set()
        return {(kind, int(key))} | shown
    if kind not in APPEARANCE_LISTS and not (kind == "extensions" and key.startswith(APPEARANCE_EXTENSIONS)):
        raise ValueError(f"an animation changes {quote(pointer)}; remove the animation")
    return set()


def check_node(node: JsonObject) -> None:
    """Raise a ValueError if a node has a feature that may move it and that the reader does not apply."""
    if "skin" in node:
        raise ValueError("it is bent by an armature (skin); apply the Armature modifier, and remove the armature")
    if INSTANCING_EXTENSION in node.get("extensions", {}):
        raise ValueError(f"it is drawn at several places ({INSTANCING_EXTENSION}); realize the instances as objects")
    _check_extensions(node)


def check_mesh(mesh: JsonObject) -> MeshTraits:
    """Return the traits of a mesh, or raise a ValueError if an extension may change it."""
    for owner in (mesh, *mesh["primitives"]):
        _check_extensions(owner)
    return MeshTraits(any(item.get("targets") for item in mesh["primitives"]), any(mesh.get("weights") or ()))


def check_shape_keys(node: JsonObject, traits: MeshTraits) -> None:
    """Raise a ValueError if the shape keys of a node's mesh have a weight there (glTF 2.0, section 3.7.2.2)."""
    has_weights = any(node["weights"]) if node.get("weights") else traits.has_weights
    if has_weights and traits.has_shape_keys:
        raise ValueError("it has shape keys (morph targets) with a weight; apply the shape keys")


def _check_extensions(owner: JsonObject) -> None:
    """Raise a ValueError for an extension of a node, mesh or primitive that is not known to leave it where it is."""
    for name in owner.get("extensions", {}):
        is_known = name in (*APPLIED_EXTENSIONS, *COMPRESSION_EXTENSIONS) or name.startswith(APPEARANCE_EXTENSIONS)
        if not is_known:
            raise ValueError(f"it uses the extension {quote(name)}, which may move or change it; export it without")
