"""The course check finds the errors of a hole."""

from __future__ import annotations

from pathlib import Path

import pytest

from minigolf_env import cli
from minigolf_env.apps.course_check import find_course_errors
from minigolf_env.courses.builder import CourseBuilder

LANE_OUTLINE = [{"box": (0, 0, 3, 1)}]


def plain_lane(cup: tuple[float, float, float] = (2.5, 0.5, 0.0)) -> CourseBuilder:
    """Return a plain lane."""
    return CourseBuilder("plain", tee=(0.4, 0.5), cup=cup, top_speed=5.0).add("lane", outline=LANE_OUTLINE)


@pytest.mark.parametrize("name", ["dogleg", "islands", "loop", "room"])
def test_bundled_courses_have_no_errors(name: str) -> None:
    """Bundled courses pass the checks that users' courses must pass."""
    assert list(find_course_errors(name)) == []


def test_finds_errors_of_tee_and_cup() -> None:
    """A tee in a wall or without a floor, a covered cup and a cup behind walls are errors."""

    def errors(builder: CourseBuilder) -> str:
        return " ".join(find_course_errors(builder.course()))

    assert errors(plain_lane()) == ""
    assert "is inside 'block 2'" in errors(plain_lane().add("block", outline=[{"box": (0.2, 0.2, 0.6, 0.8)}]))
    assert "expected free space over it" in errors(plain_lane().add("box", at=(2.5, 0.5, 0.06), size=(0.3, 0.3, 0.1)))
    walls = [{"box": (1.9, -0.05, 2.0, 1.05)}]
    walled = plain_lane().add("block", outline=walls, top=1.9)
    assert "search did not hole out within 10 strokes" in errors(walled)
    no_floor = CourseBuilder("x", tee=(3.3, 0.5), cup=(2.5, 0.5, 0.0), bounds=((-1, -1, -1), (4, 2, 2)))
    assert "expected a floor below" in errors(no_floor.add("lane", outline=LANE_OUTLINE, border=0))


def test_course_without_a_cup_is_not_passed_as_a_hole() -> None:
    """gym.make refuses a course without a cup, and so does the check."""
    course = CourseBuilder("open", tee=(0.4, 0.5)).add("lane", outline=LANE_OUTLINE).course()
    assert "cup: expected one, received none" in " ".join(find_course_errors(course))


def test_place_from_which_the_ball_can_only_leave_the_course_is_no_trap() -> None:
    """A putt out of bounds leaves the place, though the ball is put back there."""
    builder = CourseBuilder("table", tee=(0.2, 0.5), cup=(2.5, 0.5, 0.0), top_speed=5.0)
    course = builder.add("lane", outline=[{"box": (0, 0, 3, 1)}], border=0).course()
    assert not [error for error in find_course_errors(course) if "trap" in error]


def test_command_exits_with_1_if_there_are_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without errors the command exits with 0 and reports that there are none."""
    good, bad = tmp_path / "good.toml", tmp_path / "bad.toml"
    plain_lane().save(good)
    cli.main(["check", str(good)])
    assert "plain: no errors found" in capsys.readouterr().out
    bad.write_text(good.read_text().replace('"lane"', '"line"'))
    with pytest.raises(SystemExit) as stop:
        cli.main(["check", str(bad)])
    assert stop.value.code == 1 and "did you mean 'lane'" in capsys.readouterr().err
