"""The pages are true: links exist, code runs, commands parse, and tables equal the program's."""

from __future__ import annotations

import functools
import importlib
import inspect
import itertools
import pkgutil
import re
import shlex
from pathlib import Path
from typing import Any, get_type_hints
from urllib.parse import urlsplit

import gymnasium as gym
import pytest
import tyro

import minigolf_env
from minigolf_env.apps.commands import COMMANDS_BY_NAME
from minigolf_env.apps.course_check import find_course_errors
from minigolf_env.courses import list_courses
from minigolf_env.courses.io.toml_course import build_course, parse_description, read_description
from minigolf_env.courses.library import DATA_DIR
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv, config
from tests.markdown import PAGES, ROOT, anchors, blocks, inline, links, name, tokens

DOCS = ROOT / "docs"
PACKAGE = Path(minigolf_env.__file__).parent  # An installed package is not in the repository.
COURSES = DOCS / "courses.md"
ENVIRONMENT = DOCS / "environment.md"

PUBLIC_PACKAGES = ("envs", "physics", "courses", "wrappers")
"""Packages of which every exported name must be on the API pages."""

PAGE_ASSERTIONS = {
    "README.md": "outcome.holed.shape == (256, 2) and shot.status.name == 'REST'",
    "docs/courses.md": "info['hole'] == 1 and over_par <= 9 * 10",
    "docs/levels.md": "info['level'] == 1_000_199 and train.reset()[1]['level'] < 500",
}
"""Expressions that are true after a page's code has run, in addition to its own assertions."""

EXTERNAL_PROGRAMS = {"apt-get", "export", "pip", "pytest", "ray", "tensorboard"}
"""Other projects' programs in the pages; their arguments are not checked."""


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_link_targets_exist(page: Path) -> None:
    """Files and headings of the repository exist; external addresses are complete. Nothing is downloaded."""
    for link in links(page):
        scheme, host, path, _, anchor = urlsplit(link)
        if scheme:
            assert scheme in ("http", "https") and host, link
            continue
        target = (page.parent / path).resolve() if path else page
        if PACKAGE.name in target.relative_to(ROOT).parts[:1]:
            target = PACKAGE / target.relative_to(ROOT / PACKAGE.name)
        assert target.exists(), f"{link}: there is no {target}"
        assert not anchor or anchor in anchors(target), f"{link}: {sorted(anchors(target))}"


@pytest.mark.parametrize(
    "page", [page for page in PAGES if blocks(page, "python") and page.name != "clients.md"], ids=name
)
def test_python_blocks_run(page: Path, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """The blocks of a page run in order, in one namespace and an empty folder; marked blocks are only compiled."""
    request.getfixturevalue("monkeypatch").chdir(tmp_path)
    namespace: dict[str, Any] = {}
    for block in blocks(page, "python"):
        if "render" in block.code:
            request.getfixturevalue("gl")
        if "stable_baselines3" in block.code:
            pytest.importorskip("stable_baselines3")
        code = compile("\n" * block.line + block.code, str(page), "exec")
        if block.is_run:
            exec(code, namespace)  # noqa: S102 (our own pages)
    assert eval(PAGE_ASSERTIONS.get(name(page), "True"), namespace)  # noqa: S307


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_parse(page: Path) -> None:
    """Every command line in a page's blocks and text is accepted by its program's parser."""
    lines = [line for block in blocks(page, "bash") for line in block.code.splitlines()]
    for line in lines:
        parse_command(shlex.split(line, comments=True))
    for token in inline(page, "code_inline"):
        if re.match(r"(minigolf|python -m (agents|benchmarks)\.\w+|make)( |$)", token.content):
            parse_command(shlex.split(token.content), is_in_text=True)


def parse_command(words: list[str], is_in_text: bool = False) -> None:
    """Parse a command without running it.

    Args:
        words: program and arguments.
        is_in_text: the command is part of a sentence, so that required arguments may be missing.

    Raises:
        SystemExit: the program does not accept an option.
        AssertionError: there is no such command.
    """
    if not words:
        return
    if words[0] == "xvfb-run":
        words = words[words.index("minigolf") :]
    program = re.sub(r"^\.venv[\w-]*/bin/", "", words[0])
    arguments = [word for word in words[1:] if word != "--help"]
    if program == "minigolf":
        if not arguments or arguments[0] in ("--version", "--tyro-write-completion"):
            return
        assert arguments[0] in COMMANDS_BY_NAME, words
        if arguments[1:] or not is_in_text:
            tyro.cli(functools.wraps(COMMANDS_BY_NAME[arguments[0]])(lambda **_: None), args=arguments[1:])
    elif program.startswith("python") and arguments[:2] in (["-m", "venv"], ["-m", "pytest"]):
        pass
    elif program == "python":
        assert arguments[0] == "-m", words
        pytest.importorskip("stable_baselines3")
        main = getattr(importlib.import_module(arguments[1]), "main", lambda: None)
        parameter_types = [hint for name, hint in get_type_hints(main).items() if name != "return"]
        if parameter_types:
            tyro.cli(parameter_types[0], args=arguments[2:])
        else:
            assert not arguments[2:], words
    elif program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
        assert not arguments or arguments[0] in targets, words
    else:
        assert program in EXTERNAL_PROGRAMS, words


def test_api_pages_list_all_public_names() -> None:
    """Each name on the API pages exists and is documented; each exported name of a public package is on them."""
    pages = "\n".join(page.read_text() for page in (DOCS / "api").glob("*.md"))
    listed = re.findall(r"^::: (\S+)$", pages, flags=re.MULTILINE)
    for path in listed:
        assert getattr(pkgutil.resolve_name(path), "__doc__", None), path
    assert len(listed) == len(set(listed))
    packages = [importlib.import_module(f"minigolf_env.{package}") for package in PUBLIC_PACKAGES]
    assert {f"{package.__name__}.{public}" for package in packages for public in package.__all__} <= set(listed)


def test_navigation_lists_every_page() -> None:
    """A reader of the site reaches every page of docs/ from the menu."""
    site = (ROOT / "mkdocs.yml").read_text()
    navigation = site.partition("exclude_docs:")[0]
    pages = [page for page in PAGES if DOCS in page.parents and page.name != "licences.md"]  # SECURITY.md links to it.
    assert all(f" {page.relative_to(DOCS).as_posix()}\n" in navigation for page in pages)


def rows(page: Path, heading: str) -> list[list[str]]:
    """Return the rows of the tables below a heading of a page, without header rows, as lists of cell texts."""
    result: list[list[str]] = []
    is_below_heading = False
    for previous, token in itertools.pairwise(tokens(page)):
        if previous.type == "heading_open":
            is_below_heading = token.content == heading
        if is_below_heading and previous.type == "tr_open" and token.type == "td_open":
            result.append([])
        if is_below_heading and previous.type == "td_open":
            result[-1].append(token.content.replace("`", ""))
    return result


def defaults() -> dict[str, Any]:
    """Return the defaults of the arguments of MiniGolf-v0, from the functions that take them."""
    functions = (MiniGolfEnv.__init__, config.build_env_config, config.build_task_sampler, config.build_task)
    parameters = [parameter for function in functions for parameter in inspect.signature(function).parameters.values()]
    return {p.name: p.default for p in reversed(parameters) if p.default is not p.empty}


def test_argument_table_has_all_arguments_and_defaults() -> None:
    """docs/environment.md lists the arguments of the environments with their defaults."""
    table = {row[0]: row[1] for row in rows(ENVIRONMENT, "Arguments")}
    assert {argument: eval(default) for argument, default in table.items()} == defaults()  # noqa: S307 (our own page)
    (batch,) = rows(ENVIRONMENT, "Vector environment")
    assert batch[0] in inspect.signature(MiniGolfVectorEnv).parameters
    assert eval(batch[1]) == MiniGolfVectorEnv.metadata["autoreset_mode"].value  # noqa: S307


def test_info_table_has_all_keys_and_types() -> None:
    """docs/environment.md lists the keys that ``reset`` returns on a hole, a level and a round."""
    table = {row[0]: row[1] for row in rows(ENVIRONMENT, "Info")}
    actual: dict[str, str] = {}
    for course in ("dogleg", "procedural", "round"):
        info = gym.make("MiniGolf-v0", course=course).reset(seed=1)[1]
        actual |= {key: type(value).__name__ for key, value in info.items()}
    assert table == actual


@pytest.mark.parametrize("observation", ["state", "rays"])
def test_observation_tables_cover_all_indices(observation: str) -> None:
    """The last index of each observation is in the tables of docs/environment.md."""
    space = gym.make("MiniGolf-v0", observation=observation).observation_space
    indices = [int(k) for row in rows(ENVIRONMENT, "Observation space") for k in re.findall(r"\d+", row[0])]
    assert space.shape is not None and space.shape[0] - 1 in indices and max(indices) == 47


def test_citations_have_the_current_version() -> None:
    """CITATION.cff and docs/cite.md name the package's version."""
    assert f"\nversion: {minigolf_env.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"version = {{{minigolf_env.__version__}}}" in (DOCS / "cite.md").read_text()


@pytest.mark.parametrize("example", ["windmill.toml", "boulder.glb"])
def test_course_check_finds_nothing_wrong_with_the_examples(example: str) -> None:
    """The example courses of the documentation load and can be played."""
    assert list(find_course_errors(DOCS / "examples" / example)) == []


def test_documented_course_file_equals_the_documented_python_code(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The TOML block of docs/courses.md is a complete course, and the Python block saves the same."""
    (block,) = blocks(COURSES, "toml")
    assert build_course(parse_description(block.code)).par == 2
    (hole,) = (block for block in blocks(COURSES, "python") if "builder.save" in block.code)
    monkeypatch.chdir(tmp_path)
    exec(hole.code, {})  # noqa: S102 (our own page)
    assert parse_description((tmp_path / "post.toml").read_text()) == parse_description(block.code)


@pytest.mark.parametrize("course", list_courses())
def test_course_table_has_each_hole_and_its_map(course: str) -> None:
    """Par, description and hole in one are as in the course file."""
    file = read_description(DATA_DIR / f"{course}.toml")
    (row,) = (row for row in rows(COURSES, "Courses") if row[0].startswith(f"[{course}]"))
    assert row[1] == str(file.par) and row[3] == file.about and row[4] == str(list(file.hole_in_one or ()))
    assert (DOCS / "figures" / "maps" / f"{course}.png").is_file()
