"""Some of the episodes of tools/determinism.py, and the law that stored hashes, version and CHANGELOG move together."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minigolf_env.physics import parallel
from tests.physics import golden
from tools import determinism
from tools.determinism import FIRST, ID, KINDS, REMEDY, ROOT, Args, Hashes, digests, feed, line_of, stored

SLOWLY = """
import minigolf_env.physics.vec3 as vec3
from minigolf_env.physics import TriangleMesh, World
from tools.determinism import digests
floor = TriangleMesh([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], [(0, 1, 2), (0, 2, 3)])
hit = World([floor]).sweep((0.3, 0.1, 0.02), (1.3, 0.1, 0.02))  # Along an edge: the kernels divide zero by zero.
assert [type(value) for value in (hit.hit, hit.alpha, hit.triangle)] == [bool, float, int], hit
assert not hasattr(vec3.dot, "py_func"), "compiled"
print(*(digests(kind, 1, 0)[0].hex() for kind in ("dogleg, rays", "hard")))
"""


@pytest.mark.parametrize(("batch", "threads"), [(0, 1), (7, 2)], ids=["alone", "batch"])
@pytest.mark.parametrize("kind", KINDS)
def test_episodes_are_the_same_bits(kind: str, batch: int, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten of each kind: all that is seen of them is what it was when the hashes were stored."""
    if determinism.sines() != stored()[ID]["machine"]["sines"]:
        pytest.skip("the last bits of this machine's sine differ from those of the machine that stored the hashes")
    monkeypatch.setattr(parallel, "_number", lambda: threads)
    assert determinism.together(digests(kind, FIRST, batch)) == stored()[ID]["first"][kind], REMEDY


def test_without_machine_code_bits_are_the_same() -> None:
    """With NUMBA_DISABLE_JIT=1 Python runs the physics, for those who debug it: no warning, plain numbers."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-W", "error", "-c", SLOWLY]
    done = subprocess.run(command, cwd=ROOT, env=environment, text=True, capture_output=True, check=True)
    assert done.stdout.split() == [digests(kind, 1, 0)[0].hex() for kind in ("dogleg, rays", "hard")]


def test_the_version_of_today_is_stored_and_changelog_names_each() -> None:
    """Whoever changes a hash has to say so in CHANGELOG.md."""
    changes = (ROOT / "CHANGELOG.md").read_text()
    assert ID in stored(), f"{ID} has no hashes: python -m tools.determinism --write"
    for version, hashes in stored().items():
        assert line_of(version, hashes) in changes, f"CHANGELOG.md must say: {line_of(version, hashes)}"
    assert set(stored()[ID]["golden"]) == set(golden.SCENES)
    assert set(stored()[ID]["first"]) == set(stored()[ID]["all"]) == set(KINDS)


def test_a_hash_tells_values_apart() -> None:
    """By type, shape, order, and in the last bit."""
    values: list[Any] = [0.0, -0.0, np.nextafter(0.0, 1.0), 0, False, None, "", [], ["a", "b"], ["ab"], [["a"], "b"]]
    values += [np.zeros(2), np.zeros(2, np.float32), np.zeros((2, 1)), {"a": 1}, {"a": 2}, {"b": 1}]

    def digest(value: Any) -> bytes:
        found = hashlib.sha256()
        feed(found, value)
        return found.digest()

    assert len({digest(value) for value in values}) == len(values)
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1}) and digest(np.float64(0.5)) == digest(0.5)


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Hashes, str], None]:
    """Return what makes a repository in which each way to play finds certain hashes, with a CHANGELOG.md."""
    monkeypatch.setattr(determinism, "ROOT", tmp_path)
    monkeypatch.setattr(determinism, "STORED", tmp_path / "hashes.json")

    def change(found: Hashes, changes: str) -> None:
        monkeypatch.setattr(determinism, "ask", lambda batch, threads: found)
        (tmp_path / "CHANGELOG.md").write_text(changes)

    return change


def test_hashes_of_a_released_version_stay(
    house: Callable[[Hashes, str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    """What differs is named; it is written anew only as long as no release has had the version."""
    old, new = {"first": {"dogleg": "1"}}, {"first": {"dogleg": "2"}}
    draft = f"# Changelog\n\n## [Unreleased]\n\n- {line_of(ID, old)}\n"
    for found in (old, new, old):
        house(found, draft)
        assert determinism.main(Args(write=True)) == 0 == determinism.main(Args())
        assert line_of(ID, found) in capsys.readouterr().out and stored() == {ID: found}
    house(new, draft)
    assert determinism.main(Args()) == 1 and "first 'dogleg'" in capsys.readouterr().out
    house(new, draft.replace("Unreleased]", "Unreleased]\n\n## [9.0.0]"))
    assert determinism.main(Args(write=True)) == 1 and "raise the version" in capsys.readouterr().out
    assert stored() == {ID: old} == json.loads(determinism.STORED.read_text())
    house(old, draft.replace("Unreleased]", "Unreleased]\n\n## [9.0.0]"))
    assert determinism.main(Args(write=True)) == 0


def test_nothing_is_stored_if_ways_to_play_differ(
    house: Callable[[Hashes, str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A batch of another hash than the single environment's is an error."""
    house({}, "")
    monkeypatch.setattr(determinism, "ask", lambda batch, threads: {"first": {"dogleg": str(batch)}})
    assert determinism.main(Args(write=True)) == 1 and not determinism.STORED.exists()
