"""Mutation testing: break the package in small ways and print what no test notices. Run: python -m tools.mutation.

A mutant is the package with one small change to one syntax tree: another comparison or operator, a doubled constant, a
negated condition, max for min, a dropped statement. Each mutant is written to a copy of the package, and the tests of
its package run on it until one fails. A test run that exceeds the time limit counts as a noticed mutant: an endless
loop is a fault that tests show. Some survivors are equivalent mutants, which behave as the package does, for instance
where a bound is compared with <= and equality has no effect; for each of the others a test is missing.
"""

from __future__ import annotations

import ast
import difflib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

ROOT = Path(__file__).parents[1]

COPIED_FOLDERS = ("minigolf_env", "tests", "tools", "agents", "benchmarks", "docs")
COPIED_FILES = ("pyproject.toml", "CHANGELOG.md")
"""Files that the tests need, besides COPIED_FOLDERS."""

OPERATOR_SWAPS: dict[type[ast.AST], tuple[type[ast.AST], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.USub: (ast.UAdd,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.And: (ast.Or,),
    ast.Or: (ast.And,),
}

NAME_SWAPS = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}

DROPPED_STATEMENTS = (ast.AugAssign, ast.Break, ast.Continue, ast.Expr, ast.Raise)

UNCHANGED_FIELDS = {"annotation", "returns", "decorator_list"}
"""Fields of the syntax tree that do not change what the program computes."""

IGNORED_TESTS = ("tests/physics/test_golden.py",)
"""Tests that are left out: hashes notice every change, and would hide that no law is tested."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    module: tuple[str, ...] = ("physics", "envs", "courses")
    """Files or folders in minigolf_env to mutate, such as physics/step.py."""
    sample: int = 40
    """Number of mutants, drawn at random from those of all modules."""
    seed: int = 0
    """Seed of the draw."""


def iter_mutants(tree: ast.Module) -> Iterator[None]:
    """Apply one mutation after another to a syntax tree, in place; yield after each and revert it.

    An iteration must run to its end, or the tree keeps a mutation.
    """
    for siblings, index, field in list(iter_nodes(tree)):
        node = siblings[index]
        for replacement in variants(node, field):
            siblings[index] = replacement
            yield
            siblings[index] = node


def iter_nodes(parent: ast.AST) -> Iterator[tuple[Any, Any, str]]:
    """Yield each node below ``parent`` as (container, key, field), so that container[key] is the node.

    The container is a list or the ``vars`` of its parent; ``field`` is the parent's field that holds the node.
    """
    for field, value in ast.iter_fields(parent):
        if field in UNCHANGED_FIELDS:
            continue
        siblings, keys = (value, range(len(value))) if isinstance(value, list) else (vars(parent), [field])
        for key in keys:
            if isinstance(siblings[key], ast.AST):
                yield siblings, key, field
                yield from iter_nodes(siblings[key])


def variants(node: ast.AST, field: str) -> Iterator[ast.AST]:
    """Yield what a node is replaced by, one for each mutation; ``field`` is the parent's field that has it."""
    for operator in OPERATOR_SWAPS.get(type(node), ()):
        yield operator()
    match node:
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield ast.Constant(2 * value or type(value)(1))
        case ast.Name(id=name) if name in NAME_SWAPS:
            yield ast.Name(NAME_SWAPS[name])
        case ast.Attribute(value=owner, attr=name) if name in NAME_SWAPS:
            yield ast.Attribute(owner, NAME_SWAPS[name])
        case ast.Expr(value=ast.Constant()):
            pass  # A docstring.
        case _ if isinstance(node, DROPPED_STATEMENTS):
            yield ast.Pass()
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield ast.Pass()
    if field == "test" and isinstance(node, ast.expr):
        yield ast.UnaryOp(ast.Not(), node)


def draw_mutants(modules: list[Path], sample: int, seed: int) -> Iterator[tuple[Path, str]]:
    """Yield a random sample of the mutants of some modules: the module's file and its mutated source."""
    trees = {module: ast.parse(module.read_text()) for module in modules}
    sizes = {module: sum(1 for _ in iter_mutants(tree)) for module, tree in trees.items()}
    population = [(module, index) for module, size in sizes.items() for index in range(size)]
    print(f"{len(population):,} mutants in {len(modules)} modules", flush=True)
    drawn = set(random.Random(seed).sample(population, min(sample, len(population))))  # noqa: S311 (no secret)
    for module, tree in trees.items():
        for index, _ in enumerate(iter_mutants(tree)):
            if (module, index) in drawn:
                yield module, ast.unparse(tree)


def select_tests(module: Path) -> list[str]:
    """Return the tests for a module's mutants: first those named after it, then those of its package.

    Args:
        module: path relative to the repository.
    """
    package = module.parts[1]
    candidates = (f"tests/{package}/test_{module.stem}.py", f"tests/test_{package}.py", f"tests/{package}")
    return [name for name in candidates if (ROOT / name).exists()] or ["tests"]


def first_failure(copy: Path, tests: str, time_limit: float | None = None) -> str:
    """Run tests on a copy of the package until one fails.

    Args:
        copy: the folder of the copy.
        tests: a file or folder of tests.
        time_limit: seconds until the tests are stopped.

    Returns:
        The name of the test that failed, or why pytest ended; "" if all tests passed.

    Raises:
        RuntimeError: pytest found no tests or could not start.
    """
    ignored = [f"--ignore={name}" for name in IGNORED_TESTS]
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *ignored, tests]
    # CI makes hypothesis draw the same examples in each run. Mutants outside the physics share its compiled kernels.
    environment = {**os.environ, "CI": "1", "PYTHONPATH": str(copy), "NUMBA_CACHE_DIR": str(copy / "cache")}
    process = subprocess.Popen(
        command,
        cwd=copy,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        output, _ = process.communicate(timeout=time_limit)
    except subprocess.TimeoutExpired:
        return f"time limit of {time_limit:.0f} s"
    finally:
        # After the time limit or an interrupt, stop pytest and the processes that it started.
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    if process.returncode == 0:
        return ""
    failures: list[str] = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", output, re.MULTILINE)
    if process.returncode in (1, 2) and failures:
        return failures[0]
    if process.returncode < 0:
        return f"signal {-process.returncode}"
    raise RuntimeError(f"pytest ended with {process.returncode}:\n{output[-2000:]}")


def difference(old: str, new: str) -> str:
    """Return the lines that differ between two sources, without comments and formatting."""
    lines = [ast.unparse(ast.parse(source)).splitlines() for source in (old, new)]
    return "\n".join(list(difflib.unified_diff(*lines, lineterm="", n=0))[2:])


def main(args: Args) -> int:
    """Test a sample of mutants and print the survivors; return 1 if the tests fail on the intact package."""
    time_limits: dict[str, float] = {}
    failures: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in COPIED_FOLDERS:
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        for name in COPIED_FILES:
            shutil.copy(ROOT / name, copy)
        modules = [file for name in args.module for file in modules_in(copy / "minigolf_env" / name)]
        for module, mutant in draw_mutants(modules, args.sample, args.seed):
            source = module.read_text()
            tests = select_tests(module.relative_to(copy))
            # Measure the tests of a package once, on the intact package.
            if tests[-1] not in time_limits:
                start = time.perf_counter()
                if failure := first_failure(copy, tests[-1]):
                    print(f"The tests fail on the intact package: {failure}", file=sys.stderr)
                    return 1
                time_limits[tests[-1]] = 60.0 + 3.0 * (time.perf_counter() - start)
            # Test the mutant, then restore the module.
            module.write_text(mutant)
            start = time.perf_counter()
            runs = (first_failure(copy, name, time_limits[tests[-1]]) for name in tests)
            failures.append(next(filter(None, runs), ""))
            seconds = time.perf_counter() - start
            module.write_text(source)
            print(f"{'killed by ' + failures[-1] if failures[-1] else 'SURVIVED'} ({seconds:.0f} s)")
            changes = f"{module.relative_to(copy).as_posix()} {difference(source, mutant)}"
            print("    " + changes.replace("\n", "\n    "), flush=True)
    print(f"{sum(map(bool, failures))} of {len(failures)} mutants noticed")
    return 0


def modules_in(path: Path) -> list[Path]:
    """Return a file, or all Python files in a folder.

    Raises:
        ValueError: there are none.
    """
    files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
    if not files or not all(file.is_file() for file in files):
        raise ValueError(
            f"--module: expected files or folders in minigolf_env, received {path}; example: physics/step.py"
        )
    return files


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
