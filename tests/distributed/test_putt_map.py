"""A map of putts that is played on two nodes."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents import putt_map
from minigolf_env.apps.putt_map import simulate_putts
from minigolf_env.envs.task import Result
from minigolf_env.physics import TriangleMesh

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
    local = simulate_putts(args.course, directions=args.directions, speeds=args.speeds).outcome
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


@pytest.mark.parametrize("what", ["top_speed", "ball_radius", "gravity", "bounds", "tee", "cup", "surfaces"])
def test_a_course_that_has_changed_is_not_mixed_in(what: str, tmp_path: Path) -> None:
    """Whatever of it putts depend on."""
    args, course = putt_map.Args(), putt_map.load_course("dogleg")
    lower, upper = course.bounds
    (lane, *others), cup = course.parts, course.cup
    assert cup is not None
    slow = dataclasses.replace(lane.mesh.surface, rolling=0.5)
    slower = TriangleMesh(lane.mesh.vertices, lane.mesh.faces, slow)
    changes: dict[str, dict[str, Any]] = {
        "top_speed": {"top_speed": course.top_speed / 2},
        "ball_radius": {"ball_radius": 0.02},
        "gravity": {"gravity": (0.0, 0.0, -1.62)},
        "bounds": {"bounds": (lower, (upper[0], upper[1], upper[2] + 1.0))},
        "tee": {"tee": dataclasses.replace(course.tee, height=0.01)},
        "cup": {"cup": dataclasses.replace(cup, radius=0.06)},
        "surfaces": {"parts": (dataclasses.replace(lane, mesh=slower), *others)},
    }
    putt_map.claim(args, course, tmp_path)
    putt_map.claim(args, putt_map.load_course("dogleg"), tmp_path)
    with pytest.raises(SystemExit, match=f"with another {what};"):
        putt_map.claim(args, dataclasses.replace(course, **changes[what]), tmp_path)


@pytest.mark.parametrize(
    "mistake", [{"tee": (3.3, 1.5)}, {"course": "dogle"}, {"speeds": 0}, {"out": Path("/dev/null/map")}], ids=str
)
def test_a_users_mistake_ends_with_one_line(args: putt_map.Args, mistake: dict[str, Any]) -> None:
    """Before anything is sent to the cluster."""
    with pytest.raises(SystemExit, match="expected"):
        putt_map.main(dataclasses.replace(args, **mistake))
