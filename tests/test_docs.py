"""What docs/courses.md says of courses is so."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from minigolf_env.catalogue import check
from minigolf_env.courses import list_courses
from minigolf_env.courses.files import build_course, parse_description, read_description
from minigolf_env.courses.library import DATA

DOCS = Path(__file__).parents[1] / "docs"
COURSES = (DOCS / "courses.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", COURSES, flags=re.DOTALL)


@pytest.mark.parametrize("name", ["windmill.toml", "boulder.glb"])
def test_nothing_is_wrong_with_the_examples(name: str) -> None:
    """They load and can be played."""
    assert list(check(DOCS / "examples" / name)) == []


def test_the_course_file_in_the_docs_is_complete() -> None:
    """And the same as the hole in Python."""
    (text,) = re.findall(r"```toml\n(.*?)```", COURSES, flags=re.DOTALL)
    assert build_course(parse_description(text)).par == 2
    (block,) = (block for block in BLOCKS if "hole.save" in block)
    namespace: dict[str, object] = {}
    exec(block.replace('hole.save("post.toml")', "description = hole.description()"), namespace)  # noqa: S102
    assert namespace["description"] == parse_description(text)


def test_the_round_in_the_docs_is_played() -> None:
    """Nine holes, at random, and the next round begins."""
    (block,) = (block for block in BLOCKS if "round" in block)
    namespace: dict[str, Any] = {}
    exec(block, namespace)  # noqa: S102
    assert namespace["info"]["hole"] == 1 and namespace["over_par"] <= 9 * 10


def test_the_split_in_the_docs_holds_levels_out() -> None:
    """Training draws from its set, the test plays each level of another."""
    (block,) = re.findall(r"```python\n(.*?)```", (DOCS / "levels.md").read_text(), flags=re.DOTALL)
    namespace: dict[str, Any] = {}
    exec(block.replace("1_000_200", "1_000_002"), namespace)  # noqa: S102
    assert namespace["info"]["level"] == 1_000_001 and namespace["train"].reset()[1]["level"] < 500


@pytest.mark.parametrize("name", list_courses())
def test_each_hole_has_its_row_and_its_map(name: str) -> None:
    """Par, idea and hole in one as in its file."""
    file = read_description(DATA / f"{name}.toml")
    row = next(line for line in COURSES.splitlines() if line.startswith(f"| [{name}]"))
    assert f"| {file.par} |" in row and file.about in row and str(list(file.hole_in_one or ())) in row
    assert (DOCS / "figures" / "maps" / f"{name}.png").is_file()
