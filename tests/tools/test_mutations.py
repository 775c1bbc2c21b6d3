"""The list of mutations is in step with the package."""

import shutil
from pathlib import Path

import pytest

from tools.mutation.mutations import MUTATIONS, PHYSICS, ROOT, TESTS, Mutation, apply


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.name)
def test_every_mutation_finds_its_text(mutation: Mutation, tmp_path: Path) -> None:
    """Each text to replace is in its file exactly once, and what takes its place is Python."""
    package = shutil.copytree(PHYSICS, tmp_path / "physics")
    apply(mutation, package)
    for change in (mutation, *mutation.also):
        compile((package / change.file).read_text(), change.file, "exec")


def test_a_text_that_is_gone_is_an_error(tmp_path: Path) -> None:
    """A mutation that would change nothing, or two places, is refused with its name."""
    package = shutil.copytree(PHYSICS, tmp_path / "physics")
    for old in ("no such text", "return"):
        with pytest.raises(ValueError, match=r"'stale': expected once in sweep.py, found \d+ times"):
            apply(Mutation("stale", "sweep.py", old, ""), package)


def test_tests_to_run_exist() -> None:
    """The files of tests that judge mutations are there."""
    assert all((ROOT / name.split("::")[0]).is_file() for name in TESTS)
