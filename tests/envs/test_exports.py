"""Names that the package exports lazily."""

from __future__ import annotations

import subprocess
import sys

import pytest

import minigolf_env
import minigolf_env.courses
import minigolf_env.envs
import minigolf_env.physics


def test_exported_names_are_those_of_their_packages() -> None:
    """Every name of __all__ can be imported, and dir() shows it."""
    packages = (minigolf_env.courses, minigolf_env.envs, minigolf_env.physics)
    for name in set(minigolf_env.__all__) - {"__version__"}:
        owners = [package for package in packages if name in package.__all__]
        assert len(owners) == 1 and getattr(minigolf_env, name) is getattr(owners[0], name)
        assert name in dir(minigolf_env)


def test_unknown_name_is_an_attribute_error() -> None:
    """An unknown name raises the errors of any module."""
    with pytest.raises(AttributeError, match="module 'minigolf_env' has no attribute 'MiniGolf'"):
        minigolf_env.MiniGolf  # noqa: B018
    with pytest.raises(ImportError, match="MiniGolf"):
        exec("from minigolf_env import MiniGolf", {})  # noqa: S102 (our own line)


def test_importing_the_package_registers_and_loads_no_more() -> None:
    """Importing the package loads neither its subpackages nor numba, which take seconds."""
    code = (
        "import sys, gymnasium, minigolf_env; assert 'MiniGolf-v0' in gymnasium.registry; dir(minigolf_env); "
        "heavy = ('minigolf_env.', 'numba', 'OpenGL', 'pyglet', 'torch'); "
        "print([name for name in sys.modules if name.startswith(heavy)])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
