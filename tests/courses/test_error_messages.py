"""Messages of course file errors: key, line, expected and received value."""

from __future__ import annotations

from pathlib import Path

import pytest

from minigolf_env.courses import CourseError, load_course
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.courses.io.course_description import describe_course, hex_color
from minigolf_env.courses.io.toml_course import MAX_KEY_DOTS, build_course, parse_description, read_description
from minigolf_env.courses.library import DATA_DIR
from minigolf_env.courses.schema.limits import Limits
from tests.cost import count_calls, measure_memory

DOGLEG = (DATA_DIR / "dogleg.toml").read_text()


def line_of(text: str, start: str, nth: int = 0) -> int:
    """Return the number of the nth line that starts with a text."""
    return [number for number, line in enumerate(text.splitlines(), 1) if line.lstrip().startswith(start)][nth]


def message_of(text: str) -> str:
    """Return the error message about a course file."""
    with pytest.raises(CourseError) as raised:
        build_course(parse_description(text, "hole.toml"))
    return str(raised.value)


@pytest.mark.parametrize(
    ("start", "new", "where"),
    [
        ("par", "par = 0", "par: expected greater than or equal to 1, received 0"),
        ("position", "position = [1, 2, nan]", "cup.position[2]: expected a finite number, received nan"),
        ("border ", "border = -1.0", "parts[0].border: expected greater than or equal to 0, received -1.0"),
    ],
)
def test_error_names_line_of_key(start: str, new: str, where: str) -> None:
    """A message names the line of a faulty key, wherever in the file it is."""
    lines = DOGLEG.splitlines()
    number = line_of(DOGLEG, start)
    lines[number - 1] = new
    assert message_of("\n".join(lines)).startswith(f"hole.toml: line {number}: {where}")


def test_message_lists_five_faults_and_counts_the_others() -> None:
    """Each listed fault has a line in the message."""
    text = DOGLEG + "".join(f"[[parts]]\nkind = 'sphere'\nat = [0, 0, {k}]\nradius = -1.0\n" for k in range(8))
    messages = message_of(text).splitlines()
    first = line_of(text, "radius")
    assert len(messages) == 6 and messages[-1] == "and 3 more"
    for k, line in enumerate(messages[:5]):
        assert line.removeprefix("hole.toml: ").startswith(f"line {first + 4 * k}: parts[")
        assert line.endswith("].radius: expected greater than 0, received -1.0")
    assert "more" not in message_of(text.split("at = [0, 0, 5]")[0] + "at = [0, 0, 0]\nradius = 1.0\n")


def test_missing_key_is_reported_at_line_of_its_table() -> None:
    """The message asks to add the missing key."""
    text = DOGLEG + '\n[[parts]]\nkind = "sphere"\nat = [0, 0, 0]\n'
    parts = len([line for line in text.splitlines() if line.startswith("[[parts]]")])
    number = line_of(text, "[[parts]]", parts - 1)
    message = f"hole.toml: line {number}: parts[{parts - 1}].radius: expected this key, received none; add it"
    assert message_of(text) == message


def test_fault_location_is_a_path_of_keys() -> None:
    """The path does not contain pydantic's tags for kinds of corners and heights."""
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
        with pytest.raises(CourseError) as raised:
            CourseBuilder("one", tee=(0, 0)).add("lane", **part).description()
        assert str(raised.value).startswith(f"one: parts[0].{path}: ")


def test_unknown_top_level_key_has_no_path() -> None:
    """The message about a key that is in no table has no path."""
    assert message_of('nmae = "x"').startswith("hole.toml: unknown key 'nmae'; did you mean 'name'?")


def test_control_characters_in_keys_are_escaped() -> None:
    """A key may contain control codes of a terminal."""
    message = message_of('[surfaces."a\\u001b[31m"]\nmaterial = 1\n')
    assert "surfaces.'a\\x1b[31m'" in message and "\x1b" not in message


def test_rejects_key_of_many_parts_before_parsing() -> None:
    """As many dots as are allowed are parsed, and the key is then unknown."""
    assert "unknown key" in message_of("a" + ".a" * MAX_KEY_DOTS + " = 1")
    assert f"a key of more than {MAX_KEY_DOTS} parts" in message_of("a" + ".a" * (MAX_KEY_DOTS + 1) + " = 1")
    assert "unknown key" in message_of("a = { " + "b" + ".b" * MAX_KEY_DOTS + " = 1 }\n# " + "." * 1_000)
    for dot in (" . ", "\t.\t", '."a".', ".'a'."):
        assert f"more than {MAX_KEY_DOTS} parts" in message_of("a" + f"{dot}a" * (MAX_KEY_DOTS + 1) + " = 1"), dot


def test_unreadable_file_is_named(tmp_path: Path) -> None:
    """A file that is missing, not text or too large is an error that names the file."""
    (tmp_path / "noise.toml").write_bytes(b"\xff\xfe\x00")
    for path, limits, message in (
        (tmp_path / "none.toml", None, "expected a readable TOML file, received .*none.toml"),
        (tmp_path / "noise.toml", None, "expected a TOML file in UTF-8, received .*noise.toml"),
        (DATA_DIR / "dogleg.toml", Limits(text_bytes=10), "course file 'dogleg.toml': expected at most 10 bytes"),
    ):
        with pytest.raises(CourseError, match=message):
            read_description(path, limits)


def test_rejects_other_radius_for_cup_that_is_already_cut() -> None:
    """A cup that is cut accepts only its radius; without a cup, every radius is an error."""
    cut = describe_course(load_course("dogleg"))
    assert cut.cup is not None
    assert build_course(cut, cup_radius=cut.cup.radius).cup == load_course("dogleg").cup
    for file, radius, message in (
        (cut, 0.07, "'dogleg', whose cup is already cut, received 0.07"),
        (describe_course(load_course("room")), 0.05, "'room', which has no cup, received 0.05"),
    ):
        with pytest.raises(CourseError, match=message):
            build_course(file, cup_radius=radius)


def test_hex_color_round_trip() -> None:
    """A colour in hexadecimal notation is written as it was read; no colour gives None."""
    for shade in ("#000000", "#0a7fff", "#ffffff", "#102030"):
        made = CourseBuilder("one", tee=(0.0, 0.0)).add("box", at=(0, 0, -0.1), size=(2, 2, 0.2), color=shade)
        assert hex_color(made.course().parts[0]) == shade
    assert hex_color(load_course("dogleg").parts[1]) is None


HEAD = 'name = "c"\ntee = { at = [0.4, 0.5] }\n'
LANE = '[[parts]]\nkind = "lane"\noutline = [{ box = [0, 0, 5, 1] }]\n'
FAULTY = {
    "faces": HEAD + '[[parts]]\nkind = "mesh"\nvertices = [[0, 0, 0]]\nfaces = [' + "[]," * 35_000 + "]\n",
    "route": HEAD + "route = [" + "[]," * 35_000 + "]\n" + LANE,
    "polygon": HEAD + '[[parts]]\nkind = "lane"\noutline = [{ polygon = [' + "[]," * 35_000 + "] }]\n",
    "outline": HEAD + '[[parts]]\nkind = "lane"\noutline = [' + "{}," * 35_000 + "]\n",
    "parts": HEAD + "[[parts]]\n" * 11_000,
    "keys": HEAD + "".join(f"k{k} = 1\n" for k in range(15_000)) + LANE,
    "surfaces": HEAD + "".join(f"[surfaces.s{k}]\ndamping = 7\n" for k in range(4000)) + LANE,
    "headers": HEAD + "".join(f"[a{k}.b.c]\n" for k in range(90_000)) + LANE,
    "long headers": HEAD + "".join("[" + ".".join(f"a{k}_{n}" for n in range(99)) + "]\n" for k in range(2000)) + LANE,
    "dotted keys": HEAD + "".join(f"a{k}.b.c = 1\n" for k in range(60_000)) + LANE,
    "long key": HEAD + "k" * 1_000_000 + " = 1\n" + LANE,
    "long table twice": HEAD + ("[" + "k" * 200_000 + "]\n") * 2 + LANE,
    "long names": HEAD
    + "".join(f'[surfaces."{"s" * 50_000}{k}"]\ndamping = "{"d" * 50_000}"\n' for k in range(6))
    + LANE,
    "long kind": HEAD + '[[parts]]\nkind = "' + "k" * 200_000 + '"\n',
    "kind that is a list": HEAD + "[[parts]]\nkind = [" + '"k",' * 50_000 + "]\n",
    "long integer": HEAD + "par = true\ntop_speed = 0x" + "f" * 100_000 + "\n" + LANE,
    "long mesh file": HEAD + '[[parts]]\nkind = "mesh"\nfile = "' + "m" * 200_000 + '.obj"\n',
}


@pytest.mark.parametrize("name", FAULTY)
def test_cost_of_many_faults_is_in_proportion_to_the_file(name: str) -> None:
    """A file of thousands of faults takes memory and calls in proportion to its size, and a short message."""
    text = FAULTY[name]
    with measure_memory() as memory, count_calls() as calls, pytest.raises(CourseError) as error:
        build_course(parse_description(text), DATA_DIR)
    assert len(str(error.value)) < 2000
    assert memory.peak < 150 * len(text) + 5e6
    assert calls.count < 20 * len(text) + 1e5


def test_integers_that_python_cannot_print_are_refused() -> None:
    """Python prints integers of up to 4300 digits, and tomllib reads longer ones in other than decimal notation."""
    for prefix in ("0x", "0o", "0b"):
        assert "an integer of more than 1000 digits" in message_of(f"{HEAD}[[parts]]\nkind = {prefix}{'1' * 1000}\n")
        assert "kind: expected one of" in message_of(f"{HEAD}[[parts]]\nkind = {prefix}{'1' * 999}\n")


@pytest.mark.parametrize(
    "name",
    ["x" * 1_000_000, "x" * 5000 + ".toml", "x\0.toml", ["x"] * 100_000, {"x": 1}, 10**5000, None, b"dogleg"],
    ids=["long name", "long path", "zero byte", "list", "dict", "integer", "none", "bytes"],
)
def test_course_name_of_any_length_and_type_is_refused_briefly(name: object) -> None:
    """The message shows the beginning of what was received."""
    with pytest.raises(CourseError, match=r"^course: expected .*, received ") as error:
        load_course(name)  # type: ignore[arg-type]
    assert len(str(error.value)) < 500


def test_control_characters_in_file_names_are_escaped(tmp_path: Path) -> None:
    """The name of a course file may contain control codes of a terminal."""
    for suffix, content in ((".toml", "par = 0"), (".toml", "par ="), (".glb", "")):
        path = tmp_path / f"a\x1b[31m{suffix}"
        path.write_text(content)
        with pytest.raises(CourseError, match=r"^'a\\x1b\[31m\.") as error:
            load_course(path)
        assert "\x1b" not in str(error.value)
