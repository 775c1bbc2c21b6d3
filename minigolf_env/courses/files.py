"""Course files: TOML read into descriptions, with errors that name line and key; and courses written to TOML."""

from __future__ import annotations

import json
import re
import reprlib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError
from trimesh import Trimesh

from minigolf_env._validation import one_of
from minigolf_env.courses.build import build
from minigolf_env.courses.course import Course, CourseError, Part
from minigolf_env.courses.description import CourseFile
from minigolf_env.courses.limits import Limits

SCHEMA = Path(__file__).parent / "data" / "course.schema.json"
"""What editors complete course files from."""

PLAIN = re.compile(r"[\w-]+")
"""A key that is written as it is; in others there may be anything, a terminal's commands too."""

DOT = re.compile(r"\.[ \t]*(?=[\w\"'-])")
"""A dot that parts a key; a row of dots in a comment is none."""

MOST_DOTS = 100
"""Dots in a key; descriptions need two."""


def read_description(path: Path, limits: Limits | None = None) -> CourseFile:
    """Return what a TOML file describes.

    Raises:
        CourseError: the file cannot be read, is not TOML, or does not describe a course; the message names file, line,
            key, what was expected and what received.
    """
    limits = limits or Limits()
    try:
        limits.check_bytes(f"course file {path.name!r}", path.stat().st_size, text=True)
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CourseError(f"course file: expected a readable TOML file, received {str(path)!r}: {error}") from error
    return parse_description(text, path.name)


def parse_description(text: str, name: str = "course file") -> CourseFile:
    """Return what TOML text describes; ``name`` is what errors call it.

    Raises:
        CourseError: see ``read_description``.
    """
    try:
        _check_keys(text)
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise CourseError(f"{name}: expected TOML, received text that is not: {error}") from error
    return describe_data(data, name, text)


def describe_data(data: dict[str, Any], name: str, text: str = "") -> CourseFile:
    """Return the description that plain data hold; ``name`` and ``text`` are what errors refer to.

    Raises:
        CourseError: see ``read_description``.
    """
    try:
        return CourseFile.model_validate(data)
    except ValidationError as error:
        found = error.errors(include_url=False, include_context=True)
        places = [fault["loc"] for fault in found]
        # A list with a fault in it is told of twice: once for itself.
        faults = [f for f in found if not any(f["loc"] == loc[: len(f["loc"])] != loc for loc in places)]
        lines = [told(fault, text) for fault in faults[:5]]
        more = f"\nand {len(faults) - 5} more" if len(faults) > 5 else ""
        raise CourseError(f"{name}: " + "\n".join(lines) + more) from error


def read_course(path: Path, cup_radius: float | None = None, limits: Limits | None = None) -> Course:
    """Return the course that a TOML file describes, its cup cut with another radius (m) if one is given.

    Raises:
        CourseError: as ``read_description``, or what is described cannot be built.
    """
    return build_course(read_description(path, limits), path.parent, cup_radius, limits)


def build_course(
    file: CourseFile,
    folder: Path | None = None,
    cup_radius: float | None = None,
    limits: Limits | None = None,
    objects: Mapping[str, Trimesh] | None = None,
) -> Course:
    """Return the course of a description; see ``read_course``. ``objects`` stand for mesh files of these names."""
    if cup_radius is not None:
        if file.cup is None:
            raise CourseError(
                f"cup_radius: expected None for {file.name!r}, which has no cup, received {cup_radius!r}."
            )
        if file.cup.cut and cup_radius != file.cup.radius:
            raise CourseError(
                f"cup_radius: expected None for {file.name!r}, whose cup is already cut, received {cup_radius!r}."
            )
        file = file.model_copy(update={"cup": file.cup.model_copy(update={"radius": cup_radius})})
    try:
        return build(file, folder, limits, objects)
    except CourseError:
        raise
    except Exception as error:  # Geometry libraries raise errors of many kinds on degenerate outlines.
        raise CourseError(
            f"course {file.name!r}: expected shapes with an area, received some that {type(error).__name__} "
            f"arises from: {error}; simplify them."
        ) from error


def to_toml(course: Course | CourseFile) -> str:
    """Return a course file's text; a Course is written out triangle by triangle, and read again bit for bit."""
    file = course if isinstance(course, CourseFile) else describe(course)
    return tomli_w.dumps(file.model_dump(mode="json", exclude_defaults=True) | _kinds(file))


def describe(course: Course) -> CourseFile:
    """Return the description of a Course: its meshes written out, its cup already cut."""
    cup = course.cup
    data: dict[str, Any] = {
        "name": course.name,
        "par": course.par,
        "top_speed": course.top_speed,
        "ball_radius": course.ball_radius,
        "gravity": course.gravity,
        "bounds": course.bounds,
        "route": course.route[1:-1],
        "tee": {"lower": course.tee.lower, "upper": course.tee.upper, "height": course.tee.height},
        "cup": None
        if cup is None
        else {"position": cup.position, "radius": cup.radius, "depth": cup.depth, "cut": True},
        "surfaces": {f"surface {number}": _surface(part) for number, part in enumerate(course.parts)},
        "parts": [_mesh(number, part) for number, part in enumerate(course.parts)],
    }
    return CourseFile.model_validate(data)


def _surface(part: Part) -> dict[str, Any]:
    surface = part.mesh.surface
    fields = ("damping", "restitution", "tangential", "rolling")
    return {field: getattr(surface, field) for field in fields} | {"material": part.material, "color": hex_color(part)}


def hex_color(part: Part) -> str | None:
    """Return a part's colour as course files write it."""
    return None if part.color is None else "#" + "".join(f"{round(255 * share):02x}" for share in part.color)


def _mesh(number: int, part: Part) -> dict[str, Any]:
    vertices, faces = part.mesh.vertices.tolist(), part.mesh.faces.tolist()
    return {
        "kind": "mesh",
        "name": part.name,
        "surface": f"surface {number}",
        "inwards": part.mesh.volume < 0.0,
        "vertices": vertices,
        "faces": faces,
    }


def _kinds(file: CourseFile) -> dict[str, Any]:
    """Return the parts with their kinds, which are defaults and yet needed."""
    whole = file.model_dump(mode="json", exclude_none=True)["parts"]
    brief = file.model_dump(mode="json", exclude_defaults=True)["parts"]
    return {"parts": [_with_kind(full, short) for full, short in zip(whole, brief, strict=True)]}


def _with_kind(full: dict[str, Any], short: dict[str, Any]) -> dict[str, Any]:
    heights = {}
    if "heights" in short:
        pairs = zip(full["heights"], short["heights"], strict=True)
        heights = {"heights": [{"kind": one["kind"]} | brief for one, brief in pairs]}
    return {"kind": full["kind"]} | short | heights


def schema() -> str:
    """Return the JSON schema of course files; ``data/course.schema.json`` holds it."""
    return json.dumps(CourseFile.model_json_schema(), indent=1) + "\n"


def _check_keys(text: str) -> None:
    """Raise a ValueError for keys of very many parts: tomllib's time and memory grow with the square of them."""
    parts = max(len(DOT.findall(piece)) for piece in re.split(r"[=,\[\]{}\n#]", text))
    if parts > MOST_DOTS:
        raise ValueError(f"a key of more than {MOST_DOTS} parts")


def told(fault: Any, text: str) -> str:
    """Return one line about a fault that pydantic found: where, what was expected, what received."""
    where, line = _where(fault["loc"], text, fault["type"] == "missing")
    message = f"{fault['msg'][:1].lower()}{fault['msg'][1:]}".replace("input should be", "expected")
    message = message.replace("field required", "expected this key, received none; add it")
    if fault["type"] == "union_tag_invalid":
        known = re.findall(r"'(\w+)'", fault["ctx"]["expected_tags"])
        try:
            one_of(fault["ctx"]["tag"], known, "kind")
        except ValueError as error:
            message = str(error)
    elif fault["type"] not in ("missing", "unknown_key"):
        message += f", received {reprlib.repr(fault['input'])}"
    return f"{f'line {line}: ' if line else ''}{f'{where}: ' if where else ''}{message}"


def _where(loc: tuple[int | str, ...], text: str, missing: bool) -> tuple[str, int | None]:
    """Return a fault's place as a path of keys, and the line in which the last key found is set."""
    path, keys = "", []
    tags = {"point", "arc", "radial", "along", "waves"}
    for number, step in enumerate(loc):
        if isinstance(step, int):
            path += f"[{step}]"
        elif step in tags or (number == 2 and loc[0] == "parts"):
            continue
        else:
            name = step if PLAIN.fullmatch(step) else repr(step)
            path += f".{name}" if path else name
            keys.append(step)
    lines = [line.lstrip() for line in text.splitlines()]
    at = None
    keys = keys[:-1] if missing else keys
    if loc[:1] == ("parts",) and len(loc) > 1 and isinstance(loc[1], int):
        headers = [k for k, line in enumerate(lines) if re.match(r"\[\[\s*parts\s*\]\]", line)]
        if loc[1] >= len(headers):
            return path, None
        at, keys = headers[loc[1]], keys[1:]
    for key in keys:
        pattern = re.compile(rf"(\[*\s*|.*[\s{{.]){re.escape(key)}\s*[=\].]")
        start = at or 0
        found = next((k for k in range(start, len(lines)) if pattern.match(lines[k])), None)
        if found is None:
            break
        at = found
    return path, None if at is None else at + 1
