"""The command lines of all programs: help of 80 columns, and errors that name the option as the user types it."""

from __future__ import annotations

import dataclasses
import importlib
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from minigolf_env import cli
from minigolf_env.apps.command_line import _fold, name_option
from minigolf_env.apps.commands import COMMANDS_BY_NAME

AGENTS = sorted(
    path.stem for path in (Path(__file__).parents[1] / "agents").glob("*.py") if "if __name__ ==" in path.read_text()
)
"""Names of the sample programs."""

NUMBERS_OUT_OF_RANGE = {"int": "-1", "int | None": "-1", "float": "-1e9", "tuple[int, ...]": "-1"}
"""Arguments that no option of a type accepts."""


def run_agent(name: str, *arguments: str) -> None:
    """Run a sample program with the arguments of a command line."""
    pytest.importorskip("stable_baselines3")
    from agents.command_line import run_program

    module = importlib.import_module(f"agents.{name}")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [f"{name}.py", *arguments])
        run_program(module.main, get_type_hints(module.main)["config"], module.__doc__)


def numeric_options(name: str) -> list[tuple[str, str]]:
    """Return the options of a sample program that are numbers, each with an argument out of its range."""
    config_class: Any = get_type_hints(importlib.import_module(f"agents.{name}").main)["config"]
    options = [
        (field.name, NUMBERS_OUT_OF_RANGE[field.type])
        for field in dataclasses.fields(config_class)
        if field.type in NUMBERS_OUT_OF_RANGE
    ]
    return [(option.replace("_", "-"), argument) for option, argument in options if option != "max_runs"]


@pytest.mark.parametrize("columns", [80, 132])
@pytest.mark.parametrize("program", ["", *COMMANDS_BY_NAME, *AGENTS])
def test_help_fits_the_terminal(
    program: str, columns: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No line of the help of a command or a sample program is wider than the terminal."""
    monkeypatch.setenv("COLUMNS", str(columns))
    with pytest.raises(SystemExit) as caught:
        if program in AGENTS:
            run_agent(program, "--help")
        else:
            cli.main([program, "--help"] if program else ["--help"])
    lines = capsys.readouterr().out.splitlines()
    assert not caught.value.code and len(lines) > 10
    assert not [line for line in lines if len(line) > columns]


def test_folded_lines_keep_words_styles_and_indents() -> None:
    """Codes of styles have no width; a line that is continued has the indent of its text."""
    text = "\x1b[1musage:\x1b[0m a b\n  - one two three\nwords of a line\n\na-word-that-is-too-long"
    folded = "\x1b[1musage:\x1b[0m a b\n  - one two\n    three\nwords of a\nline\n\na-word-that-is-too-long\n"
    assert _fold(text, 12) == folded


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("first_seed: expected 0", "--first-seed: expected 0"),
        ("seed: expected 0", "--first-seed: expected 0"),
        ("size of a .gif: expected 1", "--size of a .gif: expected 1"),
        ("size (pixels): expected 1", "--size (pixels): expected 1"),
        ("size.toml: expected 1", "size.toml: expected 1"),
        ("other: expected 1", "other: expected 1"),
        ("/dev/null: expected 1", "/dev/null: expected 1"),
        ("", ""),
    ],
)
def test_message_names_the_option(message: str, expected: str) -> None:
    """An argument at the beginning is replaced by its option, also if it has another name; paths are not."""
    assert name_option(message, ("first_seed", "size"), {"seed": "first_seed", "width": "height"}) == expected


@pytest.mark.parametrize(
    ("words", "option"),
    [
        ("play --size 0 0", "--size"),
        ("play --profile none", "--profile"),
        ("play --opponent none", "--opponent"),
        ("play --opponent none.zip", "--opponent"),
        ("play --course none", "--course"),
        ("video --course none", "--course"),
        ("video --policy none.npz", "--policy"),
        ("video --difficulty easy", "--difficulty"),
        ("video --episodes 0", "--episodes"),
        ("video --seed -1", "--seed"),
        ("video --camera none", "--camera"),
        ("video --size 0 0", "--size"),
        ("video --size 99999 99999", "--size"),
        ("video --fps 0", "--fps"),
        ("video --fps 60 --output a.gif", "--fps"),
        ("video --profile none", "--profile"),
        ("video -o a.avi", "--output"),
        ("check dogleg --preview a.avi", "--preview"),
        ("map --course room", "--course"),
        ("map --tee 1", "--tee"),
        ("map --tee nan,1", "--tee"),
        ("map --tee 100,100", "--tee"),
        ("map --tee 3.3,1.5", "--tee"),
        ("map --directions 0", "--directions"),
        ("map --directions 99999999999999999999", "--directions"),
        ("map --speeds 0", "--speeds"),
        ("map -o a.avi", "--output"),
        ("evaluate --policy none", "--policy"),
        ("evaluate --course room", "--course"),
        ("evaluate --difficulty easy", "--difficulty"),
        ("evaluate --course procedural --difficulty none", "--difficulty"),
        ("evaluate --episodes 0", "--episodes"),
        ("evaluate --episodes 99999999999", "--episodes"),
        ("evaluate --first-seed -1", "--first-seed"),
        ("evaluate --policy random --first-seed -1", "--first-seed"),
        ("evaluate --course procedural --first-seed 2147483648 --episodes 1", "--first-seed"),
        ("evaluate --course procedural --policy generalist --first-seed 2147483648 --episodes 1", "--first-seed"),
        ("evaluate --max-strokes 0", "--max-strokes"),
        ("evaluate --putt-noise -1 0", "--putt-noise"),
        ("benchmark --policy none", "--policy"),
        ("benchmark --difficulty none", "--difficulty"),
        ("benchmark --levels 0", "--levels"),
        ("benchmark --levels 1 --max-strokes 0", "--max-strokes"),
        ("benchmark --policy random --seed -1", "--seed"),
        ("benchmark --policy generalist --seed -1", "--seed"),
    ],
)
def test_error_of_a_command_begins_with_the_option(
    words: str, option: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not with the argument that the option is passed on as."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        cli.main(words.split())
    assert caught.value.code in (cli.EXIT_FAILED, cli.EXIT_NO_DISPLAY)
    lines = [line for line in capsys.readouterr().err.splitlines() if "compiling the physics" not in line]
    if "no EGL display" in lines[0]:
        pytest.skip(lines[0])
    assert len(lines) == 1 and re.match(rf"minigolf: {option}\b.*: expected ", lines[0]), lines
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("program", AGENTS)
def test_error_of_a_sample_program_begins_with_the_option(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each number that is out of its range is named as the user types it."""
    monkeypatch.chdir(tmp_path)
    pytest.importorskip("stable_baselines3")
    if program == "release_model":  # It needs a run.
        with pytest.raises(SystemExit, match=r"^run: expected the folder of a run"):
            run_agent(program, "none")
        return
    options = numeric_options(program)
    assert len(options) > 3
    for option, argument in options:
        with pytest.raises(SystemExit, match=rf"^--{option}: expected .* received "):
            run_agent(program, f"--{option}={argument}")
    assert not list(tmp_path.iterdir())


def test_sample_program_has_the_name_that_starts_it() -> None:
    """The usage is a command that works, and an error is one line on stderr."""
    pytest.importorskip("stable_baselines3")
    for argument, code, text in (("--help", 0, "usage: python -m agents.train_sac "), ("--n-envs=0", 1, "--n-envs: ")):
        command = [sys.executable, "-m", "agents.train_sac", argument]
        result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[1])
        assert result.returncode == code and (result.stdout + result.stderr).startswith(text)
