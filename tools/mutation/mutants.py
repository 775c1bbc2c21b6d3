"""Do the tests notice small faults in the rules and the courses? Run: make mutants-envs.

mutmut writes the faults: a number one larger, an operator turned, an argument left out. Each is tested in a fork of a
process that has the libraries and the compiled physics in its memory, but no test module and no course. mutmut's own
runners keep courses that were built without the fault, or run the tests in no order. The faults that no test notices
are printed as differences; tests/survivors.md says why they are left.
"""

from __future__ import annotations

import ast
import difflib
import gc
import os
import random
import shutil
import signal
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pydantic  # noqa: F401 (in memory before the forks, as all that follow)
import pytest
import shapely.affinity  # noqa: F401
import tomli_w  # noqa: F401
import trimesh.creation  # noqa: F401
import tyro
from mutmut.mutation.file_mutation import mutate_file_contents
from mutmut.mutation.trampoline import set_mutant_under_test

ROOT = Path(__file__).parents[2]
COURSES = "minigolf_env/courses"

BUILT = ("parts", "course", "messages", "glb", "files", "mesh_files", "dogleg")
JUDGES = {
    "minigolf_env/envs/task.py": [f"tests/envs/test_{name}.py" for name in ("task", "minigolf", "minigolf_vector")],
    f"{COURSES}/procedural": [f"tests/courses/test_{name}.py" for name in ("procedural",)],
    f"{COURSES}/gltf.py": ["tests/courses/test_glb.py"],
    COURSES: [f"tests/courses/test_{name}.py" for name in BUILT],
}
"""Which tests judge a module, by the first of these that its path begins with; the first file is asked alone first."""

SLOW = (
    "green100k or volcano or funnel or islands or pixels or process or importing or mutated or hundred_times "
    "or checkers or can_be_played or every_tee"
)
"""Tests left out: they take seconds, or look at another process, which is without the fault."""

PATIENCE = 120
"""Seconds after which tests are taken to hang, which is noticing too."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    only: tuple[str, ...] = ()
    """Parts of the paths of modules to test; all without."""
    names: tuple[str, ...] = ()
    """Parts of the names of mutants to test; all without."""
    sample: int | None = None
    """Mutants of each module, drawn at random; all without."""
    seed: int = 0
    folder: str = "0"
    """Name of the copy below build/; another for each that runs at a time."""
    jobs: int = 1
    """Mutants tested at a time."""


class Judge:
    """Runs the fastest tests first and remembers which failed.

    Args:
        seconds: how long each test takes, if known; filled in.
    """

    def __init__(self, seconds: dict[str, float]) -> None:
        self.seconds, self.failed = seconds, ""

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Sort the tests."""
        items.sort(key=lambda item: self.seconds.get(item.nodeid, 0.0))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a test's time and failure."""
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        self.failed = self.failed or (report.nodeid if report.failed else "")

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a module that cannot be imported."""
        self.failed = self.failed or (report.nodeid if report.failed else "")

    def run(self, tests: list[str]) -> str:
        """Return the first test that fails; "" if none does."""
        # Without plugins and rewritten assertions, and without looking for garbage, pytest starts five times as fast.
        fast = ["--assert=plain", "-p", "no:unraisableexception", "-p", "no:cacheprovider"]
        for files in (tests[:1], tests[1:]):
            code = pytest.main(["-x", "-q", *fast, "-k", f"not ({SLOW})", *files], [self]) if files else 0
            if code not in (0, 1, 2) or bool(code) != bool(self.failed):
                return f"pytest ended with {code}"
            if self.failed:
                break
        return self.failed


def tests_of(module: str) -> list[str]:
    """Return the tests that judge a module."""
    return next(tests for begin, tests in JUDGES.items() if module.startswith(begin))


def functions(code: str) -> dict[str, str]:
    """Return the functions and methods of a module's mutated code, by the names that mutmut gives them."""
    return {node.name: ast.unparse(node) for node in ast.walk(ast.parse(code)) if isinstance(node, ast.FunctionDef)}


def difference(name: str, code: dict[str, str]) -> tuple[str, bool]:
    """Return what a mutant changes, and whether that is the text of a message alone: strings with spaces."""
    old, new = (ast.parse(code[one]).body[0] for one in (f"{name.rpartition('__mutmut_')[0]}__mutmut_orig", name))
    lines = [ast.unparse(one).splitlines()[1:] for one in (old, new)]
    changed = [
        line
        for line in difflib.unified_diff(*lines, lineterm="", n=0)
        if line[:1] in "+-" and line[:3] not in ("+++", "---")
    ]
    for tree in (old, new):
        tree.name = ""  # type: ignore[attr-defined]
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
                node.value = ""
    return "\n".join(changed), ast.dump(old) == ast.dump(new)


def warm_up() -> None:
    """Load the compiled physics, and what is imported but not yet called of the package."""
    import minigolf_env.courses.glb
    import minigolf_env.envs
    import minigolf_env.rendering  # noqa: F401
    from minigolf_env.physics import TriangleMesh, World

    world = World([TriangleMesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])])
    one = np.array([(0.0, 0.0, 1.0)])
    world.clearance(one)
    world.sweep_batch(one, -one)
    world.simulate_batch(one, one, 1.0)
    gc.freeze()


def in_fork(name: str, tests: list[str], seconds: dict[str, float], result: Path) -> int:
    """Start a process that judges a mutant and writes which test noticed it; return its number."""
    process = os.fork()
    if process:
        return process
    try:
        with Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
        signal.alarm(PATIENCE)
        set_mutant_under_test(name)
        judge = Judge(dict(seconds))
        result.write_text(judge.run(tests))
        if not name:
            result.with_suffix(".seconds").write_text(repr(judge.seconds))
    except BaseException as error:
        result.write_text(f"pytest ended with {error!r}")
    finally:
        os._exit(0)


def judge_all(names: list[str], tests: list[str], seconds: dict[str, float], jobs: int, folder: Path) -> dict[str, str]:
    """Return which test notices each mutant; "" for those that none does."""
    running: dict[int, str] = {}
    noticed: dict[str, str] = {}
    waiting = list(names)
    while waiting or running:
        while waiting and len(running) < jobs:
            name = waiting.pop(0)
            running[in_fork(name, tests, seconds, folder / f"{name or 'intact'}.txt")] = name
        process, _ = os.wait()
        name = running.pop(process)
        result = folder / f"{name or 'intact'}.txt"
        noticed[name] = result.read_text() if result.exists() else f"nothing ended within {PATIENCE} s"
    return noticed


def main(args: Args) -> int:
    """Print a row for each module and each survivor; return 1 if the tests fail without a fault."""
    modules = [
        "minigolf_env/envs/task.py",
        *sorted(str(path.relative_to(ROOT)) for path in (ROOT / COURSES).rglob("*.py")),
    ]
    os.environ |= {"CI": "1", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # CI: the same examples each time.
    total: Counter[str] = Counter()
    copy = ROOT / "build" / f"mutants-{args.folder}"
    shutil.rmtree(copy, ignore_errors=True)
    for part in ("minigolf_env", "tests", "benchmarks", "docs"):
        shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", copy)
    modules = [module for module in modules if not args.only or any(part in module for part in args.only)]
    modules.sort(key=lambda module: min((k for k, part in enumerate(args.only) if part in module), default=0))
    mutated = {module: mutate_file_contents(module, (ROOT / module).read_text()) for module in modules}
    for module, one in mutated.items():
        (copy / module).write_text(one.code)
    os.chdir(copy)
    sys.path.insert(0, str(copy))
    warm_up()
    for module, one in mutated.items():
        began, dotted = time.perf_counter(), module[:-3].replace("/", ".").removesuffix(".__init__")
        chosen = [f"{dotted}.{mutant}" for mutant in one.mutant_names]
        chosen = [mutant for mutant in chosen if not args.names or any(part in mutant for part in args.names)]
        if args.sample is not None and len(chosen) > args.sample:
            chosen = random.Random(args.seed).sample(chosen, args.sample)  # noqa: S311 (not for secrets)
        if not chosen:
            continue
        tests, results = tests_of(module), copy / "results"
        results.mkdir(exist_ok=True)
        failure = judge_all([""], tests, {}, 1, results)[""]
        if failure:
            print(f"The tests fail without a fault: {failure}", file=sys.stderr)
            return 1
        seconds: dict[str, Any] = ast.literal_eval((results / "intact.seconds").read_text())
        noticed = judge_all(chosen, tests, seconds, args.jobs, results)
        code, counts = functions(one.code), Counter[str]()
        for mutant, test in noticed.items():
            changed, text = difference(mutant.rpartition(".")[2], code)
            counts[
                ("unclear" if test.startswith("pytest ended") else "killed" if test else "survived")
                + (" text" if text else "")
            ] += 1
            if not test:
                print(f"{mutant}{' (text)' if text else ''}\n{changed}", flush=True)
            elif test.startswith(("pytest ended", "nothing ended")):
                print(f"{mutant}: {test}\n{changed}", flush=True)
        total += counts
        print(
            f"== {module}: {len(chosen)} of {len(one.mutant_names)}, {dict(counts)}, "
            f"{time.perf_counter() - began:.0f} s",
            flush=True,
        )
    print(f"== all: {dict(total)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
