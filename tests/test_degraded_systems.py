"""Machines that lack something: the package works, or one line says what to do."""

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

WITHOUT = """
import importlib.machinery, runpy, sys

class Poor(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name in {missing!r} else super().find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(importlib.machinery.PathFinder)] = Poor
sys.argv = ["-m", *{words!r}]
runpy.run_module({module!r}, run_name="__main__", alter_sys=True)
"""


def python(*words: str, folder: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own, with environment variables added."""
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_where_nothing_can_be_written_a_warning_says_so(tmp_path: Path) -> None:
    """Neither beside the package's files nor at home: it plays the same, after compiling, which is what is told."""
    package = tmp_path / "site" / "minigolf_env"
    shutil.copytree(Path(minigolf_env.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [package, *(path for path in package.rglob("*") if path.is_dir())]:
        (folder / "__pycache__").touch()  # Where a file is no folder can be made, whoever asks.
    nowhere = {name: "/dev/null" for name in ("HOME", "XDG_CACHE_HOME", "XDG_DATA_HOME")}
    poor = python("-c", EPISODE, folder=package.parent, NUMBA_CACHE_DIR="", **nowhere)
    assert poor.returncode == 0, poor.stderr
    assert poor.stderr.count("NUMBA_CACHE_DIR") == 1 and "Traceback" not in poor.stderr
    assert poor.stdout == python("-c", EPISODE).stdout


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores can be taken away on Linux alone")
def test_one_core_gives_the_same_bits() -> None:
    """Threads have nothing to share then."""
    few = python("-c", f"import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n{BATCH}")
    assert few.returncode == 0, few.stderr
    assert few.stdout == python("-c", BATCH).stdout


@pytest.mark.parametrize(
    ("module", "words", "missing", "hint"),
    [
        ("agents.train_ppo", [], ["torch"], 'pip install -c constraints.txt -e ".[agents]"'),
        ("agents.train_ppo", [], ["stable_baselines3"], 'pip install -c constraints.txt -e ".[agents]"'),
        ("agents.train_rllib", [], ["ray"], 'pip install -c constraints-distributed.txt -e ".[agents,distributed]"'),
        ("minigolf_env.cli", ["evaluate", "--policy", "{zip}"], ["torch"], "pip install 'minigolf-env[agents]'"),
    ],
)
def test_a_missing_library_is_one_line(
    module: str, words: list[str], missing: list[str], hint: str, tmp_path: Path
) -> None:
    """It names the command that installs it."""
    (tmp_path / "a.zip").touch()
    words = [word.format(zip=tmp_path / "a.zip") for word in words]
    if module.startswith("agents."):
        pytest.importorskip("stable_baselines3")
    program = WITHOUT.format(module=module, words=words, missing=missing)
    poor = python("-c", program, folder=tmp_path, PYTHONPATH=str(ROOT))
    said = [line for line in poor.stderr.splitlines() if "compiling" not in line]
    assert poor.returncode == 1 and len(said) == 1 and hint in said[0], poor.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a.zip"]


@pytest.mark.parametrize("words", [["play"], ["evaluate", "--watch", "--episodes", "1"]])
def test_without_a_display_a_line_says_what_to_do(words: list[str]) -> None:
    """Windows need one; pictures do not."""
    poor = python("-m", "minigolf_env.cli", *words, DISPLAY="")
    said = [line for line in poor.stderr.splitlines() if "compiling" not in line]
    assert poor.returncode == 2 and len(said) == 1 and "apt-get install xvfb" in said[0], poor.stderr
