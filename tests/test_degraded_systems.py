"""On machines that lack something the package works, or one line says what to do."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import minigolf_env

ROOT = Path(__file__).parents[1]

EPISODE = """
import gymnasium as gym, numpy as np, minigolf_env
env = gym.make("MiniGolf-v0")
putts = np.random.default_rng(0).uniform(-1.0, 1.0, (8, 2))
print(env.reset(seed=3)[0].tobytes().hex(), *(env.step(putt)[0].tobytes().hex() for putt in putts))
"""

BATCH = """
import gymnasium as gym, numpy as np, minigolf_env
envs = gym.make_vec("MiniGolf-v0", num_envs=64)
envs.reset(seed=3)
putts = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 64, 2))
print(*(envs.step(putt)[0].tobytes().hex() for putt in putts))
"""

PROGRAM_WITHOUT_MODULES = """
import importlib.machinery, runpy, sys

class FinderWithoutModules(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name in {missing!r} else super().find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(importlib.machinery.PathFinder)] = FinderWithoutModules
sys.argv = ["-m", *{arguments!r}]
runpy.run_module({module!r}, run_name="__main__", alter_sys=True)
"""


def python(*arguments: str, folder: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a new process with additional environment variables."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_without_a_writable_folder_the_physics_compiles_with_a_warning(tmp_path: Path) -> None:
    """Episodes have the same bits; one warning names NUMBA_CACHE_DIR."""
    package = tmp_path / "site" / "minigolf_env"
    shutil.copytree(Path(minigolf_env.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [package, *(path for path in package.rglob("*") if path.is_dir())]:
        (folder / "__pycache__").touch()  # A file of that name prevents a folder, even for root.
    no_home = {name: "/dev/null" for name in ("HOME", "XDG_CACHE_HOME", "XDG_DATA_HOME")}
    result = python("-c", EPISODE, folder=package.parent, NUMBA_CACHE_DIR="", **no_home)
    assert result.returncode == 0, result.stderr
    assert result.stderr.count("NUMBA_CACHE_DIR") == 1 and "Traceback" not in result.stderr
    assert result.stdout == python("-c", EPISODE).stdout


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="only Linux restricts a process to cores")
def test_one_core_gives_the_same_bits() -> None:
    """A batch on one core equals a batch on all cores."""
    single_core = python("-c", f"import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n{BATCH}")
    assert single_core.returncode == 0, single_core.stderr
    assert single_core.stdout == python("-c", BATCH).stdout


@pytest.mark.parametrize(
    ("module", "arguments", "missing", "hint"),
    [
        ("agents.train_ppo", [], ["torch"], 'pip install -c constraints.txt -e ".[agents]"'),
        ("agents.train_ppo", [], ["stable_baselines3"], 'pip install -c constraints.txt -e ".[agents]"'),
        ("agents.train_rllib", [], ["ray"], 'pip install -c constraints-distributed.txt -e ".[agents,distributed]"'),
        ("minigolf_env.cli", ["evaluate", "--policy", "{zip}"], ["torch"], "pip install 'minigolf-env[agents]'"),
    ],
)
def test_missing_library_is_reported_in_one_line(
    module: str, arguments: list[str], missing: list[str], hint: str, tmp_path: Path
) -> None:
    """The line has the command that installs the library; no file is written."""
    (tmp_path / "a.zip").touch()
    arguments = [argument.format(zip=tmp_path / "a.zip") for argument in arguments]
    if module.startswith("agents."):
        pytest.importorskip("stable_baselines3")
    program = PROGRAM_WITHOUT_MODULES.format(module=module, arguments=arguments, missing=missing)
    result = python("-c", program, folder=tmp_path, PYTHONPATH=str(ROOT))
    lines = [line for line in result.stderr.splitlines() if "compiling" not in line]
    assert result.returncode == 1 and len(lines) == 1 and hint in lines[0], result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a.zip"]


@pytest.mark.parametrize("arguments", [["play"], ["evaluate", "--watch", "--episodes", "1"]])
def test_missing_display_is_reported_in_one_line(arguments: list[str]) -> None:
    """The line says how to get a virtual display."""
    result = python("-m", "minigolf_env.cli", *arguments, DISPLAY="")
    lines = [line for line in result.stderr.splitlines() if "compiling" not in line]
    assert result.returncode == 2 and len(lines) == 1 and "apt-get install xvfb" in lines[0], result.stderr
