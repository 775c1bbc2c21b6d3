"""The tests on every Python and Gymnasium that is supported, and of what users install: ``make test-all``.

A Python that this machine lacks is left out; those of pyenv are found after ``pyenv shell 3.11 3.12 3.13``.
"""

from __future__ import annotations

import functools
import shutil
from pathlib import Path

import nox

nox.needs_version = ">=2025.5"
nox.options.default_venv_backend = "venv"

PINS = {"1.4": "constraints.txt", "1.2": "constraints-distributed.txt"}
"""The tested versions around each Gymnasium."""

WITH_LEARNING = ("agents", "clients", "distributed", "test_benchmarks.py", "test_notebooks.py")
"""What needs torch, stable-baselines3 or Ray runs where they are installed: make test, make test-distributed."""

WITHOUT_LEARNING = tuple(f"--ignore=tests/{name}" for name in WITH_LEARNING)


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
    for name in ("tests", "agents", "docs", "benchmarks", "notebooks"):
        shutil.copytree(name, folder / name, dirs_exist_ok=True)
    pages = ("README.md", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "SECURITY.md", "mkdocs.yml")
    for name in ("pyproject.toml", "Makefile", "requirements.lock", "sbom.cdx.json", *pages, *PINS.values()):
        shutil.copy(name, folder)
    session.chdir(folder)
    session.run("minigolf", "evaluate", "--policy", "ppo", "--episodes", "10")
    session.run(
        "pytest", *WITHOUT_LEARNING, "--ignore=tests/tools/test_mutations.py", *session.posargs
    )  # Of the sources.
    session.run("pip", "uninstall", "--yes", "minigolf-env")
    session.run(
        "python", "-c", "import importlib.util as u; assert u.find_spec('minigolf_env') is None, 'a rest stays'"
    )


@nox.session(python="3.11")
def reproducible(session: nox.Session) -> None:
    """Build the wheel twice, from two places, at two times: the same bytes."""
    session.install("build")
    folder = Path(session.create_tmp()).resolve()
    wheels = []
    for place in ("here", "there"):
        shutil.rmtree(folder / place, ignore_errors=True)
        session.run("git", "clone", "--quiet", ".", str(folder / place), external=True)
        session.run("python", "-m", "build", "--wheel", "--outdir", str(folder / place / "dist"), str(folder / place))
        wheels += (folder / place / "dist").iterdir()
    first, second = (path.read_bytes() for path in wheels)
    if first != second:
        session.error(f"{wheels[0]} and {wheels[1]} differ.")
    session.log(f"{wheels[0].name}: {len(first):,} bytes, the same twice")


@nox.session(python="3.11", default=False)
def supply(session: nox.Session) -> None:
    """Write anew what says where everything comes from; after every change of constraints.txt."""
    session.install("--constraint", "constraints.txt", "--editable", ".[agents,dev,docs]")
    session.run("python", "-m", "venv", "--clear", tools := str(Path(session.create_tmp()).resolve() / "tools"))
    run = functools.partial(session.run, external=True)
    run(f"{tools}/bin/pip", "install", "--quiet", "uv", "pip-licenses", "cyclonedx-bom")
    extras = [word for extra in ("agents", "dev", "docs") for word in ("--extra", extra)]
    where = ["--constraint", "constraints.txt", *extras, "pyproject.toml"]
    how = [
        "--quiet",
        "--universal",
        "--python-version",
        "3.11.5",
        "--generate-hashes",
        "--no-emit-index-url",
        "--no-header",
        "--no-annotate",
    ]
    run(f"{tools}/bin/uv", "pip", "compile", *how, *where, "--output-file", "requirements.lock")
    bom = ["--output-reproducible", "--pyproject", "pyproject.toml", "--mc-type", "library", "--short-PURLs"]
    run(f"{tools}/bin/cyclonedx-py", "environment", *bom, "--output-file", "sbom.cdx.json", session.virtualenv.location)
    table = ["--format", "markdown", "--from", "mixed", "--with-system", "--ignore-packages", "minigolf-env", "pip"]
    python = str(Path(session.bin) / "python")
    run(f"{tools}/bin/pip-licenses", "--python", python, *table, "--output-file", "docs/licences.md")
