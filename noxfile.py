"""The tests on every Python and Gymnasium that is supported, and of what users install: ``make test-all``.

A Python that this machine lacks is left out; those of pyenv are found after ``pyenv shell 3.11 3.12 3.13``.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import nox

nox.needs_version = ">=2025.5"
nox.options.default_venv_backend = "venv"

PINS = {"1.4": "constraints.txt", "1.2": "constraints-distributed.txt"}
"""The tested versions around each Gymnasium."""

WITHOUT_LEARNING = ("--ignore=tests/agents", "--ignore=tests/distributed", "--ignore=tests/test_benchmarks.py")
"""What needs torch, stable-baselines3 or Ray runs where they are installed: make test, make test-distributed."""


@nox.session(python=["3.11", "3.12", "3.13"])
@nox.parametrize("gymnasium", list(PINS))
def core(session: nox.Session, gymnasium: str) -> None:
    """Test the environment, the physics, the pictures and the command."""
    session.install("--constraint", PINS[gymnasium], "--editable", ".[dev]")
    session.run("pytest", *WITHOUT_LEARNING, *session.posargs)


@nox.session(python="3.11")
@nox.parametrize("kind", ["wheel", "sdist"])
def package(session: nox.Session, kind: str) -> None:
    """Test what users install: built, then installed where no checkout is near."""
    folder = Path(session.create_tmp()).resolve()
    shutil.rmtree(folder / "dist", ignore_errors=True)
    session.install("build")
    session.run("python", "-m", "build", f"--{kind}", "--outdir", str(folder / "dist"))
    (built,) = (folder / "dist").iterdir()
    session.install("--constraint", "constraints.txt", "--force-reinstall", f"{built}[dev]")
    for name in ("tests", "agents", "docs", "benchmarks"):
        shutil.copytree(name, folder / name, dirs_exist_ok=True)
    for name in ("pyproject.toml", "README.md", "CHANGELOG.md", *PINS.values()):
        shutil.copy(name, folder)
    session.chdir(folder)
    session.run("minigolf", "evaluate", "--policy", "ppo", "--episodes", "10")
    session.run("pytest", *WITHOUT_LEARNING, *session.posargs)
