"""Courses by name, and course files by path."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

from minigolf_env._validation import one_of, positive_number
from minigolf_env.courses.course import Course, CourseError
from minigolf_env.courses.limits import Limits
from minigolf_env.courses.procedural import PROCEDURAL, is_level_name, level_name, load_level

DATA = Path(__file__).parent / "data"

HOLES = (
    "straight",
    "dogleg",
    "bank",
    "hill",
    "gap",
    "funnel",
    "tunnel",
    "halfpipe",
    "loop",
    "volcano",
    "islands",
    "green100k",
)
"""Courses with a cup, in the order of play."""

ROUND = "round"
"""The course whose episodes are the holes of NINE in turn."""

NINE = HOLES[:9]
"""The holes of a round; the others are for those who want more."""

ROOMS = ("room",)
"""Courses without: a ball is thrown and bounces."""

FILES = (".toml", ".glb")
"""Endings of course files."""


def list_courses() -> list[str]:
    """Return the names of the playable holes."""
    return list(HOLES)


def load_course(name: str | Path | Course, cup_radius: float | None = None, limits: Limits | None = None) -> Course:
    """Return a course by its name or file, or a Course as it is.

    Courses are immutable: the same request gives the same one, as long as the file, and those it names, stay the same.

    Args:
        name: one of ``list_courses()``; "room", which has no cup; a level such as "procedural-v1-easy-17"; the path of
            a .toml or .glb file; or a Course.
        cup_radius: m; the hole is cut anew into the floor. None: the course's.
        limits: on the size of a file and what it describes; None: the default.

    Raises:
        CourseError: no such course, a fault in its file, a cup that is already cut, or a radius that the ball or the
            floor does not take.
    """
    if isinstance(name, Course):
        return _as_it_is(name, cup_radius)
    if is_level_name(name):
        return load_level(str(name), cup_radius)
    try:
        radius = None if cup_radius is None else positive_number(cup_radius, "cup_radius", "the rules have 0.054 m.")
        path = _path(name)
    except ValueError as error:
        raise CourseError(str(error)) from error
    limits = limits or Limits()
    stamps = _stamps([path])
    return _read(path, stamps + _stamps(_meshes(path, stamps, limits)), radius, limits)


def par_of(name: str) -> int | None:
    """Return a course's par, as ``load_course(name).par``; of a bundled one without building its meshes.

    Raises:
        CourseError: as for ``load_course``.
    """
    if name not in HOLES:
        return load_course(name).par
    from minigolf_env.courses.files import read_description

    return read_description(_path(name)).par


def _path(name: str | Path) -> Path:
    """Return the file of a course, or raise a ValueError."""
    name = str(name)
    if Path(name).suffix.lower() in FILES:
        path = Path(name)
        if path.is_file():
            return path.resolve()
        raise ValueError(f"course: expected a course file, received {name!r}, which is not there; check the path.")
    if name == PROCEDURAL:
        raise ValueError(
            f"course: expected one hole, received {name!r}, which is endless levels; "
            f"name one of them, such as {level_name('easy', 17)!r}."
        )
    return DATA / f"{one_of(name, HOLES + ROOMS, 'course')}.toml"


def _as_it_is(course: Course, cup_radius: float | None) -> Course:
    if cup_radius is None or (course.cup is not None and cup_radius == course.cup.radius):
        return course
    raise CourseError(
        f"cup_radius: expected None with a Course, whose cup is already cut, received {cup_radius!r}; "
        "give the name of a bundled course, or build the Course with that cup."
    )


def _stamps(files: Sequence[Path]) -> tuple[int, ...]:
    """Return when the files that are there were changed."""
    return tuple(file.stat().st_mtime_ns for file in files if file.is_file())


@functools.lru_cache(maxsize=64)
def _meshes(path: Path, changed: tuple[int, ...], limits: Limits) -> list[Path]:
    """Return the mesh files beside a course file that it names."""
    if path.suffix.lower() != ".toml" or path.parent == DATA:
        return []
    from minigolf_env.courses.files import read_description

    names = (getattr(part, "file", None) for part in read_description(path, limits).parts)
    return [path.parent / name for name in names if name is not None]


@functools.lru_cache(maxsize=64)
def _read(path: Path, changed: tuple[int, ...], cup_radius: float | None, limits: Limits) -> Course:
    """Return a file's course; imported here, because the libraries take longer than all the rest to load."""
    if path.suffix.lower() == ".glb":
        from minigolf_env.courses.glb import read_glb

        return read_glb(path, cup_radius, limits)
    from minigolf_env.courses.files import read_course

    return read_course(path, cup_radius, limits)
