"""What a user's type checker sees."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs import config as door

ROOT = Path(__file__).parents[1]


def test_a_users_program_has_the_types_it_expects() -> None:
    """What mypy infers is asserted in the program; a misspelt argument is an error there."""
    command = [sys.executable, "-m", "mypy", "--strict", "--warn-unused-ignores", "tests/data/typed_use.py"]
    got = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert got.returncode == 0, got.stdout + got.stderr


def test_the_typed_arguments_are_those_that_are_taken() -> None:
    """Each function behind the door takes some of them, with a default; together they take all, and no others."""
    taken: set[str] = set()
    for function in (door.build_env_config, door.build_task_sampler, door.build_task):
        parameters = inspect.signature(function).parameters.values()
        taken |= {p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.default is not p.empty}
    assert taken == set(door.EnvOptions.__annotations__)
    told = str(inspect.getdoc(MiniGolfEnv))
    assert all(f"\n    {name}: " in told for name in taken)
