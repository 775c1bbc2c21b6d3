"""The mutation program changes code in the ways that it names, and notices failures and endless loops."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tools.mutation import ROOT, difference, draw_mutants, first_failure, iter_mutants, modules_in, select_tests


def mutants_of(source: str) -> list[str]:
    """Return the source of each mutant."""
    tree = ast.parse(source)
    mutants = [ast.unparse(tree) for _ in iter_mutants(tree)]
    assert ast.unparse(tree) == ast.unparse(ast.parse(source))
    return mutants


@pytest.mark.parametrize(
    ("source", "mutants"),
    [
        ("x = a < b < c", ["x = a <= b < c", "x = a >= b < c", "x = a < b <= c", "x = a < b >= c"]),
        ("x = a + b", ["x = a - b"]),
        ("x = a and -b", ["x = a or -b", "x = a and +b"]),
        (
            "x = [2, 0, True, 'text']",
            ["x = [4, 0, True, 'text']", "x = [2, 1, True, 'text']", "x = [2, 0, False, 'text']"],
        ),
        ("x = np.maximum(a, min(b))", ["x = np.minimum(a, min(b))", "x = np.maximum(a, max(b))"]),
        ("if a:\n    f()", ["if not a:\n    f()", "if a:\n    pass"]),
        ("@f(1)\ndef g(a: Literal[1]=2):\n    'Doc.'", ["@f(1)\ndef g(a: Literal[1]=4):\n    'Doc.'"]),
        ("a.b = c", ["pass"]),
        ("a += b", ["pass", "a -= b"]),
    ],
)
def test_mutants_are_small_changes_of_the_source(source: str, mutants: list[str]) -> None:
    """Comparisons, operators, constants, conditions and statements change; docstrings and annotations do not."""
    normalised = [ast.unparse(ast.parse(text)) for text in mutants]
    assert sorted(mutants_of(source)) == sorted(normalised)


def test_sample_of_mutants_depends_only_on_the_seed() -> None:
    """Two draws are equal, each source is one change away from the module, and all of them compile."""
    modules = [ROOT / "minigolf_env" / "physics" / name for name in ("contact.py", "sweep.py")]
    mutants = list(draw_mutants(modules, 20, seed=3))
    assert mutants == list(draw_mutants(modules, 20, seed=3)) != list(draw_mutants(modules, 20, seed=4))
    for module, source in mutants:
        compile(source, str(module), "exec")
        assert difference(module.read_text(), source).count("@@") == 2


def test_every_module_has_tests_for_its_mutants() -> None:
    """The tests named after a module run first, then those of its package."""
    sweep = Path("minigolf_env", "physics", "sweep.py")
    assert select_tests(sweep) == ["tests/physics/test_sweep.py", "tests/physics"]
    assert all(select_tests(module.relative_to(ROOT)) for module in modules_in(ROOT / "minigolf_env"))
    with pytest.raises(ValueError, match=r"expected files or folders in minigolf_env, received .*no_such.py"):
        modules_in(ROOT / "minigolf_env" / "no_such.py")


@pytest.mark.parametrize(
    ("test", "time_limit", "expected"),
    [
        ("pass", None, ""),
        ("assert False", None, "tests/test_it.py::test_it"),
        ("import os; os.abort()", None, "signal 6"),
        ("while True: pass", 2.0, "time limit of 2 s"),
    ],
)
def test_failures_and_endless_loops_notice_a_mutant(
    test: str, time_limit: float | None, expected: str, tmp_path: Path
) -> None:
    """The first failure is reported by its name; tests that exceed the time limit are stopped."""
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_it.py").write_text(f"def test_it():\n    {test}\n")
    assert first_failure(tmp_path, "tests", time_limit) == expected


def test_refuses_tests_that_do_not_exist(tmp_path: Path) -> None:
    """A run without tests is not taken for a survivor."""
    with pytest.raises(RuntimeError, match="pytest ended with 4"):
        first_failure(tmp_path, "no_such_folder")
