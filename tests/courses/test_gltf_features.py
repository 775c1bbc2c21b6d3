"""Features of glTF that change where a mesh is are applied, or errors that name the object."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from minigolf_env.courses import CourseError
from tests.courses.scenes import CUP, TEE, WOOD, load_scene, same_mesh


def test_scene_without_changes_is_a_course(tmp_path: Path) -> None:
    """The scene that the tests below change is a course of a floor, a cup and a block."""
    assert [part.name for part in load_scene(tmp_path).parts] == ["floor", "cup", "wood 0"]


def animate(node: int, path: str = "translation") -> Callable[[dict[str, Any]], None]:
    """Return a change of a scene that animates a node."""
    return lambda data: data.update(animations=[{"channels": [{"target": {"node": node, "path": path}}]}])


def animate_pointer(pointer: str) -> Callable[[dict[str, Any]], None]:
    """Return a change of a scene that animates a property by KHR_animation_pointer."""
    target = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}
    return lambda data: data.update(animations=[{"channels": [{"target": target}]}])


def give_parent(node: int, **fields: Any) -> Callable[[dict[str, Any]], None]:
    """Return a change of a scene that puts a node below an empty, which is node 4."""

    def change(data: dict[str, Any]) -> None:
        data["nodes"].append({"name": "group", "children": [node]} | fields)
        data["scenes"][0]["nodes"] = [number for number in range(5) if number != node]

    return change


def both(*changes: Callable[[dict[str, Any]], Any]) -> Callable[[dict[str, Any]], None]:
    """Return the changes of a scene in turn."""
    return lambda data: [change(data) for change in changes] and None


def hide(node: int) -> Callable[[dict[str, Any]], None]:
    """Return a change of a scene that hides a node."""
    extensions = {"KHR_node_visibility": {"visible": False}}
    return lambda data: data["nodes"][node].update(extensions=extensions)


def primitive_of_wood(data: dict[str, Any]) -> Any:
    """Return the primitive of the wooden block."""
    return data["meshes"][1]["primitives"][0]


def weigh_shape_key(owner: Callable[[dict[str, Any]], Any], weight: float) -> Callable[[dict[str, Any]], None]:
    """Return a change of a scene that gives the wooden block a shape key, with a weight at the mesh or the node."""
    return both(lambda d: owner(d).update(weights=[weight]), lambda d: primitive_of_wood(d).update(targets=[{}]))


def drop_view(data: dict[str, Any]) -> None:
    """Remove the positions of the wooden block, which a compressed primitive has elsewhere."""
    primitive_of_wood(data)["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0}}
    del data["accessors"][primitive_of_wood(data)["attributes"]["POSITION"]]["bufferView"]


def compress_view(data: dict[str, Any]) -> None:
    """Let the positions of the wooden block be in the fallback buffer of EXT_meshopt_compression."""
    number = data["accessors"][primitive_of_wood(data)["attributes"]["POSITION"]]["bufferView"]
    data["bufferViews"][number]["buffer"] = 1


UNAPPLIED_FEATURES = {
    "skin": (lambda d: d["nodes"][WOOD].update(skin=0), "object 'wood 0': .*armature"),
    "weight of mesh": (weigh_shape_key(lambda d: d["meshes"][1], 0.5), "object 'wood 0': .*shape keys"),
    "weight of node": (weigh_shape_key(lambda d: d["nodes"][WOOD], 0.5), "object 'wood 0': .*shape keys"),
    "instances": (
        lambda d: d["nodes"][WOOD].update(extensions={"EXT_mesh_gpu_instancing": {}}),
        "object 'wood 0': .*instances",
    ),
    "instances of an empty": (
        lambda d: d["nodes"][CUP].update(extensions={"EXT_mesh_gpu_instancing": {}}),
        "object 'cup': .*instances",
    ),
    "animation": (animate(WOOD), "object 'wood 0': .*animation"),
    "animated weights": (animate(WOOD, "weights"), "object 'wood 0': .*animation"),
    "animation of parent": (both(give_parent(WOOD), animate(4)), "object 'wood 0': .*animation"),
    "animated tee": (animate(TEE), "object 'tee': .*animation"),
    "animated cup": (animate(CUP, "rotation"), "object 'cup': .*animation"),
    "animated parent of tee": (both(give_parent(TEE), animate(4)), "object 'tee': .*animation"),
    "pointer to node": (animate_pointer(f"/nodes/{WOOD}/translation"), "object 'wood 0': .*animation"),
    "pointer to cup": (animate_pointer(f"/nodes/{CUP}/translation"), "object 'cup': .*animation"),
    "pointer to mesh": (animate_pointer("/meshes/1/weights/0"), "object 'wood 0': .*animation"),
    "pointer to visibility": (
        both(hide(WOOD), animate_pointer(f"/nodes/{WOOD}/extensions/KHR_node_visibility/visible")),
        "object 'wood 0': .*animation",
    ),
    "animated nothing": (animate(9), r"nodes\[9\] does not exist"),
    "visible zero": (
        lambda d: d["nodes"][WOOD].update(extensions={"KHR_node_visibility": {"visible": 0}}),
        "object 'wood 0': KHR_node_visibility: expected true or false",
    ),
    "newer glTF": (lambda d: d["asset"].update(minVersion="2.1"), "requires glTF '2.1'"),
    "broken triangle": (
        lambda d: d["accessors"][primitive_of_wood(d)["indices"]].update(count=35),
        "object 'wood 0': its mesh has 35 corners, which is no multiple of three",
    ),
    "pointer to skin": (animate_pointer("/skins/0/inverseBindMatrices"), "an animation changes '/skins/0"),
    "pointer to nothing": (animate_pointer("here"), "an animation changes 'here'"),
    "other target": (
        lambda d: d.update(animations=[{"channels": [{"target": {"path": "pointer", "extensions": {"ACME_a": {}}}}]}]),
        "an animation uses the extension 'ACME_a'",
    ),
    "lines": (lambda d: primitive_of_wood(d).update(mode=3), "object 'wood 0': .*a strip of lines"),
    "physics": (
        lambda d: d["nodes"][WOOD].update(extensions={"KHR_physics_rigid_bodies": {"motion": {}}}),
        "object 'wood 0': .*extension 'KHR_physics_rigid_bodies', which may move",
    ),
    "extension of mesh": (
        lambda d: d["meshes"][1].update(extensions={"ACME_bend": {}}),
        "object 'wood 0': .*extension 'ACME_bend', which may move",
    ),
    "extension of primitive": (
        lambda d: primitive_of_wood(d).update(extensions={"ACME_bend": {}}),
        "object 'wood 0': .*extension 'ACME_bend', which may move",
    ),
    "compressed primitive": (drop_view, "object 'wood 0': .*without compression"),
    "fallback buffer": (
        lambda d: d["buffers"][0].update(extensions={"EXT_meshopt_compression": {"fallback": True}}),
        "object 'floor': .*without compression",
    ),
    "compressed view": (compress_view, "object 'wood 0': .*without compression"),
    "data in another file": (lambda d: d["buffers"][0].update(uri="a.bin"), "object 'floor': .*another file"),
    "required compression": (
        lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"]),
        "requires .*'KHR_draco_mesh_compression'.* export it as .glb without compression",
    ),
    "required extension": (lambda d: d.update(extensionsRequired=["ACME_bend"]), "requires the extension 'ACME_bend'"),
    "cup is a mesh": (lambda d: d["nodes"][CUP].update(mesh=1), "object 'cup': expected an empty"),
    "two transforms": (
        lambda d: d["nodes"][CUP].update(matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "object 'cup': .*both a matrix and translation",
    ),
    "perspective": (
        lambda d: d["nodes"][WOOD].update(matrix=[1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "object 'wood 0': .*not affine",
    ),
    "long quaternion": (lambda d: d["nodes"][WOOD].update(rotation=[0, 0, 1, 1]), "object 'wood 0': .*quaternion"),
    "scale of one number": (
        lambda d: d["nodes"][WOOD].update(scale=[2.0]),
        "object 'wood 0': its scale: expected shape",
    ),
    "no triangles": (lambda d: d["meshes"][1].update(primitives=[]), "object 'wood 0': .*no triangles"),
    "no size": (lambda d: d["nodes"][WOOD].update(scale=[0, 0, 0]), "object 'wood 0': .*without volume"),
}
"""Changes of a scene and the messages about them, by what is changed."""


@pytest.mark.parametrize("name", UNAPPLIED_FEATURES)
def test_features_that_are_not_applied_name_their_object(name: str, tmp_path: Path) -> None:
    """A feature that moves or changes a mesh, the tee or the cup is an error that names the object."""
    change, message = UNAPPLIED_FEATURES[name]
    with pytest.raises(CourseError, match=message):
        load_scene(tmp_path, change)


BROKEN_VALUES = {
    "no mesh": lambda d: d["nodes"][WOOD].update(mesh=9),
    "negative mesh": lambda d: d["nodes"][WOOD].update(mesh=-1),
    "text as mesh": lambda d: d["nodes"][WOOD].update(mesh="1"),
    "no primitives": lambda d: d["meshes"][1].pop("primitives"),
    "no positions": lambda d: primitive_of_wood(d)["attributes"].clear(),
    "no accessor": lambda d: primitive_of_wood(d).update(indices=99),
    "no count": lambda d: d["accessors"][primitive_of_wood(d)["indices"]].pop("count"),
    "no material": lambda d: primitive_of_wood(d).update(material=9),
    "no child": lambda d: d["nodes"][WOOD].update(children=[9]),
    "extensions are a list": lambda d: d["nodes"][WOOD].update(extensions=[]),
    "weights are a number": lambda d: d["nodes"][WOOD].update(weights=1.0),
    "extras are a list": lambda d: d["nodes"][WOOD].update(extras=[1]),
    "translation is a text": lambda d: d["nodes"][WOOD].update(translation="here"),
    "rotation of three": lambda d: d["nodes"][WOOD].update(rotation=[0, 0, 0]),
}
"""Changes of a scene that break the wooden block."""


@pytest.mark.parametrize("name", BROKEN_VALUES)
def test_missing_and_wrong_values_name_their_object(name: str, tmp_path: Path) -> None:
    """Whatever is missing or of a wrong type in a file, the message names the object that needs it."""
    with pytest.raises(CourseError, match=r"^scene\.glb: object 'wood 0': "):
        load_scene(tmp_path, BROKEN_VALUES[name])


@pytest.mark.parametrize("title", ["Größe", "wood №5", "a" * 63])
def test_faults_of_geometry_name_the_object_as_blender_shows_it(title: str, tmp_path: Path) -> None:
    """Names that course files would not accept are in messages as they are in the file."""

    def rename(data: dict[str, Any]) -> None:
        data["nodes"][WOOD].update(name=title, scale=[1.0, 0.0, 1.0])

    with pytest.raises(CourseError, match=f"^scene.glb: object '{title}': expected a closed solid"):
        load_scene(tmp_path, rename)


def test_faults_of_the_cup_name_its_object(tmp_path: Path) -> None:
    """A cup that is not over a floor is named as in the file."""
    with pytest.raises(CourseError, match=r"^scene.glb: object 'Cup.001': cup: position: expected a place on a lane"):
        load_scene(tmp_path, lambda data: data["nodes"][CUP].update(name="Cup.001", translation=[9.0, 0.0, 0.0]))


HARMLESS_FEATURES = {
    "required appearance": lambda d: d.update(
        extensionsRequired=["KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual", "MSFT_lod"]
    ),
    "used extension": lambda d: d.update(extensionsUsed=["ACME_bend"]),
    "shape key without weight": weigh_shape_key(lambda d: d["meshes"][1], 0.0),
    "shape key without weights": lambda d: primitive_of_wood(d).update(targets=[{}]),
    "weight without shape key": lambda d: d["meshes"][1].update(weights=[1.0]),
    "weight of node overrides": both(
        weigh_shape_key(lambda d: d["meshes"][1], 1.0), lambda d: d["nodes"][WOOD].update(weights=[0.0])
    ),
    "moving camera": lambda d: (
        d["nodes"].append({"name": "view", "camera": 0}),
        d["scenes"][0]["nodes"].append(4),
        animate(4)(d),
    ),
    "lamp": both(give_parent(WOOD, extensions={"KHR_lights_punctual": {"light": 0}})),
    "animation without target": lambda d: d.update(animations=[{"channels": [{"target": {"path": "scale"}}]}]),
    "levels of detail": lambda d: d["nodes"][WOOD].update(extensions={"MSFT_lod": {"ids": [0]}}),
    "variants": lambda d: primitive_of_wood(d).update(extensions={"KHR_materials_variants": {}}),
    "compressed copy": lambda d: primitive_of_wood(d).update(extensions={"KHR_draco_mesh_compression": {}}),
    "colour": animate_pointer("/materials/1/pbrMetallicRoughness/baseColorFactor"),
    "light": animate_pointer("/extensions/KHR_lights_punctual/lights/0/intensity"),
    "required pointer": both(
        animate_pointer("/cameras/0/perspective/yfov"),
        lambda d: d.update(extensionsRequired=["KHR_animation_pointer"]),
    ),
    "node outside of the scene": lambda d: d["nodes"].append({"name": "tee", "mesh": 99}),
    "second scene": lambda d: d["scenes"].append({"nodes": [WOOD]}),
    "rounded quaternion": lambda d: d["nodes"][TEE].update(rotation=[0.0, 0.707, 0.0, 0.707]),
    "scaled empty": lambda d: d["nodes"][CUP].update(scale=[2.0, 2.0, 2.0]),
}
"""Changes of a scene that leave the course as it is."""


@pytest.mark.parametrize("name", HARMLESS_FEATURES)
def test_features_that_change_no_geometry_are_read_over(name: str, tmp_path: Path) -> None:
    """Materials, cameras, lights, shape keys without weight and other scenes leave the course as it is."""
    assert same_mesh(load_scene(tmp_path, HARMLESS_FEATURES[name]), load_scene(tmp_path))


def test_hidden_nodes_are_not_part_of_the_course(tmp_path: Path) -> None:
    """A node that is not visible, and its children, are left out, with all that they have."""
    change = both(
        give_parent(WOOD),
        hide(4),
        lambda d: d["nodes"][WOOD].update(skin=0, extras={"par": 3}),
        animate(4),
        lambda d: d.update(extensionsRequired=["KHR_node_visibility"]),
    )
    assert [part.name for part in load_scene(tmp_path, change).parts] == ["floor", "cup"]
