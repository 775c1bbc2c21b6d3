"""A hole made in Python: the same as a course file, in a few lines.

::

    hole = Hole("lane with a post", tee=(0.4, 0.5), cup=(4.5, 0.5, 0.0), top_speed=5.0)
    hole.add("lane", outline=[{"box": (0, 0, 5, 1)}])
    hole.add("cylinder", at=(2.5, 0.5, -0.05), radius=0.1, height=0.2, surface="stone")
    course = hole.course()
    hole.save("post.toml")
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from minigolf_env._atomic_io import write_text
from minigolf_env.courses.course import Course, Point2, Point3
from minigolf_env.courses.description import CourseFile
from minigolf_env.courses.files import build_course, describe_data, to_toml


class Hole:
    """A hole in the making.

    Args:
        name: of the course.
        tee: x, y of the ball, m; or {"lower": ..., "upper": ..., "height": ...}.
        cup: the middle of its rim, m; or {"position": ..., "radius": ...}; None: no golf.
        fields: the others of a course file, such as par, top_speed and route.
    """

    def __init__(
        self, name: str, tee: Point2 | dict[str, Any], cup: Point3 | dict[str, Any] | None = None, **fields: Any
    ) -> None:
        self._data: dict[str, Any] = {"name": name, "tee": tee if isinstance(tee, dict) else {"at": tee}, **fields}
        if cup is not None:
            self._data["cup"] = cup if isinstance(cup, dict) else {"position": cup}
            self._data.setdefault("par", 2)
        self._parts: list[dict[str, Any]] = []
        self._surfaces: dict[str, dict[str, Any]] = {}

    def add(self, kind: str, **fields: Any) -> Hole:
        """Add a part of a kind ("lane", "block", "mesh" ...), with the fields that course files give it."""
        self._parts.append({"kind": kind, **fields})
        return self

    def surface(self, name: str, **fields: Any) -> Hole:
        """Describe a surface that parts can name."""
        self._surfaces[name] = fields
        return self

    def description(self) -> CourseFile:
        """Return what a course file would hold.

        Raises:
            CourseError: a field is not what it should be.
        """
        return describe_data({**self._data, "surfaces": self._surfaces, "parts": self._parts}, self._data["name"])

    def course(self, folder: Path | None = None) -> Course:
        """Return the course; ``folder`` is where mesh files lie.

        Raises:
            CourseError: the hole cannot be built.
        """
        return build_course(self.description(), folder)

    def save(self, path: str | Path) -> None:
        """Write a course file, and its folder.

        Raises:
            CourseError: a field is not what it should be.
            OSError: the file cannot be written.
        """
        write_text(path, to_toml(self.description()))
