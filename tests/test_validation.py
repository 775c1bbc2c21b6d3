"""Values in error messages: their length, their cost, and the rule that they go through quote()."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minigolf_env._validation import (
    MAX_QUOTED_LENGTH,
    MAX_REASON_LENGTH,
    closest_choice,
    finite_array,
    integer,
    one_of,
    positive_number,
    quote,
    quote_error,
    quote_unless_plain,
)
from tests.cost import count_calls, measure_memory

ROOT = Path(__file__).parents[1]

EXEMPT_METHODS = ("__getattr__", "__repr__")
"""Methods whose texts are Python's own."""

HUGE_VALUES: dict[str, Any] = {
    "text": "x" * 1_000_000,
    "control characters": "\x1b" * 1_000_000,
    "integer": 10**100_000,
    "list": ["x" * 1_000_000] * 100_000,
    "list of integers": [10**5000] * 100_000,
    "dict": {str(k): k for k in range(100_000)},
    "set": set(range(100_000)),
    "array": np.zeros(1_000_000),
}


class NoRepr:
    """An object that cannot be printed."""

    def __repr__(self) -> str:
        """Raise an error."""
        raise RuntimeError("no repr")


def nested(depth: int) -> list[Any]:
    """Return a list whose repr takes 2^depth characters."""
    value: list[Any] = []
    for _ in range(depth):
        value = [value, value]
    return value


@pytest.mark.parametrize("value", ["a", "it's", 1.5, -3, None, True, (1,), [1, [2, 3]], {"a": (1, 2)}, b"x", ""])
def test_short_value_is_quoted_as_its_repr(value: object) -> None:
    """A reader sees what they wrote."""
    assert quote(value) == repr(value)


@pytest.mark.parametrize("name", HUGE_VALUES)
def test_huge_value_is_quoted_in_few_characters_and_operations(name: str) -> None:
    """The cost of a message does not depend on the size of the value, but for a list of a dict's keys."""
    with measure_memory() as memory, count_calls() as calls:
        text = quote(HUGE_VALUES[name])
    assert 0 < len(text) <= MAX_QUOTED_LENGTH and text.isprintable()
    assert calls.count < 20_000 and memory.peak < 2e6


def test_values_without_a_repr_are_quoted() -> None:
    """Nested lists that share items, and objects whose repr fails, do not replace the error by another."""
    for value in (nested(60), NoRepr(), [NoRepr()], 10**5000, [10**5000]):
        assert 0 < len(quote(value)) <= MAX_QUOTED_LENGTH


def test_long_text_keeps_its_ends() -> None:
    """The end of a path or of a library's message says which file or place."""
    shown = quote("/home/" + "x" * 5000 + "/course.toml")
    assert shown.startswith("'/home/") and shown.endswith("/course.toml'") and len(shown) == MAX_QUOTED_LENGTH
    reason = quote_error(ValueError("bad key " + "k" * 5000 + " (at line 7)"))
    assert reason.startswith("bad key k") and reason.endswith("(at line 7)") and len(reason) == MAX_REASON_LENGTH


def test_plain_names_are_shown_without_quotation_marks() -> None:
    """Names that are long, or hold other characters, are quoted."""
    for name in ("hole.toml", "Lane 3", "böschung_1"):
        assert quote_unless_plain(name) == name
    for name in ("a\nb", "a\x1b[31m", "a'b", "", "x" * 1000):
        assert quote_unless_plain(name) == quote(name)


@pytest.mark.parametrize("name", HUGE_VALUES)
def test_checks_of_huge_arguments_raise_short_messages(name: str) -> None:
    """Every check shows the argument shortened."""
    value = HUGE_VALUES[name]
    for check in (
        lambda: one_of(value, ("aa", "bb"), "kind"),
        lambda: integer(value, "count", 0, 9),
        lambda: positive_number(value, "speed", "give a number."),
        lambda: finite_array(value, (3,), "position", "give x, y, z."),
    ):
        with pytest.raises(ValueError, match=r"^\w+: expected .*, received ") as error:
            check()
        assert len(str(error.value)) < 400


def test_misspelt_choice_is_suggested() -> None:
    """Only texts about as long as a choice are compared with the choices."""
    assert closest_choice("doglegg", ("dogleg", "bank")) == "dogleg"
    for value in ("zzz", 7, None, ["dogleg"]):
        assert closest_choice(value, ("dogleg", "bank")) is None
    long_name = "dogleg" + "g" * MAX_QUOTED_LENGTH
    assert closest_choice(long_name, (long_name[:-1],)) is None


def unbounded_values(module: ast.Module) -> Iterator[int]:
    """Yield the lines of a module that show a value by its whole repr, other than in EXEMPT_METHODS."""
    functions = [node for node in ast.walk(module) if isinstance(node, ast.FunctionDef)]
    exempt = {id(node) for function in functions if function.name in EXEMPT_METHODS for node in ast.walk(function)}
    for node in ast.walk(module):
        if isinstance(node, ast.FormattedValue) and node.conversion == ord("r") and id(node) not in exempt:
            yield node.lineno


def test_values_in_messages_go_through_quote() -> None:
    """The rule of CONTRIBUTING.md: no message shows a value by "!r", which has no limit."""
    paths = [path for folder in ("minigolf_env", "agents") for path in sorted((ROOT / folder).rglob("*.py"))]
    lines = {str(path.relative_to(ROOT)): list(unbounded_values(ast.parse(path.read_text()))) for path in paths}
    assert {path: found for path, found in lines.items() if found} == {}
