"""Episodes have the bits whose hashes are stored, and stored hashes, version and CHANGELOG.md agree.

tools/determinism.py plays more of the same episodes.
"""

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

from minigolf_env.physics import thread_pool
from tests.physics import golden
from tools import determinism
from tools.determinism import (
    ENV_ID,
    EPISODE_KINDS,
    HINT,
    ROOT,
    TESTED_EPISODES,
    Args,
    Hashes,
    changelog_line,
    combine_digests,
    episode_digests,
    hash_math_functions,
    load_stored_hashes,
    update_digest,
)

UNCOMPILED_PROGRAM = """
import minigolf_env.physics.vec3 as vec3
from minigolf_env.physics import TriangleMesh, World
from tools.determinism import episode_digests
floor = TriangleMesh([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], [(0, 1, 2), (0, 2, 3)])
hit = World([floor]).sweep((0.3, 0.1, 0.02), (1.3, 0.1, 0.02))  # Along an edge the kernels divide zero by zero.
assert [type(value) for value in (hit.hit, hit.alpha, hit.triangle)] == [bool, float, int], hit
assert not hasattr(vec3.dot, "py_func"), "compiled"
print(*(episode_digests(kind, 1, 0)[0].hex() for kind in ("dogleg, rays", "hard")))
"""


@pytest.mark.parametrize(("batch", "threads"), [(0, 1), (7, 2)], ids=["single", "batch"])
@pytest.mark.parametrize("kind", EPISODE_KINDS)
def test_episodes_have_the_stored_hashes(kind: str, batch: int, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten episodes of each kind: all observations, rewards, infos and states are as when the hashes were stored."""
    stored = load_stored_hashes()[ENV_ID]
    if hash_math_functions() != stored["machine"]["sines"]:
        pytest.skip("the last bits of this machine's sine differ from those of the machine that stored the hashes")
    monkeypatch.setattr(thread_pool, "_num_threads", lambda: threads)
    assert combine_digests(episode_digests(kind, TESTED_EPISODES, batch)) == stored["first"][kind], HINT


def test_uncompiled_physics_gives_the_same_bits() -> None:
    """With NUMBA_DISABLE_JIT=1, for debugging, Python runs the physics without a warning and returns plain numbers."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-W", "error", "-c", UNCOMPILED_PROGRAM]
    done = subprocess.run(command, cwd=ROOT, env=environment, text=True, capture_output=True, check=True)
    assert done.stdout.split() == [episode_digests(kind, 1, 0)[0].hex() for kind in ("dogleg, rays", "hard")]


def test_changelog_states_the_hashes_of_each_version() -> None:
    """A changed hash has to be explained in CHANGELOG.md; the newest version has hashes of all scenes and kinds."""
    changelog = (ROOT / "CHANGELOG.md").read_text()
    stored = load_stored_hashes()
    assert ENV_ID in stored, f"{ENV_ID} has no hashes: python -m tools.determinism --write"
    for version, hashes in stored.items():
        assert changelog_line(version, hashes) in changelog, (
            f"CHANGELOG.md must contain: {changelog_line(version, hashes)}"
        )
    assert set(stored[ENV_ID]["golden"]) == set(golden.SCENES)
    assert set(stored[ENV_ID]["first"]) == set(stored[ENV_ID]["all"]) == set(EPISODE_KINDS)


def test_different_values_have_different_hashes() -> None:
    """Type, shape, order and the last bit matter; the order of a dict's keys and numpy's scalar types do not."""
    values: list[Any] = [0.0, -0.0, np.nextafter(0.0, 1.0), 0, False, None, "", [], ["a", "b"], ["ab"], [["a"], "b"]]
    values += [np.zeros(2), np.zeros(2, np.float32), np.zeros((2, 1)), {"a": 1}, {"a": 2}, {"b": 1}]

    def digest(value: Any) -> bytes:
        sha256 = hashlib.sha256()
        update_digest(sha256, value)
        return sha256.digest()

    assert len({digest(value) for value in values}) == len(values)
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert digest(np.float64(0.5)) == digest(0.5)


SetUp = Callable[[Hashes, str], None]


@pytest.fixture
def set_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SetUp:
    """Return a function that sets the hashes that all configurations compute, and the text of CHANGELOG.md."""
    monkeypatch.setattr(determinism, "ROOT", tmp_path)
    monkeypatch.setattr(determinism, "HASHES_FILE", tmp_path / "hashes.json")

    def set_up(hashes: Hashes, changelog: str) -> None:
        monkeypatch.setattr(determinism, "run_in_subprocess", lambda batch, threads: hashes)
        (tmp_path / "CHANGELOG.md").write_text(changelog)

    return set_up


def test_hashes_of_a_released_version_cannot_be_replaced(set_up: SetUp, capsys: pytest.CaptureFixture[str]) -> None:
    """Differences are named; hashes are replaced only as long as no release has had the version."""
    old = {"first": {"dogleg": "1"}}
    new = {"first": {"dogleg": "2"}}
    unreleased = f"# Changelog\n\n## [Unreleased]\n\n- {changelog_line(ENV_ID, old)}\n"
    released = unreleased.replace("Unreleased]", "Unreleased]\n\n## [9.0.0]")
    for hashes in (old, new, old):
        set_up(hashes, unreleased)
        assert determinism.main(Args(write=True)) == 0 == determinism.main(Args())
        assert changelog_line(ENV_ID, hashes) in capsys.readouterr().out
        assert load_stored_hashes() == {ENV_ID: hashes}
    set_up(new, unreleased)
    assert determinism.main(Args()) == 1
    assert "first 'dogleg'" in capsys.readouterr().out
    set_up(new, released)
    assert determinism.main(Args(write=True)) == 1
    assert "raise the version" in capsys.readouterr().out
    assert load_stored_hashes() == {ENV_ID: old} == json.loads(determinism.HASHES_FILE.read_text())
    set_up(old, released)
    assert determinism.main(Args(write=True)) == 0


def test_nothing_is_stored_if_configurations_differ(set_up: SetUp, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hash that depends on the batch size is an error."""
    set_up({}, "")
    monkeypatch.setattr(determinism, "run_in_subprocess", lambda batch, threads: {"first": {"dogleg": str(batch)}})
    assert determinism.main(Args(write=True)) == 1
    assert not determinism.HASHES_FILE.exists()
