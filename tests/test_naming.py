"""Names have one meaning: each constant and each class of the package and the agents is defined in one module."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = [path for folder in ("minigolf_env", "agents") for path in sorted((ROOT / folder).rglob("*.py"))]


def constants(module: ast.Module) -> Iterator[str]:
    """Yield the names in upper case that are assigned at the top level of a module."""
    for statement in module.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign):
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            nodes = [node for target in targets for node in ast.walk(target)]
            names = [node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
            yield from (name for name in names if re.fullmatch(r"[A-Z_][A-Z0-9_]*", name))


def classes(module: ast.Module) -> Iterator[str]:
    """Yield the names of all classes of a module."""
    yield from (node.name for node in ast.walk(module) if isinstance(node, ast.ClassDef))


@pytest.mark.parametrize("names_in", [constants, classes], ids=["constants", "classes"])
def test_each_constant_and_class_is_defined_in_one_module(names_in: Callable[[ast.Module], Iterator[str]]) -> None:
    """A reader who searches for a name finds one definition."""
    found = defaultdict(set)
    for path in MODULES:
        for name in names_in(ast.parse(path.read_text())):
            found[name].add(path.relative_to(ROOT).as_posix())
    assert {name: sorted(files) for name, files in found.items() if len(files) > 1} == {}


def test_every_module_has_a_docstring() -> None:
    """The first line of a file says what it holds."""
    assert [str(path.relative_to(ROOT)) for path in MODULES if not ast.get_docstring(ast.parse(path.read_text()))] == []
