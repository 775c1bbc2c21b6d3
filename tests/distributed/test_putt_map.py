"""A map of putts that is played on two nodes."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents import putt_map
from minigolf_env.envs.task import Result
from minigolf_env.maps import simulate

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")


@pytest.fixture
def args(cluster: Any, tmp_path: Path) -> putt_map.Args:
    """Return a map of five files, the last of them smaller."""
    return putt_map.Args(directions=90, speeds=20, shard=400, cell=0.1, out=tmp_path / "map", address=cluster.address)


def test_it_is_the_map_of_one_process_after_an_interruption_too(
    args: putt_map.Args, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit for bit; what was there is not played again."""
    assert args.out is not None
    save = putt_map.save

    def interrupt(path: Path, arrays: putt_map.Arrays) -> None:
        if len(list(path.parent.glob("putts-*.npz"))) == 2:
            raise KeyboardInterrupt
        save(path, arrays)

    with monkeypatch.context() as patched:
        patched.setattr(putt_map, "save", interrupt)
        with pytest.raises(SystemExit, match="same command"):
            putt_map.main(args)
    before = {file: file.stat().st_mtime_ns for file in args.out.glob("putts-*.npz")}
    assert len(before) == 2
    merged = putt_map.main(args)
    assert {file: file.stat().st_mtime_ns for file in before} == before
    files = [np.load(putt_map.file_of(args.out, among)) for among in putt_map.shards(args)]
    assert len(files) == 5
    local = simulate(args.course, directions=args.directions, speeds=args.speeds).outcome
    for name, expected in (("result", local.result.astype(np.uint8)), ("position", local.position.astype(np.float32))):
        assert np.concatenate([file[name] for file in files]).tobytes() == expected.tobytes()
    assert merged["counts"].tolist() == np.bincount(local.result.ravel(), minlength=len(Result)).tolist()
    assert merged["heat"].sum() == merged["counts"][Result.REST]
    assert (args.out / "map.png").read_bytes()[:4] == b"\x89PNG"


def test_another_map_is_not_mixed_in(args: putt_map.Args) -> None:
    """A folder is of one grid on one course."""
    putt_map.claim(args, putt_map.load_course("dogleg"), args.out or Path())
    with pytest.raises(SystemExit, match="another speeds"):
        putt_map.main(dataclasses.replace(args, speeds=21))
    with pytest.raises(SystemExit, match="another course, shape"):
        putt_map.main(dataclasses.replace(args, course="straight"))


@pytest.mark.parametrize("mistake", [{"tee": (3.3, 1.5)}, {"course": "dogle"}, {"speeds": 0}], ids=str)
def test_a_users_mistake_ends_with_one_line(args: putt_map.Args, mistake: dict[str, Any]) -> None:
    """Before anything is sent to the cluster."""
    with pytest.raises(SystemExit, match="expected"):
        putt_map.main(dataclasses.replace(args, **mistake))
