"""The table, the pictures and the faults of holes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from minigolf_env import cli
from minigolf_env.apps import course_check as catalogue
from minigolf_env.courses import list_courses, load_course
from minigolf_env.courses.builder import CourseBuilder

LANE = [{"box": (0, 0, 3, 1)}]


def hole(cup: tuple[float, float, float] = (2.5, 0.5, 0.0)) -> CourseBuilder:
    """Return a plain lane."""
    return CourseBuilder("plain", tee=(0.4, 0.5), cup=cup, top_speed=5.0).add("lane", outline=LANE)


def test_the_table_has_a_line_for_each_course() -> None:
    """Name, par, size and triangles."""
    lines = catalogue.table().splitlines()
    assert [line.split()[0] for line in lines[1:]] == [*list_courses(), "room"]
    assert "1,272" in next(line for line in lines if line.startswith("dogleg"))


@pytest.mark.parametrize("name", ["dogleg", "islands", "loop", "room"])
def test_nothing_is_wrong_with_bundled_courses(name: str) -> None:
    """The same checks as for one's own."""
    assert list(catalogue.check(name)) == []


def test_faults_of_a_hole_are_found() -> None:
    """Tee in a wall or over nothing, cup covered, beside the floor, or behind walls."""

    def faults(one: CourseBuilder) -> str:
        return " ".join(catalogue.check(one.course()))

    assert faults(hole()) == ""
    assert "is inside 'block 2'" in faults(hole().add("block", outline=[{"box": (0.2, 0.2, 0.6, 0.8)}]))
    assert "expected free space over it" in faults(hole().add("box", at=(2.5, 0.5, 0.06), size=(0.3, 0.3, 0.1)))
    walls = [{"box": (1.9, -0.05, 2.0, 1.05)}]
    high = hole().add("block", outline=walls, top=1.9)
    assert "expected search to hole out within 10 strokes" in faults(high)
    no_floor = CourseBuilder("x", tee=(3.3, 0.5), cup=(2.5, 0.5, 0.0), bounds=((-1, -1, -1), (4, 2, 2)))
    assert "expected a floor below" in faults(no_floor.add("lane", outline=LANE, border=0))


def test_the_command_checks_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 1 and the faults, or 0."""
    good, bad = tmp_path / "good.toml", tmp_path / "bad.toml"
    hole().save(good)
    cli.check(str(good))
    assert "plain: nothing is wrong" in capsys.readouterr().out
    bad.write_text(good.read_text().replace('"lane"', '"line"'))
    with pytest.raises(SystemExit) as stop:
        cli.check(str(bad))
    assert stop.value.code == 1 and "did you mean 'lane'" in capsys.readouterr().err


def test_pictures_are_written(gl: None, tmp_path: Path) -> None:
    """A preview with three views."""
    catalogue.write_preview(load_course("gap"), tmp_path / "gap.png")
    assert (tmp_path / "gap.png").read_bytes()[:4] == b"\x89PNG"
    assert np.ptp(catalogue.picture(load_course("gap"), "top", (64, 48))) > 50
