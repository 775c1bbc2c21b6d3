"""Write the files that are generated from the schema of course files. Run: python -m tools.course_reference.

They are the JSON schema, from which editors complete course files, and the reference page of the documentation.
"""

from __future__ import annotations

import json
from pathlib import Path

from minigolf_env.courses.library import DATA_DIR
from minigolf_env.courses.schema.course_file import CourseFile

SCHEMA_PATH = DATA_DIR / "course.schema.json"
"""Path of the JSON schema."""


def course_schema() -> str:
    """Return the text of the JSON schema of course files."""
    return json.dumps(CourseFile.model_json_schema(), indent=1) + "\n"


def generated_files() -> dict[Path, str]:
    """Return the text of each generated file by its path."""
    return {SCHEMA_PATH: course_schema()}


def main() -> None:
    """Write the generated files."""
    for path, text in generated_files().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
