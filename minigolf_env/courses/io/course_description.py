"""Description of a Course: its meshes written out triangle by triangle, as a course file can hold them."""

from __future__ import annotations

from typing import Any

from minigolf_env.courses.course import Course, Part
from minigolf_env.courses.schema.course_file import CourseFile


def describe_course(course: Course) -> CourseFile:
    """Return the description of a Course, with its meshes written out and its cup already cut."""
    cup = None
    if course.cup is not None:
        cup = {"position": course.cup.position, "radius": course.cup.radius, "depth": course.cup.depth, "cut": True}
    data: dict[str, Any] = {
        "name": course.name,
        "par": course.par,
        "top_speed": course.top_speed,
        "ball_radius": course.ball_radius,
        "gravity": course.gravity,
        "bounds": course.bounds,
        "route": course.route[1:-1],
        "tee": {"lower": course.tee.lower, "upper": course.tee.upper, "height": course.tee.height},
        "cup": cup,
        "surfaces": {f"surface {number}": _describe_surface(part) for number, part in enumerate(course.parts)},
        "parts": [_describe_part(number, part) for number, part in enumerate(course.parts)],
    }
    return CourseFile.model_validate(data)


def _describe_surface(part: Part) -> dict[str, Any]:
    surface = part.mesh.surface
    fields = ("damping", "restitution", "tangential", "rolling")
    return {field: getattr(surface, field) for field in fields} | {"material": part.material, "color": hex_color(part)}


def _describe_part(number: int, part: Part) -> dict[str, Any]:
    return {
        "kind": "mesh",
        "name": part.name,
        "surface": f"surface {number}",
        "inwards": part.mesh.volume < 0.0,
        "vertices": part.mesh.vertices.tolist(),
        "faces": part.mesh.faces.tolist(),
    }


def hex_color(part: Part) -> str | None:
    """Return a part's colour in the notation of course files, such as "#c03020"; None if it has none."""
    return None if part.color is None else "#" + "".join(f"{round(255 * value):02x}" for value in part.color)
