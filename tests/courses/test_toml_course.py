"""Course files: they build what they describe, errors name line and key, hostile files cost little."""

from __future__ import annotations

import math
import random
import resource
import tomllib
from pathlib import Path

import numpy as np
import pytest

from minigolf_env.courses import Course, CourseError, list_courses, load_course
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.courses.io.toml_course import build_course, parse_description, to_toml
from minigolf_env.courses.library import DATA_DIR
from minigolf_env.courses.schema.course_file import CourseFile
from minigolf_env.courses.schema.limits import Limits
from minigolf_env.physics import Status
from tests.cost import measure_memory

DOGLEG = (DATA_DIR / "dogleg.toml").read_text()
NUM_MUTATIONS = 3000
"""Number of broken files in the test; ``python -m tests.courses.test_toml_course 100000`` tries more."""


def same_physics(a: Course, b: Course) -> bool:
    """Return whether two courses and the results of putts on them are bit-equal."""
    same = (a.name, a.tee, a.cup, a.par, a.bounds, a.route) == (b.name, b.tee, b.cup, b.par, b.bounds, b.route)
    same &= (a.top_speed, a.ball_radius, a.gravity) == (b.top_speed, b.ball_radius, b.gravity)
    for p, q in zip(a.parts, b.parts, strict=True):
        same &= (p.name, p.material, p.color) == (q.name, q.material, q.color)
        same &= p.mesh.vertices.tobytes() == q.mesh.vertices.tobytes() and np.array_equal(p.mesh.faces, q.mesh.faces)
    x, y = a.tee.centre
    velocity = np.array([[0.7, 0.2, 0.0], [0.9, -0.1, 0.0], [-0.4, 0.5, 0.3]]) * a.top_speed
    starts = np.tile([x, y, a.tee.height + a.ball_radius], (3, 1))
    first, second = (course.world().simulate_batch(starts, velocity, 10.0) for course in (a, b))
    return bool(same) and all(np.asarray(u).tobytes() == np.asarray(v).tobytes() for u, v in zip(first[:4], second[:4]))


@pytest.mark.parametrize("name", ["dogleg", "room", "gap", "loop"])
def test_course_survives_toml_round_trip_bitwise(name: str, tmp_path: Path) -> None:
    """A course that is written as TOML and read has the same bits."""
    course = load_course(name)
    (tmp_path / "copy.toml").write_text(to_toml(course))
    assert same_physics(course, load_course(tmp_path / "copy.toml"))


@pytest.mark.parametrize("name", [*list_courses(), "room"])
def test_description_survives_toml_round_trip(name: str) -> None:
    """A description that is written as TOML and read is equal."""
    file = parse_description((DATA_DIR / f"{name}.toml").read_text())
    assert parse_description(to_toml(file)) == file


def test_builder_gives_same_course_as_file_it_saves(tmp_path: Path) -> None:
    """The course has a surface that the file describes; unknown kinds of parts are errors."""
    hole = CourseBuilder("post", tee=(0.4, 0.5), cup=(2.5, 0.5, 0.0), top_speed=5.0)
    hole.surface("rubber", damping=0.9)
    hole.add("lane", outline=[{"box": (0, 0, 3, 1)}])
    hole.add("cylinder", at=(1.5, 0.5, -0.05), radius=0.1, height=0.2, surface="rubber")
    hole.save(tmp_path / "post.toml")
    course = hole.course()
    assert same_physics(course, load_course(tmp_path / "post.toml"))
    assert course.par == 2 and course.route == ((0.4, 0.5), (2.5, 0.5))
    with pytest.raises(CourseError, match=r"parts\[2\]: kind: .* did you mean 'block'"):
        hole.add("blok").description()


PARTS = [
    {"kind": "block", "outline": [{"circle": (1.5, 0.5, 0.1)}, {"line": [(1.5, 0.5), (1.8, 0.5)], "width": 0.1}]},
    {"kind": "block", "outline": [{"polygon": [(1, 0.2), (1.4, 0.2), {"via": (1.5, 0.4), "to": (1.4, 0.6)}]}]},
    {
        "kind": "block",
        "outline": [{"box": (1, 0.2, 1.4, 0.6), "round": 0.05, "turn": 30}],
        "holes": [{"box": (1.1, 0.3, 1.3, 0.5)}],
    },
    {
        "kind": "prism",
        "profile": [{"polygon": [(-0.1, 0), (0.1, 0), (0, 0.2)]}],
        "start": (1, 0.5, -0.05),
        "end": (1.5, 0.3, 0),
    },
    {"kind": "revolved", "at": (1.5, 0.5), "profile": [(0, -0.05), (0.1, -0.05), (0.05, 0.2), (0, 0.2)]},
    {"kind": "box", "at": (1.5, 0.5, 0.1), "size": (0.2, 0.1, 0.3), "turn": 20},
    {"kind": "cylinder", "at": (1.5, 0.5, -0.05), "radius": 0.1, "top_radius": 0.0, "height": 0.2},
    {"kind": "sphere", "at": (1.5, 0.5, 0.1), "radius": 0.1},
    {"kind": "torus", "at": (1.5, 0.5, 0.02), "major_radius": 0.2, "minor_radius": 0.05},
    {"kind": "ramp", "start": (1, 0.5), "end": (1.6, 0.5), "width": 0.4, "height": 0.1},
    {"kind": "tunnel", "start": (1, 0.5), "end": (1.6, 0.6), "width": 0.6, "height": 0.4, "roof": 0.2, "door": 0.2},
    {"kind": "halfpipe", "start": (1, 0.5, 0), "end": (1.8, 0.5, 0), "radius": 0.2, "floor": 0.2},
    {"kind": "loop", "at": (1.2, 0.3, 0), "radius": 0.2, "width": 0.2, "shift": 0.3, "sides": 64},
]


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part["kind"])
def test_every_kind_of_part_is_solid_and_traps_no_ball(part: dict[str, object]) -> None:
    """Parts are closed and wound outwards, and balls thrown at them come to rest outside."""
    course = CourseBuilder("one", tee=(0.3, 0.5)).add("lane", outline=[{"box": (0, 0, 3, 1)}]).add(**part).course()
    solids = course.parts[2:]
    assert solids and all(solid.mesh.is_closed and solid.mesh.volume > 0.0 for solid in solids)
    world = course.world()
    angle = np.linspace(-0.3, 0.3, 60)
    velocities = np.column_stack([3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.0 * angle])
    shots = world.simulate_batch(np.tile([0.3, 0.5, course.ball_radius], (60, 1)), velocities)
    assert not np.any(shots.exhausted) and np.mean(np.asarray(shots.status) == Status.REST) > 0.95
    inside = [abs(winding) > 0.5 for solid in solids for winding in solid.mesh.winding_number(shots.position)]
    assert not any(inside)


def test_floor_follows_its_height_profile() -> None:
    """A floor is linear between rounded corners, and exactly level where the profile is level."""
    heights = [{"kind": "along", "profile": [(1, 0), (2, 0.2)], "rounding": 0.1}]
    hole = CourseBuilder("slope", tee=(0.3, 0.5)).add(
        "lane", outline=[{"box": (0, 0, 3, 1)}], heights=heights, border=0
    )
    vertices = hole.course().parts[0].mesh.vertices
    top = vertices[vertices[:, 2] > -0.01]
    assert (top[top[:, 0] <= 0.9, 2] == 0.0).all() and (top[top[:, 0] >= 2.1, 2] == 0.2).all()
    middle = top[(top[:, 0] > 1.1) & (top[:, 0] < 1.9)]
    assert np.allclose(middle[:, 2], 0.2 * (middle[:, 0] - 1.0), atol=1e-12)


@pytest.mark.parametrize("kind", ["along", "radial"])
def test_rejects_profile_whose_distances_decrease(kind: str) -> None:
    """Such a profile is not a function of distance."""
    heights = [{"kind": kind, "at": (1.5, 0.5), "profile": [(3, 0), (2, 0.3), (1, 0)]}]
    with pytest.raises(
        CourseError, match=r"heights\[0\].profile: expected distances that grow, received 2.0 after 3.0"
    ):
        CourseBuilder("slope", tee=(0.3, 0.5)).add("lane", outline=[{"box": (0, 0, 3, 1)}], heights=heights).course()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "lane"', 'kind = "lanne"', r"line 16: parts\[0\]: kind: expected one of .*did you mean 'lane'"),
        ("border = 0.07", "bordr = 0.07", r"parts\[0\]: unknown key 'bordr'; did you mean 'border'"),
        ("border = 0.07", 'border = "wide"', r"line 21: parts\[0\].border: expected a valid number, received 'wide'"),
        ("border = 0.07", "border = true", r"parts\[0\].border: expected a valid number, received True"),
        ("[3, 0], [4, 1]", "[3, nan], [4, 1]", r"outline\[0\].polygon\[1\]\[1\]: expected a finite number"),
        ("[3, 0], [4, 1]", "[3, 1e300], [4, 1]", r"expected less than or equal to 1000, received 1e\+300"),
        ('name = "dogleg"', "", r"hole.toml: name: expected this key, received none; add it"),
        ("par = 2", "par = 2.5", r"line 3: par: expected a valid integer"),
        ("par = 2", "par = ", r"expected TOML, received text that is not: .*line 3"),
        ('material = "stone"', 'surface = "ston"', r"surface: expected one of .*did you mean 'stone'"),
        ("[3.45, 2.1, 0.0]", "[3.45, 2.1]", r"cup.position\[2\]: expected this key"),
        ("turn = -30", "circle = [1, 2, 3]", r"exactly one of polygon, box, circle and line"),
        ("[3.45, 2.1, 0.0]", "[8.45, 2.1, 0.0]", r"cup: position: expected a place on a lane"),
        ("[3, 0], [4, 1]", "[4, 1], [3, 0], [0, 1]", r"part 'lane 1': outline: expected a simple shape"),
        ("lower = [0.2, 0.325]", "lower = [0.001, 0.325]", r"deep in a surface"),
        ('name = "block"', 'name = "../block"', r"parts\[1\].name: string should match pattern"),
    ],
)
def test_errors_name_line_and_key(old: str, new: str, message: str) -> None:
    """The message says what was expected and received, and perhaps what was meant."""
    assert old in DOGLEG
    with pytest.raises(CourseError, match=message):
        build_course(parse_description(DOGLEG.replace(old, new), "hole.toml")).world()


def crossing_line(points: int) -> list[list[float]]:
    """Return a line that crosses a circle from side to side many times."""
    return [[math.cos(3.0 * k), math.sin(3.0 * k)] for k in range(points)]


def large_polygons(number: int) -> str:
    """Return a number of polygons that have the largest allowed number of corners."""
    corners = [[math.cos(math.tau * k / 2000), math.sin(math.tau * k / 2000)] for k in range(2000)]
    return ", ".join([f"{{ polygon = {corners} }}"] * number)


def test_rejects_broken_and_huge_files_with_little_memory(tmp_path: Path) -> None:
    """Files beyond the limits are errors, and the caller can change the limits."""
    cases = {
        "deep.toml": "x = " + "[" * 100_000,
        "deeper.toml": "name = " + "{ a = " * 3000 + "1" + "}" * 3000,
        "dots.toml": "a" + ".a" * 50_000 + " = 1",
        "digits.toml": "par = " + "9" * 100_000,
        "noise.toml": "\x00\x01",
        "spaces.toml": 'name = "hole"\n' + " " * 1_000_000 + "\nparts = 3\n",
        "knot.toml": DOGLEG + f'[[parts]]\nkind = "lane"\noutline = [{{ line = {crossing_line(2000)} }}]\n',
        "corners.toml": DOGLEG + f'[[parts]]\nkind = "lane"\noutline = [{large_polygons(11)}]\n',
        "cells.toml": DOGLEG + '[[parts]]\nkind = "lane"\noutline = [{ box = [0, 0, 900, 900] }]\n'
        'heights = [{ kind = "along", profile = [[0, 0], [1, 1]] }]\ncell = [0.001, 0.001]\n',
        "sides.toml": DOGLEG + '[[parts]]\nkind = "sphere"\nat = [0, 0, 0]\nradius = 1\nsubdivisions = 40\n',
        "long.toml": DOGLEG + '[[parts]]\nkind = "lane"\noutline = [{ box = [0, 0, 1e-9, 900] }]\n'
        'heights = [{ kind = "along", profile = [[0, 0], [1, 1]] }]\ncell = [1e-9, 900.0]\n',
        "ball.ply": "ply",
    }
    with measure_memory() as memory:
        for name, text in cases.items():
            path = tmp_path / name
            path.write_text(text)
            if path.suffix == ".ply":
                path.write_text(
                    "ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\nend_header\n"
                )
                path = tmp_path / "ply.toml"
                path.write_text(f'name = "m"\ntee = {{ at = [0, 0] }}\n[[parts]]\nkind = "mesh"\nfile = "{name}"\n')
            with pytest.raises(CourseError):
                load_course(path)
    assert memory.peak < 100e6, "memory is not allocated by the counts in a file"
    with pytest.raises(CourseError, match="at most 100 bytes"):
        load_course("dogleg", limits=Limits(text_bytes=100))
    with pytest.raises(CourseError, match="at most 100 triangles in a course"):
        load_course("dogleg", limits=Limits(triangles=100))


def mutate(text: str, rng: random.Random) -> str:
    """Return text with a few characters, words or lines changed, duplicated or removed."""
    replacements = [
        "nan",
        "inf",
        "-1e308",
        "[]",
        "{}",
        '""',
        "true",
        "9" * 30,
        "0",
        "-1",
        '"lane"',
        "[[parts]]",
        "\x00",
        "é",
        "=",
        ".",
    ]
    for _ in range(rng.randint(1, 4)):
        kind = rng.randrange(5)
        at = rng.randrange(len(text))
        end = min(len(text), at + rng.choice([1, 1, 3, 10, 80]))
        if kind == 0:
            text = text[:at] + text[end:]
        elif kind == 1:
            text = text[:at] + text[at:end] * 2 + text[end:]
        elif kind == 2:
            text = text[:at] + rng.choice(replacements) + text[end:]
        else:
            words = text.split(" ")
            k = rng.randrange(len(words))
            words[k] = rng.choice(replacements) if kind == 3 else words[rng.randrange(len(words))]
            text = " ".join(words)
        if not text:
            return "x"
    return text


def fuzz(count: int, seed: int) -> tuple[int, int]:
    """Return how many of ``count`` mutated files are rejected and how many load; fail on anything but a CourseError."""
    rng = random.Random(seed)  # noqa: S311 (not for secrets)
    texts = [
        path.read_text()
        for path in sorted(DATA_DIR.glob("*.toml"))
        if path.stem not in ("green100k", "volcano", "funnel")
    ]
    rejected = loaded = 0
    for number in range(count):
        text = mutate(rng.choice(texts), rng)
        try:
            file: CourseFile = parse_description(text)
            if number % 10 == 0:
                build_course(file, limits=Limits(triangles=20_000, cells=4_000))
            loaded += 1
        except CourseError:
            rejected += 1
        except Exception as error:
            raise AssertionError(f"expected a CourseError, received {error!r} from:\n{text}") from error
    return rejected, loaded


def test_mutated_files_load_or_raise_course_error() -> None:
    """Changed bytes in a course file raise no other exception, and memory stays bounded."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    rejected, loaded = fuzz(NUM_MUTATIONS, seed=0)
    assert rejected > NUM_MUTATIONS // 4 and loaded > 100
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # kB


def test_written_toml_is_valid() -> None:
    """The standard library reads written TOML."""
    assert tomllib.loads(to_toml(load_course("dogleg")))["name"] == "dogleg"


if __name__ == "__main__":
    import sys

    rejected, loaded = fuzz(int(sys.argv[1]), seed=int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    print(f"rejected {rejected}, loaded {loaded}")
