"""What course files' errors say: the key, the line, what was expected and what received."""

from __future__ import annotations

from pathlib import Path

import pytest

from minigolf_env.courses import CourseError, load_course
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.courses.io.course_description import describe_course, hex_color
from minigolf_env.courses.io.toml_course import MAX_KEY_DOTS, build_course, parse_description, read_description
from minigolf_env.courses.library import DATA_DIR
from minigolf_env.courses.schema.limits import Limits

DOGLEG = (DATA_DIR / "dogleg.toml").read_text()


def line_of(text: str, start: str, nth: int = 0) -> int:
    """Return the number of the nth line that starts so."""
    return [number for number, line in enumerate(text.splitlines(), 1) if line.lstrip().startswith(start)][nth]


def message_of(text: str) -> str:
    """Return what is wrong with a course file."""
    with pytest.raises(CourseError) as told:
        build_course(parse_description(text, "hole.toml"))
    return str(told.value)


@pytest.mark.parametrize(
    ("start", "new", "where"),
    [
        ("par", "par = 0", "par: expected greater than or equal to 1, received 0"),
        ("position", "position = [1, 2, nan]", "cup.position[2]: expected a finite number, received nan"),
        ("border ", "border = -1.0", "parts[0].border: expected greater than or equal to 0, received -1.0"),
    ],
)
def test_a_fault_is_told_with_its_line(start: str, new: str, where: str) -> None:
    """Of the key, wherever it is in the file."""
    lines = DOGLEG.splitlines()
    number = line_of(DOGLEG, start)
    lines[number - 1] = new
    assert message_of("\n".join(lines)).startswith(f"hole.toml: line {number}: {where}")


def test_several_faults_are_told_each_on_a_line() -> None:
    """Five of them, and how many there are besides."""
    many = DOGLEG + "".join(f"[[parts]]\nkind = 'sphere'\nat = [0, 0, {k}]\nradius = -1.0\n" for k in range(8))
    told = message_of(many).splitlines()
    first = line_of(many, "radius")
    assert len(told) == 6 and told[-1] == "and 3 more"
    for k, line in enumerate(told[:5]):
        assert line.removeprefix("hole.toml: ").startswith(f"line {first + 4 * k}: parts[")
        assert line.endswith("].radius: expected greater than 0, received -1.0")
    assert "more" not in message_of(many.split("at = [0, 0, 5]")[0] + "at = [0, 0, 0]\nradius = 1.0\n")


def test_a_missing_key_is_told_with_the_line_of_its_table() -> None:
    """And asked for."""
    text = DOGLEG + '\n[[parts]]\nkind = "sphere"\nat = [0, 0, 0]\n'
    parts = len([line for line in text.splitlines() if line.startswith("[[parts]]")])
    number = line_of(text, "[[parts]]", parts - 1)
    told = f"hole.toml: line {number}: parts[{parts - 1}].radius: expected this key, received none; add it"
    assert message_of(text) == told


def test_places_in_a_file_are_paths_of_keys() -> None:
    """Kinds of corners and heights are no keys, and not in them."""
    for part, path in (
        ({"outline": [{"polygon": [(0, 0), (1, 0), {"via": (1, "x"), "to": (0, 1)}]}]}, "outline[0].polygon[2].via[1]"),
        ({"outline": [{"polygon": [(0, 0), (1, "x"), (0, 1)]}]}, "outline[0].polygon[1][1]"),
        (
            {"outline": [{"box": (0, 0, 1, 1)}], "heights": [{"kind": "waves", "amplitude": 1, "length": 0}]},
            "heights[0].length",
        ),
        (
            {"outline": [{"box": (0, 0, 1, 1)}], "heights": [{"kind": "along", "profile": [(0, 0)]}]},
            "heights[0].profile",
        ),
        ({"outline": [{"box": (0, 0, 1, 1)}], "heights": [{"kind": "radial", "at": (0, "x")}]}, "heights[0].at[1]"),
    ):
        with pytest.raises(CourseError) as told:
            CourseBuilder("one", tee=(0, 0)).add("lane", **part).description()
        assert str(told.value).startswith(f"one: parts[0].{path}: ")


def test_an_unknown_key_of_the_file_itself_has_no_path() -> None:
    """It is in no table."""
    assert message_of('nmae = "x"').startswith("hole.toml: unknown key 'nmae'; did you mean 'name'?")


def test_no_key_reaches_a_terminal_as_it_is() -> None:
    """It may hold the terminal's commands."""
    told = message_of('[surfaces."a\\u001b[31m"]\nmaterial = 1\n')
    assert "surfaces.'a\\x1b[31m'" in told and "\x1b" not in told


def test_keys_of_many_parts_are_refused_before_they_cost_time() -> None:
    """As many dots as are allowed are read, and then unknown."""
    assert "unknown key" in message_of("a" + ".a" * MAX_KEY_DOTS + " = 1")
    assert f"a key of more than {MAX_KEY_DOTS} parts" in message_of("a" + ".a" * (MAX_KEY_DOTS + 1) + " = 1")
    assert "unknown key" in message_of("a = { " + "b" + ".b" * MAX_KEY_DOTS + " = 1 }\n# " + "." * 1_000)
    for dot in (" . ", "\t.\t", '."a".', ".'a'."):
        assert f"more than {MAX_KEY_DOTS} parts" in message_of("a" + f"{dot}a" * (MAX_KEY_DOTS + 1) + " = 1"), dot


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    """Not there, not text, or too large."""
    (tmp_path / "noise.toml").write_bytes(b"\xff\xfe\x00")
    for path, limits, message in (
        (tmp_path / "none.toml", None, "expected a readable TOML file, received .*none.toml"),
        (tmp_path / "noise.toml", None, "expected a readable TOML file, received .*noise.toml"),
        (DATA_DIR / "dogleg.toml", Limits(text_bytes=10), "course file 'dogleg.toml': expected at most 10 bytes"),
    ):
        with pytest.raises(CourseError, match=message):
            read_description(path, limits)


def test_a_cup_that_is_cut_stays_as_it_is() -> None:
    """Its own radius is taken, another is refused; so is any where there is no cup."""
    cut = describe_course(load_course("dogleg"))
    assert cut.cup is not None
    assert build_course(cut, cup_radius=cut.cup.radius).cup == load_course("dogleg").cup
    for file, radius, message in (
        (cut, 0.07, "'dogleg', whose cup is already cut, received 0.07"),
        (describe_course(load_course("room")), 0.05, "'room', which has no cup, received 0.05"),
    ):
        with pytest.raises(CourseError, match=message):
            build_course(file, cup_radius=radius)


def test_colours_are_written_as_they_are_read() -> None:
    """Each of 256 shades; none stays none."""
    for shade in ("#000000", "#0a7fff", "#ffffff", "#102030"):
        made = CourseBuilder("one", tee=(0.0, 0.0)).add("box", at=(0, 0, -0.1), size=(2, 2, 0.2), color=shade)
        assert hex_color(made.course().parts[0]) == shade
    assert hex_color(load_course("dogleg").parts[1]) is None
