"""What the pages say is so: links lead somewhere, code runs, commands are understood, tables are the program's."""

from __future__ import annotations

import functools
import importlib
import inspect
import itertools
import pkgutil
import re
import shlex
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import gymnasium as gym
import pytest
import tyro

import minigolf_env
from minigolf_env import cli
from minigolf_env.apps.course_check import check
from minigolf_env.courses import list_courses
from minigolf_env.courses.io.toml_course import build_course, parse_description, read_description
from minigolf_env.courses.library import DATA_DIR
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs import config as options
from tests.markdown import PAGES, ROOT, anchors, blocks, inline, links, name, tokens

DOCS = ROOT / "docs"
PACKAGE = Path(minigolf_env.__file__).parent  # Installed, it is not beside the pages.
COURSES, ENVIRONMENT = DOCS / "courses.md", DOCS / "environment.md"

PACKAGES = ("envs", "physics", "courses", "wrappers")
"""Rooms whose every name is public."""

CLAIMS = {
    "README.md": "outcome.holed.shape == (256, 2) and shot.status.name == 'REST'",
    "docs/courses.md": "info['hole'] == 1 and over_par <= 9 * 10",
    "docs/levels.md": "info['level'] == 1_000_199 and train.reset()[1]['level'] < 500",
}
"""What holds once a page's code has run, besides what it asserts itself."""

TOOLS = {"apt-get", "export", "pip", "pytest", "ray", "tensorboard"}
"""Programs of others that pages call; what they are told is not looked at."""


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    """Files and headings of the repository are there; addresses elsewhere are whole."""
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
    """One after another, in one namespace a page and a folder without files; some are only compiled, and say why."""
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
    assert eval(CLAIMS.get(name(page), "True"), namespace)  # noqa: S307


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_are_understood(page: Path) -> None:
    """Every command line in a page, and in its text, is one that the programs take."""
    lines = [line for block in blocks(page, "bash") for line in block.code.splitlines()]
    for line in lines:
        understand(shlex.split(line, comments=True))
    for token in inline(page, "code_inline"):
        if re.match(r"(minigolf|python -m (agents|benchmarks)\.\w+|make)( |$)", token.content):
            understand(shlex.split(token.content), is_named=True)


def understand(words: list[str], is_named: bool = False) -> None:
    """Parse a command without running it; one that is only named may lack what it needs.

    Raises:
        SystemExit: an option is not what the program takes.
        AssertionError: there is no such command.
    """
    if not words:
        return
    if words[0] == "xvfb-run":
        words = words[words.index("minigolf") :]
    program, arguments = re.sub(r"^\.venv[\w-]*/bin/", "", words[0]), [word for word in words[1:] if word != "--help"]
    if program == "minigolf":
        commands = {command.__name__.rstrip("_"): command for command in cli.COMMANDS}
        if not arguments or arguments[0] in ("--version", "--tyro-write-completion"):
            return
        assert arguments[0] in commands, words
        if arguments[1:] or not is_named:
            tyro.cli(functools.wraps(commands[arguments[0]])(lambda **_: None), args=arguments[1:])
    elif program.startswith("python") and arguments[:2] in (["-m", "venv"], ["-m", "pytest"]):
        pass
    elif program == "python":
        assert arguments[0] == "-m", words
        pytest.importorskip("stable_baselines3")
        module = importlib.import_module(arguments[1])
        if hasattr(module, "Args"):
            tyro.cli(module.Args, args=arguments[2:])
        else:
            assert not arguments[2:], words
    elif program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
        assert not arguments or arguments[0] in targets, words
    else:
        assert program in TOOLS, words


def test_public_names_are_in_the_api() -> None:
    """Each name on the API's pages is there, and each name of a public package is on them."""
    pages = "\n".join(page.read_text() for page in (DOCS / "api").glob("*.md"))
    shown = re.findall(r"^::: (\S+)$", pages, flags=re.MULTILINE)
    for path in shown:
        assert getattr(pkgutil.resolve_name(path), "__doc__", None), path
    assert len(shown) == len(set(shown))
    rooms = [importlib.import_module(f"minigolf_env.{package}") for package in PACKAGES]
    assert {f"{room.__name__}.{public}" for room in rooms for public in room.__all__} <= set(shown)


def test_every_page_of_the_docs_is_in_the_navigation() -> None:
    """Nobody has to know of a page to find it."""
    site = (ROOT / "mkdocs.yml").read_text()
    navigation = site.partition("exclude_docs:")[0]
    pages = [page for page in PAGES if DOCS in page.parents and page.name != "licences.md"]  # SECURITY.md leads there.
    assert all(f" {page.relative_to(DOCS).as_posix()}\n" in navigation for page in pages)


def rows(page: Path, heading: str) -> list[list[str]]:
    """Return the rows of the tables below a heading of a page, without their heads, as the texts of their cells."""
    found: list[list[str]] = []
    below = False
    for before, token in itertools.pairwise(tokens(page)):
        if before.type == "heading_open":
            below = token.content == heading
        if below and before.type == "tr_open" and token.type == "td_open":
            found.append([])
        if below and before.type == "td_open":
            found[-1].append(token.content.replace("`", ""))
    return found


def defaults() -> dict[str, Any]:
    """Return the arguments of MiniGolf-v0 with their defaults, from the functions that take them."""
    takers = (MiniGolfEnv.__init__, options.build_env_config, options.build_task_sampler, options.build_task)
    named = [parameter for taker in takers for parameter in inspect.signature(taker).parameters.values()]
    return {p.name: p.default for p in reversed(named) if p.default is not p.empty}


def test_arguments_are_the_environments() -> None:
    """The page's tables have each with its default."""
    table = {row[0]: row[1] for row in rows(ENVIRONMENT, "Arguments")}
    assert {argument: eval(default) for argument, default in table.items()} == defaults()  # noqa: S307 (our own page)
    (batch,) = rows(ENVIRONMENT, "Many at once")
    assert batch[0] in inspect.signature(MiniGolfVectorEnv).parameters
    assert eval(batch[1]) == MiniGolfVectorEnv.metadata["autoreset_mode"].value  # noqa: S307


def test_infos_are_the_environments() -> None:
    """The page's table has each key with its type."""
    table = {row[0]: row[1] for row in rows(ENVIRONMENT, "Info")}
    given: dict[str, str] = {}
    for course in ("dogleg", "procedural", "round"):
        info = gym.make("MiniGolf-v0", course=course).reset(seed=1)[1]
        given |= {key: type(value).__name__ for key, value in info.items()}
    assert table == given


@pytest.mark.parametrize("observation", ["state", "rays"])
def test_all_numbers_of_an_observation_are_told(observation: str) -> None:
    """The page's tables count them: ten, and all."""
    space = gym.make("MiniGolf-v0", observation=observation).observation_space
    numbers = [int(k) for row in rows(ENVIRONMENT, "Observation space") for k in re.findall(r"\d+", row[0])]
    assert space.shape is not None and space.shape[0] - 1 in numbers and max(numbers) == 47


def test_citations_are_of_this_version() -> None:
    """CITATION.cff and the page."""
    assert f"\nversion: {minigolf_env.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"version = {{{minigolf_env.__version__}}}" in (DOCS / "cite.md").read_text()


@pytest.mark.parametrize("example", ["windmill.toml", "boulder.glb"])
def test_nothing_is_wrong_with_the_examples(example: str) -> None:
    """They load and can be played."""
    assert list(check(DOCS / "examples" / example)) == []


def test_the_course_file_in_the_docs_is_complete(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """And the same as the hole in Python."""
    (block,) = blocks(COURSES, "toml")
    assert build_course(parse_description(block.code)).par == 2
    (hole,) = (block for block in blocks(COURSES, "python") if "hole.save" in block.code)
    monkeypatch.chdir(tmp_path)
    exec(hole.code, {})  # noqa: S102 (our own page)
    assert parse_description((tmp_path / "post.toml").read_text()) == parse_description(block.code)


@pytest.mark.parametrize("course", list_courses())
def test_each_hole_has_its_row_and_its_map(course: str) -> None:
    """Par, idea and hole in one as in its file."""
    file = read_description(DATA_DIR / f"{course}.toml")
    (row,) = (row for row in rows(COURSES, "Courses") if row[0].startswith(f"[{course}]"))
    assert row[1] == str(file.par) and row[3] == file.about and row[4] == str(list(file.hole_in_one or ()))
    assert (DOCS / "figures" / "maps" / f"{course}.png").is_file()
