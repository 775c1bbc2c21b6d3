"""The bundled courses by name."""

from __future__ import annotations

import functools

from minigolf_env.courses.course import Course, CourseError
from minigolf_env.courses.procedural import is_level_name, load_level
from minigolf_env.physics.checks import one_of, positive_number

HOLES = ("dogleg",)
"""Courses with a cup."""

ROOMS = ("room",)
"""Courses without: a ball is thrown and bounces."""

FILES = (".toml", ".glb")
"""Endings of the course files that a later version will read."""


def list_courses() -> list[str]:
    """Return the names of the playable holes."""
    return list(HOLES)


def load_course(name: str | Course, cup_radius: float | None = None) -> Course:
    """Return a course by its name, or a Course as it is. Courses are immutable: the same request gives the same one.

    Args:
        name: one of ``list_courses()``; "room", which has no cup; a level such as "procedural-v1-easy-17"; or a Course.
        cup_radius: m; the hole is cut anew into the floor. None: the course's.

    Raises:
        CourseError: no such course, one without cup or already cut, or a radius that the ball or the floor does not
            take.
    """
    if isinstance(name, Course):
        return _as_it_is(name, cup_radius)
    if is_level_name(name):
        return load_level(name, cup_radius)
    if str(name).endswith(FILES):
        raise CourseError(
            f"course: expected one of {HOLES + ROOMS}, received {name!r}; course files come in a later version."
        )
    try:
        known = one_of(name, HOLES + ROOMS, "course")
        radius = None if cup_radius is None else positive_number(cup_radius, "cup_radius", "the rules have 0.054 m.")
    except ValueError as error:
        raise CourseError(str(error)) from error
    return _build(known, radius)


def _as_it_is(course: Course, cup_radius: float | None) -> Course:
    if cup_radius is None or (course.cup is not None and cup_radius == course.cup.radius):
        return course
    raise CourseError(
        f"cup_radius: expected None with a Course, whose cup is already cut, received {cup_radius!r}; "
        "give the name of a bundled course, or build the Course with that cup."
    )


@functools.lru_cache(maxsize=64)
def _build(name: str, cup_radius: float | None) -> Course:
    """Return the bundled course; imported here, because trimesh and shapely take longer than all the rest to load."""
    from minigolf_env.courses import dogleg, room

    if name == "dogleg":
        return dogleg.build() if cup_radius is None else dogleg.build(cup_radius)
    if cup_radius is not None:
        raise CourseError(f"cup_radius: expected None for {name!r}, which has no cup, received {cup_radius!r}.")
    return room.build()
