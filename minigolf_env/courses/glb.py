"""A whole hole in one .glb file: objects are the parts, the tee and the cup; extra properties say the rest.

==========  ============================================================================================
object      meaning
==========  ============================================================================================
``tee...``  an empty: where the ball starts; a mesh: anywhere above its box in plan
``cup...``  an empty at the middle of the rim; extras ``radius``, ``depth`` (m), ``cut`` (it is in the mesh)
others      parts, closed meshes; extras ``surface`` (a name), or ``damping``, ``restitution``, ``tangential``,
            ``rolling`` of its own; and ``material``, ``color``, ``floor`` (the cup is cut into it)
==========  ============================================================================================

Without extras, an object plays as the surface its name starts with; "floor" and "green" are felt that takes the cup.
The scene's extras may hold name, par, top_speed, bounds, route, ball_radius and gravity as course files do.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError
from trimesh import Trimesh

from minigolf_env.courses.course import Course, CourseError
from minigolf_env.courses.description import CourseFile
from minigolf_env.courses.files import build_course, describe, hex_color, told
from minigolf_env.courses.gltf import Object, read_scene, write_scene
from minigolf_env.courses.limits import Limits
from minigolf_env.courses.surfaces import KNOWN

FLOORS = ("floor", "green")
PLAYS = ("damping", "restitution", "tangential", "rolling", "stimp")
LOOKS = ("material", "color")
HOLE = ("name", "par", "about", "top_speed", "ball_radius", "gravity", "bounds", "route", "hole_in_one")

PAINT = {"felt": (0.25, 0.5, 0.2), "wood": (0.65, 0.45, 0.27), "cup": (0.95, 0.95, 0.95), "brick": (0.6, 0.3, 0.22)}
"""What other programs show materials as, sRGB."""


def read_glb(path: Path, cup_radius: float | None = None, limits: Limits | None = None) -> Course:
    """Return the course in a .glb file, its cup cut with another radius (m) if one is given.

    Raises:
        CourseError: the file cannot be read, or does not hold a course; the message says what is missing.
    """
    limits = limits or Limits()
    try:
        limits.check_bytes(f"course file {path.name!r}", path.stat().st_size)
        objects, extras = read_scene(path.read_bytes(), limits)
        file = _describe_objects(path.stem, objects, extras)
    except OSError as error:
        raise CourseError(f"course file: expected a readable .glb file, received {str(path)!r}: {error}") from error
    except ValidationError as error:
        raise CourseError(f"{path.name}: " + "\n".join(told(fault, "") for fault in error.errors()[:5])) from error
    except CourseError as error:
        raise CourseError(f"{path.name}: {error}") from error
    meshes = {
        f"object {number}": Trimesh(one.vertices, one.faces, process=False)
        for number, one in enumerate(objects)
        if one.vertices is not None
    }
    return build_course(file, None, cup_radius, limits, meshes)


def _describe_objects(name: str, objects: list[Object], extras: dict[str, Any]) -> CourseFile:
    tee = [one for one in objects if one.name.lower().startswith("tee")]
    cup = [one for one in objects if one.name.lower().startswith("cup") and one.vertices is None]
    if len(tee) != 1 or len(cup) > 1:
        raise CourseError(
            "expected one object named 'tee', and one empty named 'cup' at the middle of the rim, "
            f"received {len(tee)} and {len(cup)}, objects {[one.name for one in objects]!r:.200}; name them so."
        )
    surfaces: dict[str, Any] = {}
    parts = []
    for number, one in enumerate(objects):
        if one.vertices is not None and one is not tee[0]:
            surface, own = _surface(one, number)
            surfaces |= own
            floor = bool(one.extras.get("floor", one.name.lower().startswith(FLOORS)))
            looks = {key: one.extras[key] for key in (*LOOKS, "inwards") if key in one.extras}
            parts.append(
                {
                    "kind": "mesh",
                    "name": _plain(one.name),
                    "file": f"object {number}",
                    "surface": surface,
                    "floor": floor,
                }
                | looks
            )
    data = {key: extras[key] for key in HOLE if key in extras}
    data = {"name": _plain(name)} | data | {"tee": _tee(tee[0]), "parts": parts, "surfaces": surfaces}
    if cup:
        about = {key: cup[0].extras[key] for key in ("radius", "depth", "surface", "cut") if key in cup[0].extras}
        data |= {"cup": {"position": cup[0].extras.get("position", cup[0].at)} | about, "par": data.get("par", 2)}
    return CourseFile.model_validate(data)


def _tee(tee: Object) -> dict[str, Any]:
    if tee.vertices is not None:
        low, high = tee.vertices.min(axis=0).tolist(), tee.vertices.max(axis=0).tolist()
        return {"lower": low[:2], "upper": high[:2], "height": low[2]}
    known: dict[str, Any] = {key: tee.extras[key] for key in ("lower", "upper", "height") if key in tee.extras}
    if "lower" in known:
        return known
    return {"at": tee.at[:2], "height": tee.at[2]}


def _surface(one: Object, number: int) -> tuple[str, dict[str, Any]]:
    """Return the name of the surface of an object, and its own surface if it has one."""
    plays = {key: one.extras[key] for key in PLAYS if key in one.extras}
    title = str(one.extras.get("surface", ""))
    if plays:
        return f"object {number}", {f"object {number}": plays}
    if title:
        return title, {}
    name = one.name.lower()
    return next((known for known in KNOWN if name.startswith(known)), "felt" if name.startswith(FLOORS) else "wood"), {}


def _plain(name: str) -> str:
    """Return a name that course files take."""
    return (
        "".join(c if c.isascii() and (c.isalnum() or c in " _.-") else "-" for c in name).lstrip(" _.-")[:64] or "part"
    )


def _not_tee(name: str) -> str:
    return f"part {name}" if name.lower().startswith("tee") else name


def to_glb(course: Course) -> bytes:
    """Return a .glb file of a course, which ``read_glb`` reads again bit for bit, and 3D programs show."""
    file = describe(course)
    x, y = course.tee.centre
    tee: dict[str, Any] = {"lower": course.tee.lower, "upper": course.tee.upper, "height": course.tee.height}
    objects = [Object("tee", (x, y, course.tee.height), tee, None, None)]
    if course.cup is not None:
        cup = {"position": course.cup.position, "radius": course.cup.radius, "depth": course.cup.depth, "cut": True}
        objects.append(Object("cup", course.cup.position, cup, None, None))
    for part in course.parts:
        surface = part.mesh.surface
        plays = {key: getattr(surface, key) for key in PLAYS if getattr(surface, key, None) is not None}
        mesh = part.mesh
        looks: dict[str, Any] = {"material": part.material, "inwards": mesh.volume < 0.0, "floor": False}
        looks |= {} if part.color is None else {"color": hex_color(part)}
        color = part.color or PAINT.get(part.material)
        objects.append(Object(_not_tee(part.name), (0, 0, 0), plays | looks, mesh.vertices, mesh.faces, color))
    dumped = file.model_dump(mode="json", exclude_none=True)
    return write_scene(objects, {key: dumped[key] for key in HOLE if key in dumped})
