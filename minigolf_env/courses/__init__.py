"""Courses: closed triangle meshes with a tee and a cup; the bundled ones by name, and course files."""

from minigolf_env.courses.course import Course, CourseError, Cup, Part, Tee
from minigolf_env.courses.library import ROUND_COURSE, ROUND_HOLES, list_courses, load_course, par_of
from minigolf_env.courses.schema.limits import Limits

__all__ = [
    "ROUND_COURSE",
    "ROUND_HOLES",
    "Course",
    "CourseError",
    "Cup",
    "Limits",
    "Part",
    "Tee",
    "list_courses",
    "load_course",
    "par_of",
]
