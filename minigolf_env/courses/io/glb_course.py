"""Courses in one .glb file: objects are the parts, the tee and the cup; extra properties hold the rest.

==========  ============================================================================================
object      meaning
==========  ============================================================================================
``tee...``  an empty: start of the ball; a mesh: the ball starts at a random point above its bounding box
``cup...``  an empty at the centre of the rim
others      parts, closed meshes
==========  ============================================================================================

Without extras, a part has the surface that its name starts with; "floor" and "green" are felt that contains the cup.
Extras have the names and meanings of keys of course files: PHYSICS_KEYS or ``surface``, APPEARANCE_KEYS, ``floor`` and
``inwards`` of a part; ``radius``, ``depth``, ``surface``, ``cut`` and ``position`` of the cup; ``lower``, ``upper`` and
``height`` of an empty tee; COURSE_KEYS of the scene. Without extra ``par``, a course with a cup has par DEFAULT_PAR.
"""

from __future__ import annotations

import difflib
import itertools
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from trimesh import Trimesh

from minigolf_env.courses.course import DEFAULT_PAR, Course, CourseError
from minigolf_env.courses.geometry.assembly import assemble_course
from minigolf_env.courses.io.course_description import describe_course, hex_color
from minigolf_env.courses.io.gltf_scene import SceneObject, read_scene
from minigolf_env.courses.io.gltf_writer import write_scene
from minigolf_env.courses.io.validation_errors import format_validation_error
from minigolf_env.courses.schema.course_file import CourseFile
from minigolf_env.courses.schema.limits import Limits
from minigolf_env.courses.schema.surfaces import BUILTIN_SURFACES

FLOOR_PREFIXES = ("floor", "green")
"""Beginnings of the names of objects that are felt and contain the cup."""

PHYSICS_KEYS = ("damping", "restitution", "tangential", "rolling", "stimp")
"""Extra properties of a part that describe its surface; they take precedence over ``surface``."""

APPEARANCE_KEYS = ("material", "color")
"""Extra properties of a part that describe its appearance."""

COURSE_KEYS = ("name", "par", "about", "top_speed", "ball_radius", "gravity", "bounds", "route", "hole_in_one")
"""Extra properties of the scene."""

PART_KEYS = (*PHYSICS_KEYS, *APPEARANCE_KEYS, "surface", "floor", "inwards")
"""Extra properties of a part."""

CUP_KEYS = ("position", "radius", "depth", "surface", "cut")
"""Extra properties of the cup."""

TEE_KEYS = ("lower", "upper", "height")
"""Extra properties of an empty tee."""

ROW_LENGTHS = {"bounds": 3, "route": 2}
"""Length of the rows of extra properties that 3D programs can only store as one flat array."""

MIN_KEY_SIMILARITY = 0.75
"""Smallest similarity of an unknown extra property to a known one that makes it a misspelling; 3D programs and add-ons
store properties of their own."""

MAX_KEY_LENGTH = 40
"""Length of the longest unknown extra property that may be a misspelling."""

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
        limits.check_bytes(f"course file {path.name!r}", path.stat().st_size)
        objects, extras = read_scene(path.read_bytes(), limits)
        file = _describe_objects(path.stem, objects, extras)
    except OSError as error:
        raise CourseError(f"course file: expected a readable .glb file, received {str(path)!r}: {error}") from error
    except ValidationError as error:
        lines = [format_validation_error(fault, "") for fault in error.errors()[:5]]
        raise CourseError(f"{path.name}: " + "\n".join(lines)) from error
    except CourseError as error:
        raise CourseError(f"{path.name}: {error}") from error
    meshes = {
        f"object {number}": Trimesh(item.vertices, item.faces, process=False)
        for number, item in enumerate(objects)
        if item.vertices is not None
    }
    return assemble_course(file, meshes.__getitem__, cup_radius, limits)


def _describe_objects(name: str, objects: list[SceneObject], extras: dict[str, Any]) -> CourseFile:
    """Return the description of a scene, in which each mesh is named by the number of its object."""
    # Find the tee and the cup.
    tees = [item for item in objects if item.name.lower().startswith("tee")]
    named_cup = [item for item in objects if item.name.lower().startswith("cup")]
    cups = [item for item in named_cup if item.vertices is None]
    if named_cup and not cups:
        raise CourseError(
            f"object {named_cup[0].name!r:.60}: expected an empty at the middle of the rim, received a mesh; "
            "put an empty there, name it 'cup', and name the mesh otherwise."
        )
    if len(tees) != 1 or len(cups) > 1:
        raise CourseError(
            "expected one object named 'tee', and one empty named 'cup' at the middle of the rim, "
            f"received {len(tees)} and {len(cups)}, objects {[item.name for item in objects]!r:.200}; name them so."
        )
    _check_extras("scene", extras, COURSE_KEYS)
    _check_extras(f"object {tees[0].name!r:.60}", tees[0].extras, TEE_KEYS)
    for cup in cups:
        _check_extras(f"object {cup.name!r:.60}", cup.extras, CUP_KEYS)
    # All other meshes are parts.
    surfaces: dict[str, Any] = {}
    parts = []
    for number, item in enumerate(objects):
        if item.vertices is not None and item is not tees[0]:
            _check_extras(f"object {item.name!r:.60}", item.extras, PART_KEYS)
            surface, own_surface = _surface_of(item, number)
            surfaces |= own_surface
            part = {
                "kind": "mesh",
                "name": _sanitize_name(item.name),
                "file": f"object {number}",
                "surface": surface,
                "floor": bool(item.extras.get("floor", item.name.lower().startswith(FLOOR_PREFIXES))),
            }
            parts.append(part | {key: item.extras[key] for key in (*APPEARANCE_KEYS, "inwards") if key in item.extras})
    # Take the keys of the course and the cup from the extra properties.
    data = {key: _nest(key, extras[key]) for key in COURSE_KEYS if key in extras}
    data = {"name": _sanitize_name(name)} | data
    data |= {"tee": _describe_tee(tees[0]), "parts": parts, "surfaces": surfaces}
    if cups:
        cup = cups[0]
        fields = {key: cup.extras[key] for key in CUP_KEYS[1:] if key in cup.extras}
        data |= {"cup": {"position": cup.extras.get("position", cup.at)} | fields, "par": data.get("par", DEFAULT_PAR)}
    return CourseFile.model_validate(data)


def _check_extras(owner: str, extras: dict[str, Any], known: tuple[str, ...]) -> None:
    """Raise a CourseError for an extra property that is a known one, misspelt."""
    for key in itertools.islice((key for key in extras if key not in known and len(key) <= MAX_KEY_LENGTH), 100):
        close = difflib.get_close_matches(key.lower(), known, n=1, cutoff=MIN_KEY_SIMILARITY)
        if close:
            raise CourseError(f"{owner}: unknown property {key!r}; did you mean {close[0]!r}?")


def _nest(key: str, value: Any) -> Any:
    """Return the value of an extra property of the scene as course files have it.

    Blender stores a whole number such as 3 as 3.0, and a list of points as a flat array.
    """
    if key == "par" and isinstance(value, float) and value.is_integer():
        return int(value)
    length = ROW_LENGTHS.get(key)
    if length and isinstance(value, list) and value and len(value) % length == 0 and not isinstance(value[0], list):
        return [value[k : k + length] for k in range(0, len(value), length)]
    return value


def _describe_tee(tee: SceneObject) -> dict[str, Any]:
    if tee.vertices is not None:
        low = tee.vertices.min(axis=0).tolist()
        high = tee.vertices.max(axis=0).tolist()
        return {"lower": low[:2], "upper": high[:2], "height": low[2]}
    fields: dict[str, Any] = {key: tee.extras[key] for key in TEE_KEYS if key in tee.extras}
    return fields if "lower" in fields else {"at": tee.at[:2], "height": tee.at[2]}


def _surface_of(item: SceneObject, number: int) -> tuple[str, dict[str, Any]]:
    """Return the name of an object's surface, and the record of its own surface by name if it has one."""
    own = {key: item.extras[key] for key in PHYSICS_KEYS if key in item.extras}
    if own:
        return f"object {number}", {f"object {number}": own}
    named = str(item.extras.get("surface", ""))
    if named:
        return named, {}
    name = item.name.lower()
    default = "felt" if name.startswith(FLOOR_PREFIXES) else "wood"
    return next((surface for surface in BUILTIN_SURFACES if name.startswith(surface)), default), {}


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
