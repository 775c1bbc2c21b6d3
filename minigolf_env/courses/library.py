"""Loading of courses: bundled ones and levels by name, course files by path."""

from __future__ import annotations

import functools
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from minigolf_env._validation import one_of, positive_number, quote
from minigolf_env.courses.course import Course, CourseError
from minigolf_env.courses.procedural import PROCEDURAL_COURSE, is_level_name, level_name, load_level
from minigolf_env.courses.schema.limits import Limits

DATA_DIR = Path(__file__).parent / "data"
"""Folder of the bundled course files."""

HOLE_NAMES = (
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
"""Names of the bundled courses with a cup, in the order of play."""

ROUND_COURSE = "round"
"""Name of the course whose episodes are the holes of ROUND_HOLES in turn."""

ROUND_HOLES = HOLE_NAMES[:9]
"""Names of the nine holes of a round."""

ROOM_NAMES = ("room",)
"""Names of the bundled courses without a cup, in which a ball is thrown and bounces."""

COURSE_FILE_SUFFIXES = (".toml", ".glb")
"""Suffixes of course files."""

COURSE_CACHE_SIZE = 64
"""Number of courses from files that are kept."""


@dataclass
class _CachedCourse:
    """Course from a file, with the mesh files it was built from and their modification times."""

    course: Course
    mesh_files: tuple[Path, ...] = ()
    mesh_mtimes: tuple[int, ...] = ()


def list_courses() -> list[str]:
    """Return the names of the bundled holes."""
    return list(HOLE_NAMES)


def load_course(name: str | Path | Course, cup_radius: float | None = None, limits: Limits | None = None) -> Course:
    """Return a course by its name or file; a Course is returned unchanged.

    Courses are immutable: the same request returns the same object until the file, or a mesh file that it names,
    changes.

    Args:
        name: one of ``list_courses()``; "room", which has no cup; a level such as "procedural-v1-easy-17"; the path of
            a .toml or .glb file; or a Course.
        cup_radius: radius of the cup that is cut into the floor, m; None: the course's own.
        limits: limits on the size of the file and the course that it describes; None: the default.

    Raises:
        CourseError: the course does not exist, its file has a fault, its cup is already cut, or the radius does not
            suit the ball or the floor.
    """
    if isinstance(name, Course):
        return _check_unchanged(name, cup_radius)
    try:
        radius = None if cup_radius is None else positive_number(cup_radius, "cup_radius", "the rules have 0.054 m.")
        if is_level_name(name):
            return load_level(str(name), radius)
        path = _find_file(name)
    except CourseError:
        raise
    except ValueError as error:
        raise CourseError(str(error)) from error
    limits = limits or Limits()
    cached = _load_cached(path, path.stat().st_mtime_ns, radius, limits)
    if cached.mesh_mtimes != _mtimes(cached.mesh_files):
        fresh = _load_file(path, radius, limits)
        cached.course = fresh.course
        cached.mesh_files = fresh.mesh_files
        cached.mesh_mtimes = fresh.mesh_mtimes
    return cached.course


def par_of(name: str) -> int | None:
    """Return a course's par, like ``load_course(name).par``, but of a bundled hole without building its meshes.

    Raises:
        CourseError: see ``load_course``.
    """
    return _bundled_par(name) if name in HOLE_NAMES else load_course(name).par


@functools.cache
def _bundled_par(name: str) -> int | None:
    from minigolf_env.courses.io.toml_course import read_description

    return read_description(_find_file(name)).par


def _find_file(name: str | Path) -> Path:
    """Return the file of a course, or raise a ValueError."""
    if not isinstance(name, str | os.PathLike):
        raise ValueError(f"course: expected a name or the path of a file, received {quote(name)}; see list_courses().")
    name = str(name)
    if Path(name).suffix.lower() in COURSE_FILE_SUFFIXES:
        path = Path(name)
        if os.path.isfile(path):  # noqa: PTH113 - Path.is_file raises an OSError for a name that is too long.
            return path.resolve()
        raise ValueError(
            f"course: expected a course file, received {quote(name)}, which does not exist; check the path."
        )
    if name == PROCEDURAL_COURSE:
        raise ValueError(
            f"course: expected one hole, received {quote(name)}, which names all levels; "
            f"name one of them, such as {quote(level_name('easy', 17))}."
        )
    return DATA_DIR / f"{one_of(name, HOLE_NAMES + ROOM_NAMES, 'course')}.toml"


def _check_unchanged(course: Course, cup_radius: float | None) -> Course:
    """Return a Course, or raise a CourseError if its cup would have to change."""
    if cup_radius is None or (course.cup is not None and cup_radius == course.cup.radius):
        return course
    raise CourseError(
        f"cup_radius: expected None with a Course, whose cup is already cut, received {quote(cup_radius)}; "
        "give the name of a bundled course, or build the Course with that cup."
    )


def _mtimes(files: Sequence[Path]) -> tuple[int, ...]:
    """Return the modification times of the files that exist, ns."""
    return tuple(file.stat().st_mtime_ns for file in files if file.is_file())


@functools.lru_cache(maxsize=COURSE_CACHE_SIZE)
def _load_cached(path: Path, mtime: int, cup_radius: float | None, limits: Limits) -> _CachedCourse:
    """Return the course of a file with a modification time (ns), from the cache if possible."""
    return _load_file(path, cup_radius, limits)


def _load_file(path: Path, cup_radius: float | None, limits: Limits) -> _CachedCourse:
    """Read a course file once, and build its course.

    The readers are imported here, because their libraries take longer to load than the rest of the package.
    """
    if path.suffix.lower() == ".glb":
        from minigolf_env.courses.io.glb_course import read_glb

        return _CachedCourse(read_glb(path, cup_radius, limits))
    from minigolf_env.courses.io.toml_course import build_course_of_file, read_description

    description = read_description(path, limits)
    names = (getattr(part, "file", None) for part in description.parts)
    mesh_files = tuple(path.parent / name for name in names if name is not None)
    # Take the times first: a mesh that changes while the course is built is read again by the next request.
    mesh_mtimes = _mtimes(mesh_files)
    return _CachedCourse(build_course_of_file(description, path, cup_radius, limits), mesh_files, mesh_mtimes)
