"""Courses: closed triangle meshes with a tee and a cup, and the bundled ones by name."""

from minigolf_env.courses.course import Course, CourseError, Cup, Part, Tee
from minigolf_env.courses.library import NINE, ROUND, list_courses, load_course, par_of

__all__ = ["NINE", "ROUND", "Course", "CourseError", "Cup", "Part", "Tee", "list_courses", "load_course", "par_of"]
