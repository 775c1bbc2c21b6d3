"""Files that are generated from the schema of course files: the JSON schema for editors, and the reference page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tools.course_reference import SCHEMA_PATH, course_schema, generated_files


@pytest.mark.parametrize("path", generated_files(), ids=lambda path: path.name)
def test_generated_file_is_up_to_date(path: Path) -> None:
    """The committed file is the one that the schema gives; otherwise run python -m tools.course_reference."""
    assert path.read_text(encoding="utf-8") == generated_files()[path]


def test_schema_describes_course_files() -> None:
    """Its title is the record of a whole course file."""
    assert json.loads(course_schema())["title"] == "CourseFile"
    assert SCHEMA_PATH.name == "course.schema.json"
