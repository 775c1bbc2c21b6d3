"""Builder of courses in Python: the content of a course file in a few lines.

::

    builder = CourseBuilder("lane with a post", tee=(0.4, 0.5), cup=(4.5, 0.5, 0.0), top_speed=5.0)
    builder.add("lane", outline=[{"box": (0, 0, 5, 1)}])
    builder.add("cylinder", at=(2.5, 0.5, -0.05), radius=0.1, height=0.2, surface="stone")
    course = builder.course()
    builder.save("post.toml")
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from minigolf_env._atomic_io import write_text
from minigolf_env.courses.course import DEFAULT_PAR, Course, Point2, Point3
from minigolf_env.courses.io.toml_course import build_course, to_toml, validate_description
from minigolf_env.courses.schema.course_file import CourseFile


class CourseBuilder:
    """Builder that collects the parts and surfaces of a course.

    Args:
        name: name of the course.
        tee: start (x, y) of the ball, m; or {"lower": ..., "upper": ..., "height": ...}.
        cup: centre (x, y, z) of the rim, m; or {"position": ..., "radius": ...}; None: no cup, the ball is only thrown.
        fields: other keys of a course file, such as par, top_speed and route. A course with a cup has par 2 by default,
            while a course file must give it.
    """

    def __init__(
        self, name: str, tee: Point2 | dict[str, Any], cup: Point3 | dict[str, Any] | None = None, **fields: Any
    ) -> None:
        self._data: dict[str, Any] = {"name": name, "tee": tee if isinstance(tee, dict) else {"at": tee}, **fields}
        if cup is not None:
            self._data["cup"] = cup if isinstance(cup, dict) else {"position": cup}
            self._data.setdefault("par", DEFAULT_PAR)
        self._parts: list[dict[str, Any]] = []
        self._surfaces: dict[str, dict[str, Any]] = {}

    def add(self, kind: str, **fields: Any) -> CourseBuilder:
        """Add a part of a kind ("lane", "block", "mesh" ...), with the keys that course files have for it."""
        self._parts.append({"kind": kind, **fields})
        return self

    def surface(self, name: str, **fields: Any) -> CourseBuilder:
        """Describe a surface that parts can name."""
        self._surfaces[name] = fields
        return self

    def description(self) -> CourseFile:
        """Return the content of the course file.

        Raises:
            CourseError: a key is unknown or missing, or a value is not valid.
        """
        return validate_description(
            {**self._data, "surfaces": self._surfaces, "parts": self._parts}, self._data["name"]
        )

    def course(self, folder: Path | None = None) -> Course:
        """Return the course.

        Args:
            folder: folder of the mesh files that parts name; None: there are none.

        Raises:
            CourseError: the course cannot be built.
        """
        return build_course(self.description(), folder)

    def save(self, path: str | Path) -> None:
        """Write a course file, and create its folder if necessary.

        Raises:
            CourseError: a key is unknown or missing, or a value is not valid.
            OSError: the file cannot be written.
        """
        write_text(path, to_toml(self.description()))
