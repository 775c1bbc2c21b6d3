"""Custom properties of .glb courses: values of 3D programs, misspellings, and properties on the wrong object."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minigolf_env.courses import CourseError
from minigolf_env.courses.io.glb_properties import KNOWN_KEYS, PART_KEYS, find_meant_key
from minigolf_env.courses.io.gltf_scene import read_scene
from minigolf_env.courses.schema.limits import Limits
from tests.cost import count_calls
from tests.courses.scenes import CUP, TEE, WOOD, load_scene, packed


def test_numbers_as_blender_stores_them_are_read(tmp_path: Path) -> None:
    """A whole number may be 3.0, and a list of points a flat array."""
    extras = {"par": 3.0, "bounds": [-1.0, -2.0, -1.0, 6.0, 2.0, 3.0], "route": [1.0, 0.3, 2.0, -0.3]}
    course = load_scene(tmp_path, lambda data: data["scenes"][0]["extras"].update(extras))
    assert course.par == 3 and course.bounds == ((-1, -2, -1), (6, 2, 3))
    assert course.route[1:-1] == ((1.0, 0.3), (2.0, -0.3))


MISSPELT = [
    (WOOD, "restituton", "restitution"),
    (WOOD, "Damping", "damping"),
    (WOOD, "colour", "color"),
    (WOOD, "in wards", "inwards"),
    (WOOD, "tangentail", "tangential"),
    (CUP, "radus", "radius"),
    (CUP, "dampin", "damping"),
    (TEE, "hight", "height"),
    (TEE, "Upper", "upper"),
]
"""Numbers of nodes, misspelt properties, and the properties that were meant."""


@pytest.mark.parametrize(("node", "key", "meant"), MISSPELT)
def test_misspelt_property_names_object_and_the_one_meant(node: int, key: str, meant: str, tmp_path: Path) -> None:
    """A property with one wrong letter, another case or separators is an error that names its object."""
    title = {WOOD: "wood 0", CUP: "cup", TEE: "tee"}[node]
    with pytest.raises(CourseError, match=f"object '{title}': unknown property '{key}'; did you mean '{meant}'"):
        load_scene(tmp_path, lambda data: data["nodes"][node]["extras"].update({key: 0.5}))


@pytest.mark.parametrize(("key", "meant"), [("top_sped", "top_speed"), ("top speed", "top_speed"), ("Par", "par")])
def test_misspelt_property_of_the_scene_is_named(key: str, meant: str, tmp_path: Path) -> None:
    """The scene is named where its property is misspelt."""
    with pytest.raises(CourseError, match=f"scene: unknown property '{key}'; did you mean '{meant}'"):
        load_scene(tmp_path, lambda data: data["scenes"][0]["extras"].update({key: 3.0}))


ADD_ON_KEYS = [
    "material_name", "floor_id", "color2", "weight", "tower", "flower", "part", "cat", "friction", "mass", "lod",
    "rotation", "cycles", "my_addon_data", "surface_area", "radius_outer", "game", "par" + 20 * "_", "",
]  # fmt: skip
"""Names of properties of other programs, some of them close to ours."""


@pytest.mark.parametrize("key", [*ADD_ON_KEYS, "name"])
def test_properties_of_other_programs_are_read_over(key: str, tmp_path: Path) -> None:
    """Names that are more than a letter away, and an object's own name, may be on any object."""

    def add(data: dict[str, Any]) -> None:
        for owner in (*data["nodes"], *data["meshes"], *data["materials"]):
            owner.setdefault("extras", {})[key] = "x"

    assert len(load_scene(tmp_path, add).parts) == 3


def test_known_names_are_not_misspellings_of_each_other() -> None:
    """No property of the table is taken for another one."""
    assert [find_meant_key(key) for key in KNOWN_KEYS] == list(KNOWN_KEYS)


WRONG_OWNERS = [
    (lambda d: d["nodes"][WOOD]["extras"], "par", "object 'wood 0': property 'par' .*only on the scene"),
    (lambda d: d["nodes"][WOOD]["extras"], "radius", "object 'wood 0': property 'radius' .*only on the cup"),
    (lambda d: d["nodes"][WOOD]["extras"], "lower", "object 'wood 0': property 'lower' .*only on an empty tee"),
    (lambda d: d["nodes"][CUP]["extras"], "damping", "object 'cup': property 'damping' .*on the object of a part"),
    (lambda d: d["nodes"][TEE]["extras"], "surface", "object 'tee': property 'surface' .*part or the cup"),
    (lambda d: d["scenes"][0]["extras"], "stimp", "scene: property 'stimp' .*only on the object of a part"),
    (lambda d: d["meshes"][1].setdefault("extras", {}), "damping", "object 'wood 0': .*no effect on a mesh or a mat"),
    (lambda d: d["materials"][1].setdefault("extras", {}), "color", "object 'wood 0': .*no effect on a mesh or a mat"),
]
"""Functions that return the extras of an owner, properties that have no effect there, and messages."""


@pytest.mark.parametrize(("extras_of", "key", "message"), WRONG_OWNERS)
def test_property_on_wrong_object_says_where_it_belongs(
    extras_of: Callable[[dict[str, Any]], dict[str, Any]], key: str, message: str, tmp_path: Path
) -> None:
    """A known property where it has no effect is an error."""
    with pytest.raises(CourseError, match=message):
        load_scene(tmp_path, lambda data: extras_of(data).update({key: 1.0}))


@pytest.mark.parametrize("key", PART_KEYS)
def test_property_of_a_part_on_an_empty_is_an_error(key: str, tmp_path: Path) -> None:
    """An empty with a part's property was a part whose mesh is lost, or a parent that hands nothing down."""

    def add(data: dict[str, Any]) -> None:
        data["nodes"].append({"name": "rail", "extras": {key: 0.5}})
        data["scenes"][0]["nodes"].append(4)

    with pytest.raises(CourseError, match=f"object 'rail': property '{key}' has no effect on an empty"):
        load_scene(tmp_path, add)


def test_tee_that_is_a_mesh_has_no_properties(tmp_path: Path) -> None:
    """The mesh gives the tee's place."""

    def change(data: dict[str, Any]) -> None:
        data["nodes"][TEE].update(mesh=1, extras={"height": 0.0})

    with pytest.raises(CourseError, match="object 'tee': property 'height' has no effect on a tee that is a mesh"):
        load_scene(tmp_path, change)


@pytest.mark.parametrize("value", [True, 1, 1.0])
def test_booleans_of_blender_are_read(value: Any, tmp_path: Path) -> None:
    """A boolean may be stored as a number."""
    with pytest.raises(CourseError, match="cup: position"):
        load_scene(tmp_path, lambda data: data["nodes"][0]["extras"].update(floor=1 - value))
    assert load_scene(tmp_path, lambda data: data["nodes"][0]["extras"].update(floor=value)).cup is not None


@pytest.mark.parametrize("value", ["false", "true", "", 2, 0.5, -1, None, [True], {}])
@pytest.mark.parametrize(("node", "key"), [(WOOD, "floor"), (WOOD, "inwards"), (CUP, "cut")])
def test_other_values_of_booleans_name_object(node: int, key: str, value: Any, tmp_path: Path) -> None:
    """A text such as "false" is no boolean."""
    title = {WOOD: "wood 0", CUP: "cup"}[node]
    with pytest.raises(CourseError, match=f"object '{title}': {key}: expected true or false"):
        load_scene(tmp_path, lambda data: data["nodes"][node]["extras"].update({key: value}))


WRONG_VALUES = [
    (WOOD, {"damping": 7.0}, "object 'wood 0': damping: expected less than or equal to 1, received 7.0"),
    (WOOD, {"damping": "0.5"}, "object 'wood 0': damping: expected a valid number, received '0.5'"),
    (WOOD, {"color": "red"}, "object 'wood 0': color: "),
    (WOOD, {"material": "steel"}, "object 'wood 0': material: "),
    (WOOD, {"surface": "brik"}, "object 'wood 0': surface: expected one of .*, 'lining', received 'brik'; did you m"),
    (WOOD, {"surface": 3.0}, "object 'wood 0': surface: expected one of"),
    (WOOD, {"surface": "felt", "stimp": 9.0}, "object 'wood 0': surface: expected none with stimp, received 'felt'"),
    (CUP, {"surface": "lava"}, "object 'cup': surface: expected one of .*, 'lining', received 'lava'"),
    (CUP, {"radius": -1.0}, "object 'cup': radius: expected greater than 0, received -1.0"),
    (CUP, {"position": [1.0]}, r"object 'cup': position\[1\]: expected this key"),
    (CUP, {"depth": 2.0}, "object 'floor': cup depth: expected a floor thicker than"),
    (TEE, {"height": "low"}, "object 'tee': height: expected a valid number, received 'low'"),
    (TEE, {"upper": [0.1, 0.1]}, "object 'tee': .*both lower and upper"),
]
"""Numbers of nodes, properties with wrong values, and messages."""


@pytest.mark.parametrize(("node", "extras", "message"), WRONG_VALUES)
def test_wrong_value_names_object_and_property(node: int, extras: dict[str, Any], message: str, tmp_path: Path) -> None:
    """Messages name the object, not its place in the description of the course."""
    with pytest.raises(CourseError, match=f"^scene.glb: {message}"):
        load_scene(tmp_path, lambda data: data["nodes"][node]["extras"].update(extras))


def test_faults_of_many_objects_are_counted(tmp_path: Path) -> None:
    """The message lists five faults and the number of the others."""

    def change(data: dict[str, Any]) -> None:
        for number in range(8):
            data["nodes"].append({"name": f"block {number}", "mesh": 1, "extras": {"color": "red"}})
            data["scenes"][0]["nodes"].append(4 + number)

    with pytest.raises(CourseError) as raised:
        load_scene(tmp_path, change)
    lines = str(raised.value).removeprefix("scene.glb: ").splitlines()
    assert [line.split(":")[0] for line in lines] == [f"object 'block {k}'" for k in range(5)] + ["and 3 more"]


def test_height_of_a_tee_overrides_its_position(tmp_path: Path) -> None:
    """Each of place and height is the property's if there is one, else the object's."""
    shifted = {"translation": [0.0, 0.5, 0.0]}
    box = {"lower": [0.1, 0.0], "upper": [0.2, 0.3]}
    for extras, height, lower in (({}, 0.5, 0.0), ({"height": 0.25}, 0.25, 0.0), (box, 0.5, 0.1)):
        tee = load_scene(tmp_path, lambda data: data["nodes"][TEE].update(shifted, extras=extras)).tee  # noqa: B023
        assert (tee.height, tee.lower[0]) == (height, lower)


def test_cost_of_a_mesh_of_many_objects_is_that_of_one() -> None:
    """Properties and extensions that many objects share are checked once."""
    keys = {f"restitutio{k}": 0 for k in range(2_000)}
    extensions = {f"KHR_materials_{k}": {} for k in range(2_000)}
    primitive = {"attributes": {"POSITION": 0}, "material": 0}
    data = {
        "nodes": [{"mesh": 0} for _ in range(200)],
        "meshes": [{"primitives": [primitive], "extensions": extensions, "extras": keys}],
        "materials": [{"extras": keys}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"byteLength": 36}],
    }
    content = packed(data, struct.pack("<I4s", 36, b"BIN\0") + np.eye(3, dtype="<f4").tobytes())
    with count_calls() as calls:
        objects, _ = read_scene(content, Limits())
    assert sum(len(item.data_keys) for item in objects) == len(keys)
    assert calls.count < 200_000
