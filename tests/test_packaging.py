"""Requirements are pinned, imports follow the contracts, and importing the package is cheap."""

import importlib.metadata
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import minigolf_env
from tests.pins import read_pins

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
PINS = {"constraints.txt": ("agents", "dev", "docs"), "constraints-distributed.txt": ("agents", "dev", "distributed")}
REQUIREMENTS = [
    (file, Requirement(line))
    for file, extras in PINS.items()
    for group in (PROJECT["dependencies"], *(EXTRAS[extra] for extra in extras))
    for line in group
]

LAZY_IMPORTS = ("OpenGL", "matplotlib", "pydantic", "pyglet", "shapely", "stable_baselines3", "torch", "trimesh")
"""Libraries that load when they are first used, not with the package."""


@pytest.mark.parametrize(("file", "requirement"), REQUIREMENTS, ids=str)
def test_every_requirement_is_pinned_to_a_version_it_allows(file: str, requirement: Requirement) -> None:
    """The file has a pin for each dependency, inside the bounds of pyproject.toml."""
    pin = read_pins(ROOT / file).get(canonicalize_name(requirement.name))
    assert pin is not None, f"{requirement.name} has no pin: refresh {file} as its first lines say"
    assert requirement.specifier.contains(pin), f"{file} pins {pin}, pyproject.toml asks for {requirement}"


def test_constraints_with_ray_differ_only_in_gymnasium() -> None:
    """The two constraint files pin the same versions of all other packages that are in both."""
    with_ray, without = (read_pins(ROOT / f"constraints{kind}.txt") for kind in ("-distributed", ""))
    assert {name for name in with_ray.keys() & without.keys() if with_ray[name] != without[name]} == {"gymnasium"}


def test_imports_follow_the_contracts() -> None:
    """import-linter finds no violation of the contracts in pyproject.toml."""
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache", "--no-logo"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_importing_the_package_loads_no_heavy_library() -> None:
    """Libraries for rendering, learning and mesh files load when they are first used."""
    code = f"import sys, minigolf_env; print(*sorted(set({LAZY_IMPORTS}) & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert result.stdout.split() == []


def test_installed_version_equals_the_source_version() -> None:
    """The installation's metadata are up to date."""
    installed = importlib.metadata.version("minigolf-env")
    hint = "`touch pyproject.toml` and run make again"
    assert installed == minigolf_env.__version__, f"installed {installed}, source {minigolf_env.__version__}: {hint}"


def test_package_is_typed() -> None:
    """Type checkers of dependent projects read the package's annotations (PEP 561)."""
    assert (Path(minigolf_env.__file__).parent / "py.typed").is_file()


def test_search_is_importable_from_its_stable_path() -> None:
    """``minigolf_env.planning.search`` is the function of ``minigolf_env.players.search``."""
    from minigolf_env import planning
    from minigolf_env.players import search

    assert planning.search is search.search
