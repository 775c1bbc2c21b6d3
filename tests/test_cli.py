"""The command line: help with valid examples, exit codes, and no traceback for a user's mistake."""

from __future__ import annotations

import functools
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tyro

from minigolf_env import __version__, cli
from minigolf_env.apps.commands import COMMANDS_BY_NAME

SLOW_LIBRARIES = ("matplotlib", "numba", "OpenGL", "pydantic", "pyglet", "shapely", "torch", "trimesh", "typeguard")
"""Libraries that are slow to import."""


def examples(command: Callable[..., None]) -> list[list[str]]:
    """Return the arguments of the examples in a command's help."""
    lines = (line.strip() for line in str(command.__doc__).splitlines())
    start = f"$ minigolf {command.__name__.rstrip('_')}"
    return [line.removeprefix(start).split() for line in lines if line.startswith(start)]


@pytest.mark.parametrize("name", COMMANDS_BY_NAME)
def test_examples_in_help_are_valid_command_lines(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The help prints each example on its own line, and tyro parses its arguments."""
    command = COMMANDS_BY_NAME[name]
    shown = [["minigolf", name, *words] for words in examples(command)]
    with pytest.raises(SystemExit) as caught:
        cli.main([name, "--help"])
    printed = [line.split()[1:] for line in capsys.readouterr().out.splitlines() if line.startswith("$ ")]
    assert caught.value.code == 0 and printed == shown and len(shown) >= 2
    calls: list[dict[str, Any]] = []

    @functools.wraps(command)
    def record_call(**values: Any) -> None:
        calls.append(values)

    for words in examples(command):
        tyro.cli(record_call, args=words)
    assert len(calls) == len(shown)


def test_help_lists_all_commands_without_slow_imports() -> None:
    """Each command has one line, and no slow library is imported."""
    imported = [f"{name!r} in sys.modules" for name in SLOW_LIBRARIES]
    program = (
        "import sys\nfrom minigolf_env.cli import main\n"
        f"try: main(['--help'])\nfinally: assert not ({' or '.join(imported)}), sorted(sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
    assert (
        all(re.search(rf"\n    {name}\s", result.stdout) for name in COMMANDS_BY_NAME)
        and "$ minigolf" not in result.stdout
    )


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("", 2, "required: COMMAND"),
        ("evaluat", 2, "invalid choice: 'evaluat'"),
        ("map --directons 3", 2, "--directions"),
        ("map --directions three", 2, "three"),
        ("map --directions 0", 1, "--directions: expected an integer from 1"),
        ("map -o map.tex", 1, "the file's ending"),
        ("evaluate --course dogleq", 1, "did you mean 'dogleg'"),
        ("map --directions 9000000 --speeds 9000000", 1, "Unable to allocate"),
        ("evaluate --policy pp0", 1, "did you mean 'ppo'"),
        ("evaluate --policy none.zip", 1, "none.zip"),
        ("evaluate --policy random --first-seed -5", 1, "seed"),
        ("evaluate --policy random --json /dev/null/score.json", 1, "choose another folder"),
        ("benchmark --json /dev/null/score.json", 1, "choose another folder"),
        ("benchmark --levels 0", 1, "levels"),
        ("check none.toml", 1, "none.toml"),
        ("check dogleg --preview /dev/null/a.png", 1, "choose another folder"),
        ("check dogleg --preview a.tex", 1, "the file's ending"),
        ("evaluate --policy pp0 --json new/deep/score.json", 1, "did you mean 'ppo'"),
        ("benchmark --difficulty", 1, "difficulty: expected one or more"),
        ("courses --pictures /dev/null/pictures", 1, "/dev/null/pictures"),
        ("video --seed -1", 1, "seed"),
        ("video -o a.avi", 1, "'.mp4'"),
    ],
)
def test_mistake_is_reported_without_traceback(
    words: str, code: int, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: Any
) -> None:
    """Exit code 1 has a one-line message, 2 is an invalid command line. No file is left behind."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        cli.main(words.split())
    lines = capsys.readouterr().err.splitlines()
    assert caught.value.code == code and not any("Traceback" in line for line in lines)
    assert message in (lines[-1] if code == 1 else "\n".join(lines))
    assert not list(tmp_path.iterdir())


def test_version_and_completion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The version is one line; bash parses the completion script."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["--version"])
    assert not caught.value.code
    assert capsys.readouterr().out == f"minigolf_env {__version__}\n"
    script = tmp_path / "minigolf.bash"
    with pytest.raises(SystemExit) as caught:
        cli.main(["--tyro-write-completion", "bash", str(script)])
    assert not caught.value.code and "--directions" in script.read_text()
    subprocess.run(["/bin/bash", "-n", script], check=True)


def test_closed_pipe_is_not_an_error() -> None:
    """``minigolf courses | head -1`` exits with 0 and prints no error."""
    command = [sys.executable, "-m", "minigolf_env.cli", "courses"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert (process.stderr.read(), process.wait()) == ("", 0)


def test_bug_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    """An exception that is not a user's mistake is not caught."""

    def broken() -> None:
        """Fail."""
        raise RuntimeError("a bug")

    monkeypatch.setitem(COMMANDS_BY_NAME, "broken", broken)
    with pytest.raises(RuntimeError, match="a bug"):
        cli.main(["broken"])


def test_lack_of_memory_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Python's own MemoryError has no message."""

    def greedy() -> None:
        """Fail."""
        raise MemoryError

    monkeypatch.setitem(COMMANDS_BY_NAME, "greedy", greedy)
    with pytest.raises(SystemExit):
        cli.main(["greedy"])
    assert "not enough memory" in capsys.readouterr().err
