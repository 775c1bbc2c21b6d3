"""Courses in one .glb file: objects are the parts, the tee and the cup; extra properties hold the rest.

==========  ============================================================================================
object      meaning
==========  ============================================================================================
``tee...``  an empty: start of the ball; a mesh: the ball starts at a random point above its bounding box
``cup...``  an empty at the centre of the rim
others      parts, closed meshes
==========  ============================================================================================

Without extras, a part has the surface that its name starts with; "floor" and "green" are felt that contains the cup.
Extras have the names and meanings of keys of course files (glb_properties.py). Without extra ``par``, a course with a
cup has par DEFAULT_PAR.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError
from trimesh import Trimesh

from minigolf_env._validation import one_of, quote, quote_error, quote_unless_plain
from minigolf_env.courses.course import DEFAULT_PAR, Course, CourseError, course_errors
from minigolf_env.courses.geometry.assembly import assemble_course
from minigolf_env.courses.io.course_description import describe_course, hex_color
from minigolf_env.courses.io.glb_properties import (
    COURSE_KEYS,
    CUP_KEYS,
    PART_KEYS,
    PHYSICS_KEYS,
    TEE_KEYS,
    check_properties,
    read_property,
)
from minigolf_env.courses.io.gltf_scene import SceneObject, read_scene, title_of
from minigolf_env.courses.io.gltf_writer import write_scene
from minigolf_env.courses.io.validation_errors import format_faults, format_validation_error
from minigolf_env.courses.schema.course_file import CourseFile
from minigolf_env.courses.schema.limits import Limits
from minigolf_env.courses.schema.surfaces import BUILTIN_SURFACES

Location: TypeAlias = tuple[int | str, ...]
"""Keys that lead to a place in a description."""

FLOOR_PREFIXES = ("floor", "green")
"""Beginnings of the names of objects that are felt and contain the cup."""

MATERIAL_COLORS = {
    "felt": (0.25, 0.5, 0.2),
    "wood": (0.65, 0.45, 0.27),
    "cup": (0.95, 0.95, 0.95),
    "brick": (0.6, 0.3, 0.22),
}
"""Colours (sRGB) in which other programs show materials."""


def read_glb(path: Path, cup_radius: float | None = None, limits: Limits | None = None) -> Course:
    """Return the course in a .glb file, with another cup radius (m) if one is given.

    Raises:
        CourseError: the file cannot be read, or does not contain a course; the message says what is missing.
    """
    limits = limits or Limits()
    try:
        limits.check_bytes(f"course file {quote(path.name)}", path.stat().st_size)
        objects, extras = read_scene(path.read_bytes(), limits)
        description, owners = _describe_objects(path.stem, objects, extras)
        file = _validate(description, owners)
        meshes = {
            f"object {number}": Trimesh(item.vertices, item.faces, process=False)
            for number, item in enumerate(objects)
            if item.vertices is not None
        }
        return _assemble(file, meshes, owners, cup_radius, limits)
    except OSError as error:
        raise CourseError(
            f"course file: expected a readable .glb file, received {quote(str(path))}: {quote_error(error)}"
        ) from error
    except CourseError as error:
        raise CourseError(f"{quote_unless_plain(path.name)}: {error}") from error


def _validate(description: dict[str, Any], owners: dict[Location, str]) -> CourseFile:
    """Return a checked description; messages about faults name the objects that have them."""

    def format_fault(fault: Any) -> str:
        location = fault["loc"]
        owner = _owner_of(location, owners)
        if owner is None:
            return f"scene: {format_validation_error(fault, '')}"
        # Leave out the keys that lead to the object, and the kind of a part.
        depth = {"parts": 3, "surfaces": 2}.get(location[0], 1)
        return f"{owner}: {format_validation_error({**fault, 'loc': location[depth:]}, '')}"

    try:
        return CourseFile.model_validate(description)
    except ValidationError as error:
        raise CourseError(format_faults(error, format_fault)) from error


def _owner_of(location: Location, owners: dict[Location, str]) -> str | None:
    """Return the title of the object that a place in a description is about; None: the scene."""
    return owners.get(location[:2]) or owners.get(location[:1])


def _assemble(
    file: CourseFile, meshes: dict[str, Trimesh], owners: dict[Location, str], cup_radius: float | None, limits: Limits
) -> Course:
    """Return the course of a description; messages about faults name the objects that have them."""
    try:
        return assemble_course(file, meshes.__getitem__, cup_radius, limits)
    except CourseError as error:
        owner = _owner_of(error.location, owners)
        if owner is None:
            raise
        fault = str(error).removeprefix(f"course {quote(file.name)}: ")
        if error.location[0] == "parts":
            fault = fault.removeprefix(f"part {quote(file.parts[int(error.location[1])].name)}: ")
        raise CourseError(f"{owner}: {fault}") from error


def _describe_objects(
    name: str, objects: list[SceneObject], extras: dict[str, Any]
) -> tuple[dict[str, Any], dict[Location, str]]:
    """Return the description of a scene, and the titles of the objects by where they are in it.

    Each mesh is named by the number of its object.
    """
    tee, cup = _find_tee_and_cup(objects)
    surfaces: dict[str, Any] = {}
    parts: list[dict[str, Any]] = []
    data: dict[str, Any] = {"name": _sanitize_name(name), "surfaces": surfaces, "parts": parts}
    owners: dict[Location, str] = {}
    with course_errors("scene"):
        check_properties("the scene", extras, COURSE_KEYS)
        data |= {key: read_property(key, extras[key]) for key in COURSE_KEYS if key in extras}
    for number, item in enumerate(objects):
        title = title_of(item.name)
        with course_errors(title):
            if item is tee:
                owners["tee",] = title
                data["tee"] = _describe_tee(item)
            elif item is cup:
                owners["cup",] = title
                data |= {"cup": _describe_cup(item), "par": data.get("par", DEFAULT_PAR)}
            elif item.vertices is None:
                check_properties("an empty", item.extras)
            else:
                owners["parts", len(parts)] = owners["surfaces", f"object {number}"] = title
                part, own_surface = _describe_part(item, number)
                parts.append(part)
                surfaces |= own_surface
            check_properties("a mesh or a material", item.data_keys)
    return data, owners


def _find_tee_and_cup(objects: list[SceneObject]) -> tuple[SceneObject, SceneObject | None]:
    """Return the tee and the cup, if there is one, or raise a CourseError."""
    tees = [item for item in objects if item.name.lower().startswith("tee")]
    named_cup = [item for item in objects if item.name.lower().startswith("cup")]
    cups = [item for item in named_cup if item.vertices is None]
    if named_cup and not cups:
        raise CourseError(
            f"{title_of(named_cup[0].name)}: expected an empty at the middle of the rim, received a mesh; "
            "put an empty there, name it 'cup', and name the mesh otherwise."
        )
    if len(tees) != 1 or len(cups) > 1:
        raise CourseError(
            "expected one object named 'tee', and one empty named 'cup' at the middle of the rim, "
            f"received {len(tees)} and {len(cups)}, objects {quote([item.name for item in objects])}; name them so."
        )
    for item in (*tees, *cups):
        if item.is_animated:
            raise CourseError(
                f"{title_of(item.name)}: expected one that stands still, received one that an animation moves; "
                "remove the animation."
            )
    return tees[0], cups[0] if cups else None


def _describe_tee(tee: SceneObject) -> dict[str, Any]:
    if tee.vertices is not None:
        check_properties("a tee that is a mesh", tee.extras)
        low = tee.vertices.min(axis=0).tolist()
        high = tee.vertices.max(axis=0).tolist()
        return {"lower": low[:2], "upper": high[:2], "height": low[2]}
    check_properties("an empty tee", tee.extras, TEE_KEYS)
    given = {key: tee.extras[key] for key in TEE_KEYS if key in tee.extras}
    place = {} if "lower" in given else {"at": tee.at[:2]}
    return {"height": tee.at[2]} | place | given


def _describe_cup(cup: SceneObject) -> dict[str, Any]:
    check_properties("the cup", cup.extras, CUP_KEYS)
    given = {key: read_property(key, cup.extras[key]) for key in CUP_KEYS if key in cup.extras}
    if "surface" in given:
        one_of(given["surface"], tuple(BUILTIN_SURFACES), "surface")
    return {"position": cup.at} | given


def _describe_part(item: SceneObject, number: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the description of a part, and the record of its own surface by name if it has one."""
    check_properties("a part", item.extras, PART_KEYS)
    given = {key: read_property(key, item.extras[key]) for key in PART_KEYS if key in item.extras}
    own = {key: given.pop(key) for key in PHYSICS_KEYS if key in given}
    if own and "surface" in given:
        raise ValueError(
            f"surface: expected none with {', '.join(own)}, received {quote(given['surface'])}; remove one of them."
        )
    lower_name = item.name.lower()
    if own:
        given["surface"] = f"object {number}"
    elif "surface" in given:
        one_of(given["surface"], tuple(BUILTIN_SURFACES), "surface")
    else:
        default = "felt" if lower_name.startswith(FLOOR_PREFIXES) else "wood"
        given["surface"] = next((name for name in BUILTIN_SURFACES if lower_name.startswith(name)), default)
    part = {
        "kind": "mesh",
        "name": _sanitize_name(item.name),
        "file": f"object {number}",
        "floor": lower_name.startswith(FLOOR_PREFIXES),
    }
    return part | given, {given["surface"]: own} if own else {}


def _sanitize_name(name: str) -> str:
    """Return a name that course files accept: other characters are replaced."""
    allowed = "".join(c if c.isascii() and (c.isalnum() or c in " _.-") else "-" for c in name)
    return allowed.lstrip(" _.-")[:64] or "part"


def _avoid_tee_name(name: str) -> str:
    """Return the name of a part, changed if an object of that name would be read as the tee."""
    return f"part {name}" if name.lower().startswith("tee") else name


def to_glb(course: Course) -> bytes:
    """Return the content of a .glb file that ``read_glb`` reads bit for bit the same, and that 3D programs show."""
    x, y = course.tee.centre
    tee: dict[str, Any] = {"lower": course.tee.lower, "upper": course.tee.upper, "height": course.tee.height}
    objects = [SceneObject("tee", (x, y, course.tee.height), tee, None, None)]
    if course.cup is not None:
        cup = {"position": course.cup.position, "radius": course.cup.radius, "depth": course.cup.depth, "cut": True}
        objects.append(SceneObject("cup", course.cup.position, cup, None, None))
    for part in course.parts:
        mesh = part.mesh
        surface = mesh.surface
        physics = {key: getattr(surface, key) for key in PHYSICS_KEYS if getattr(surface, key, None) is not None}
        extras: dict[str, Any] = {"material": part.material, "inwards": mesh.volume < 0.0, "floor": False}
        if part.color is not None:
            extras["color"] = hex_color(part)
        color = part.color or MATERIAL_COLORS.get(part.material)
        name = _avoid_tee_name(part.name)
        objects.append(SceneObject(name, (0, 0, 0), physics | extras, mesh.vertices, mesh.faces, color))
    dumped = describe_course(course).model_dump(mode="json", exclude_none=True)
    return write_scene(objects, {key: dumped[key] for key in COURSE_KEYS if key in dumped})
