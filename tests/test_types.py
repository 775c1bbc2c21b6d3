"""The package's annotations, as a user's type checker sees them."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

from minigolf_env.envs import MiniGolfEnv, config

ROOT = Path(__file__).parents[1]


def test_mypy_infers_the_types_that_a_users_program_asserts() -> None:
    """A misspelt argument in the program is a type error."""
    command = [sys.executable, "-m", "mypy", "--strict", "--warn-unused-ignores", "tests/data/typed_use.py"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_env_options_lists_all_arguments_and_no_others() -> None:
    """The functions of config.py together take exactly the typed arguments; the class documents each."""
    parameters_taken: set[str] = set()
    for function in (config.build_env_config, config.build_task_sampler, config.build_task):
        parameters = inspect.signature(function).parameters.values()
        parameters_taken |= {p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.default is not p.empty}
    assert parameters_taken == set(config.EnvOptions.__annotations__)
    docstring = str(inspect.getdoc(MiniGolfEnv))
    assert all(f"\n    {name}: " in docstring for name in parameters_taken)
