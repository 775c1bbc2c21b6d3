"""The table and the images of courses."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from rich.console import Console

from minigolf_env.apps.gallery import course_table, render_course, write_preview
from minigolf_env.courses import list_courses, load_course


def test_table_has_a_row_for_each_course() -> None:
    """Each row has the name, par, size and number of triangles."""
    console = Console(file=io.StringIO(), width=250)
    console.print(course_table())
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert [line.split()[0] for line in lines[1:]] == [*list_courses(), "room"]
    assert "1,272" in next(line for line in lines if line.split()[0] == "dogleg")


def test_writes_preview(gl: None, tmp_path: Path) -> None:
    """A preview is an image file; a rendered course is not blank."""
    write_preview(load_course("gap"), tmp_path / "gap.png")
    assert (tmp_path / "gap.png").read_bytes()[:4] == b"\x89PNG"
    assert np.ptp(render_course(load_course("gap"), "top", (64, 48))) > 50
