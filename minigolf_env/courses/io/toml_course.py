"""Course files in TOML: reading with errors that name line and key, and writing."""

from __future__ import annotations

import functools
import re
import tomllib
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from minigolf_env._validation import quote, quote_error, quote_unless_plain
from minigolf_env.courses.course import Course, CourseError
from minigolf_env.courses.geometry.assembly import assemble_course
from minigolf_env.courses.io.course_description import describe_course
from minigolf_env.courses.io.mesh_files import read_mesh
from minigolf_env.courses.io.validation_errors import find_line, format_faults, format_validation_error
from minigolf_env.courses.schema.course_file import CourseFile
from minigolf_env.courses.schema.limits import Limits

KEY_DOT = re.compile(r"\.[ \t]*(?=[\w\"'-])")
"""Dot that separates the parts of a key; a row of dots in a comment does not match."""

MAX_KEY_DOTS = 100
"""Largest number of dots in a key; course files need two."""

TOML_TABLE_HEADER = re.compile(r"^[ \t]*\[{1,2}[^\[\],=\n]*\]", re.MULTILINE)
"""Header of a table; a row of an array that has two numbers does not match."""

LONG_INTEGER = re.compile(r"\b0[xob][\da-fA-F_]{1000}")
"""Integer whose digits Python would not print: tomllib refuses only those in decimal notation."""

MAX_KEY_PARTS = 50_000
"""Largest number of parts of all table headers and dotted keys: tomllib takes about a kilobyte for each."""


def read_description(path: Path, limits: Limits | None = None) -> CourseFile:
    """Return the description in a TOML file.

    Raises:
        CourseError: the file cannot be read, is not TOML, or does not describe a course; the message names the file,
            the line, the key, what was expected and what was received.
    """
    limits = limits or Limits()
    try:
        limits.check_bytes(f"course file {quote(path.name)}", path.stat().st_size, text=True)
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise CourseError(
            f"course file: expected a TOML file in UTF-8, received {quote(str(path))}: {error}; save it as UTF-8."
        ) from error
    except OSError as error:
        raise CourseError(
            f"course file: expected a readable TOML file, received {quote(str(path))}: {quote_error(error)}"
        ) from error
    return parse_description(text, quote_unless_plain(path.name))


def parse_description(text: str, name: str = "course file") -> CourseFile:
    """Return the description in TOML text; ``name`` is the name of the file in error messages.

    Raises:
        CourseError: see ``read_description``.
    """
    try:
        _check_key_lengths(text)
        if LONG_INTEGER.search(text):
            raise ValueError("an integer of more than 1000 digits")
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise CourseError(f"{name}: expected TOML, received text that is not: {quote_error(error)}") from error
    return validate_description(data, name, text)


def validate_description(data: dict[str, Any], name: str, text: str = "") -> CourseFile:
    """Return the description that a dictionary holds.

    Args:
        data: content of a course file.
        name: name of the file in error messages.
        text: text of the file, in which errors find their line; empty: there is none.

    Raises:
        CourseError: see ``read_description``.
    """
    try:
        return CourseFile.model_validate(data)
    except ValidationError as error:
        faults = format_faults(error, lambda fault: format_validation_error(fault, text))
        raise CourseError(f"{name}: {faults}") from error


def read_course(path: Path, cup_radius: float | None = None, limits: Limits | None = None) -> Course:
    """Return the course in a TOML file, with another cup radius (m) if one is given.

    Raises:
        CourseError: see ``read_description``, or the described course cannot be built.
    """
    return build_course_of_file(read_description(path, limits), path, cup_radius, limits)


def build_course_of_file(
    file: CourseFile, path: Path, cup_radius: float | None = None, limits: Limits | None = None
) -> Course:
    """Return the course of the description that was read from a file.

    Raises:
        CourseError: the described course cannot be built; the message names the file and, if possible, the line.
    """
    try:
        return build_course(file, path.parent, cup_radius, limits)
    except CourseError as error:
        if not error.location:
            raise
        line = find_line(error.location, path.read_text(encoding="utf-8-sig"))
        where = "" if line is None else f"line {line}: "
        raise CourseError(f"{quote_unless_plain(path.name)}: {where}{error}") from error


def build_course(
    file: CourseFile, folder: Path | None = None, cup_radius: float | None = None, limits: Limits | None = None
) -> Course:
    """Return the course of a description.

    Args:
        file: the description.
        folder: folder of the mesh files that the description names; None: there are none.
        cup_radius: radius of the cup in place of the file's, m; None: the file's.
        limits: limits on the size of files and the course; None: the default.

    Raises:
        CourseError: the described course cannot be built.
    """
    load_mesh = functools.partial(read_mesh, folder=folder, limits=limits or Limits())
    return assemble_course(file, load_mesh, cup_radius, limits)


def to_toml(course: Course | CourseFile) -> str:
    """Return the text of a course file; a Course is written out triangle by triangle and loads with the same bits."""
    file = course if isinstance(course, CourseFile) else describe_course(course)
    return tomli_w.dumps(file.model_dump(mode="json", exclude_defaults=True))


def _check_key_lengths(text: str) -> None:
    """Raise a ValueError for keys of very many parts, for each of which tomllib makes a table.

    For one key its time and memory are quadratic in the number of parts.
    """
    num_parts = sum(1 for _ in TOML_TABLE_HEADER.finditer(text))
    for piece in re.split(r"[=,\[\]{}\n#]", text):
        dots = len(KEY_DOT.findall(piece))
        if dots > MAX_KEY_DOTS:
            raise ValueError(f"a key of more than {MAX_KEY_DOTS} parts")
        num_parts += dots if dots > 1 or piece.lstrip()[:1].isalpha() else 0  # A number has one dot.
    if num_parts > MAX_KEY_PARTS:
        raise ValueError(f"table headers and dotted keys of more than {MAX_KEY_PARTS} parts")
