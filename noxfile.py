"""Sessions that need separate environments: tests with other versions, and the release files.

``make test-all`` runs the tests, ``make release`` writes the release files. Without a Python, its sessions are
skipped; those of pyenv are found after ``pyenv shell 3.11 3.12 3.13``.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import nox

nox.needs_version = ">=2025.5"
nox.options.default_venv_backend = "venv"

CONSTRAINTS_FILES = {"1.4": "constraints.txt", "1.2": "constraints-distributed.txt"}
"""File of the tested versions, for each Gymnasium."""

LEARNING_TESTS = ("agents", "clients", "distributed", "test_benchmarks.py", "test_notebooks.py")
"""Tests that need torch, stable-baselines3 or Ray; ``make test`` and ``make test-distributed`` run them."""

PINNED_EXTRAS = ("agents", "dev", "docs")
"""Extras whose packages constraints.txt pins."""

LOCK_FILE = "requirements.lock"
"""Name of the lock file in dist/."""

IGNORE_LEARNING_TESTS = tuple(f"--ignore=tests/{name}" for name in LEARNING_TESTS)


@nox.session(python=["3.11", "3.12", "3.13"])
@nox.parametrize("gymnasium", list(CONSTRAINTS_FILES))
def core(session: nox.Session, gymnasium: str) -> None:
    """Test all but the training programs."""
    session.install("--constraint", CONSTRAINTS_FILES[gymnasium], "--editable", ".[dev]")
    session.run("pytest", *IGNORE_LEARNING_TESTS, *session.posargs)


@nox.session(python="3.11")
@nox.parametrize("kind", ["wheel", "sdist"])
def package(session: nox.Session, kind: str) -> None:
    """Build the package, install it, and run the tests in a folder without a checkout."""
    folder = Path(session.create_tmp()).resolve()
    shutil.rmtree(folder / "dist", ignore_errors=True)
    session.install("build")
    session.run("python", "-m", "build", f"--{kind}", "--outdir", str(folder / "dist"))
    (built,) = (folder / "dist").iterdir()
    session.install("--constraint", "constraints.txt", "--force-reinstall", f"{built}[dev]")
    for name in ("tests", "tools", "agents", "docs", "benchmarks", "notebooks"):
        shutil.copytree(name, folder / name, dirs_exist_ok=True)
    pages = ("README.md", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "SECURITY.md", "mkdocs.yml")
    for name in ("pyproject.toml", "Makefile", *pages, *CONSTRAINTS_FILES.values()):
        shutil.copy(name, folder)
    session.chdir(folder)
    session.run("minigolf", "evaluate", "--policy", "ppo", "--episodes", "10")
    session.run(
        "pytest", *IGNORE_LEARNING_TESTS, "--ignore=tests/tools", *session.posargs
    )  # tests/tools mutates the sources.
    session.run("pip", "uninstall", "--yes", "minigolf-env")
    session.run(
        "python", "-c", "import importlib.util as u; assert u.find_spec('minigolf_env') is None, 'files are left over'"
    )


@nox.session(python="3.11", default=False)
def release(session: nox.Session) -> None:
    """Write the release files into dist/: sdist and wheel, lock file with hashes, bill of materials.

    The wheel is built in two folders and must have the same bytes.
    """
    dist = Path("dist").resolve()
    shutil.rmtree(dist, ignore_errors=True)
    session.install("build", "uv", "cyclonedx-bom")
    session.run("python", "-m", "build", "--outdir", str(dist))
    clone = Path(session.create_tmp()).resolve() / "clone"
    shutil.rmtree(clone, ignore_errors=True)
    session.run("git", "clone", "--quiet", ".", str(clone), external=True)
    session.run("python", "-m", "build", "--wheel", "--outdir", str(clone / "dist"), str(clone))
    ((first,), (second,)) = (list(folder.glob("*.whl")) for folder in (dist, clone / "dist"))
    if first.read_bytes() != second.read_bytes():
        session.error(f"{first} and {second} differ: commit all changes, or find what depends on time or place.")
    extras = [word for extra in PINNED_EXTRAS for word in ("--extra", extra)]
    options = ["--universal", "--python-version", "3.11.5", "--generate-hashes", "--no-emit-index-url", "--no-header"]
    lock = ["--constraint", "constraints.txt", *extras, "pyproject.toml", "--output-file", str(dist / LOCK_FILE)]
    session.run("uv", "pip", "compile", "--quiet", "--no-annotate", *options, *lock)
    check_lock((dist / LOCK_FILE).read_text())
    tested = Path(session.create_tmp()).resolve() / "tested"
    session.run("python", "-m", "venv", "--clear", str(tested))
    target = f".[{','.join(PINNED_EXTRAS)}]"
    session.run(f"{tested}/bin/pip", "install", "--quiet", "--constraint", "constraints.txt", target, external=True)
    bom = ["--output-reproducible", "--pyproject", "pyproject.toml", "--mc-type", "library", "--short-PURLs"]
    session.run("cyclonedx-py", "environment", *bom, "--output-file", str(dist / "sbom.cdx.json"), str(tested))
    session.log(f"{first.name}: {first.stat().st_size:,} bytes, the same twice")


def check_lock(text: str) -> None:
    """Raise a ValueError unless a lock file has every pin of constraints.txt, hashes, and no address of a mirror."""
    entries = re.split(r"^(?=\w)", text, flags=re.MULTILINE)[1:]
    locked = {re.split(r"[ ;\\]", entry)[0].lower().replace("_", "-") for entry in entries}
    pins = re.findall(r"^[\w.-]+==\S+", Path("constraints.txt").read_text(), flags=re.MULTILINE)
    missing = {pin.lower().replace("_", "-") for pin in pins} - locked
    if missing or not all("--hash=sha256:" in entry for entry in entries) or "://" in text:
        raise ValueError(f"{LOCK_FILE}: expected all pins with hashes and no addresses; missing: {sorted(missing)}")


@nox.session(python="3.11", default=False)
def licences(session: nox.Session) -> None:
    """Write docs/licences.md, after a change of constraints.txt."""
    session.install("--constraint", "constraints.txt", "--editable", f".[{','.join(PINNED_EXTRAS)}]")
    session.run("python", "-m", "venv", "--clear", tools := str(Path(session.create_tmp()).resolve() / "tools"))
    session.run(f"{tools}/bin/pip", "install", "--quiet", "pip-licenses", external=True)
    table = ["--format", "markdown", "--from", "mixed", "--with-system", "--ignore-packages", "minigolf-env", "pip"]
    python = str(Path(session.bin) / "python")
    page = ["--output-file", "docs/licences.md"]
    session.run(f"{tools}/bin/pip-licenses", "--python", python, *table, *page, external=True)
