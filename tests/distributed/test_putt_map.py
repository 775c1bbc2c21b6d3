"""A putt map that is simulated on two nodes."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents import putt_map
from agents.putt_map import PuttMapConfig, create_or_check_folder, shard_path, shard_ranges
from minigolf_env.apps.putt_map import simulate_putts
from minigolf_env.envs.task import Result
from minigolf_env.physics import TriangleMesh

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")


@pytest.fixture
def config(cluster: Any, tmp_path: Path) -> PuttMapConfig:
    """Return a map of five files, the last of them smaller."""
    return PuttMapConfig(
        directions=90, speeds=20, shard_size=400, cell_size=0.1, out=tmp_path / "map", address=cluster.address
    )


def test_interrupted_map_equals_map_of_one_process_bitwise(
    config: PuttMapConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After an interruption the same command simulates only the missing files."""
    assert config.out is not None
    save_arrays = putt_map.save_arrays

    def interrupt(path: Path, arrays: putt_map.Arrays) -> None:
        if len(list(path.parent.glob("putts-*.npz"))) == 2:
            raise KeyboardInterrupt
        save_arrays(path, arrays)

    with monkeypatch.context() as patched:
        patched.setattr(putt_map, "save_arrays", interrupt)
        with pytest.raises(SystemExit, match="same command"):
            putt_map.main(config)
    before = {file: file.stat().st_mtime_ns for file in config.out.glob("putts-*.npz")}
    assert len(before) == 2
    merged = putt_map.main(config)
    assert {file: file.stat().st_mtime_ns for file in before} == before
    files = [np.load(shard_path(config.out, shard)) for shard in shard_ranges(config)]
    assert len(files) == 5
    local = simulate_putts(config.course, directions=config.directions, speeds=config.speeds).outcome
    for name, expected in (("result", local.result.astype(np.uint8)), ("position", local.position.astype(np.float32))):
        assert np.concatenate([file[name] for file in files]).tobytes() == expected.tobytes()
    assert merged["counts"].tolist() == np.bincount(local.result.ravel(), minlength=len(Result)).tolist()
    assert merged["heat"].sum() == merged["counts"][Result.REST]
    assert (config.out / "map.png").read_bytes()[:4] == b"\x89PNG"


def test_rejects_folder_of_another_map(config: PuttMapConfig) -> None:
    """A folder has the putts of one grid on one course."""
    create_or_check_folder(config, putt_map.load_course("dogleg"), config.out or Path())
    with pytest.raises(SystemExit, match="another speeds"):
        putt_map.main(dataclasses.replace(config, speeds=21))
    with pytest.raises(SystemExit, match="another course, shape"):
        putt_map.main(dataclasses.replace(config, course="straight"))


@pytest.mark.parametrize("what", ["top_speed", "ball_radius", "gravity", "bounds", "tee", "cup", "surfaces"])
def test_rejects_folder_of_changed_course(what: str, tmp_path: Path) -> None:
    """Every property of a course that putts depend on is compared."""
    config = PuttMapConfig()
    course = putt_map.load_course("dogleg")
    lower, upper = course.bounds
    lane, *other_parts = course.parts
    cup = course.cup
    assert cup is not None
    slow_surface = dataclasses.replace(lane.mesh.surface, rolling=0.5)
    slow_mesh = TriangleMesh(lane.mesh.vertices, lane.mesh.faces, slow_surface)
    changes: dict[str, dict[str, Any]] = {
        "top_speed": {"top_speed": course.top_speed / 2},
        "ball_radius": {"ball_radius": 0.02},
        "gravity": {"gravity": (0.0, 0.0, -1.62)},
        "bounds": {"bounds": (lower, (upper[0], upper[1], upper[2] + 1.0))},
        "tee": {"tee": dataclasses.replace(course.tee, height=0.01)},
        "cup": {"cup": dataclasses.replace(cup, radius=0.06)},
        "surfaces": {"parts": (dataclasses.replace(lane, mesh=slow_mesh), *other_parts)},
    }
    create_or_check_folder(config, course, tmp_path)
    create_or_check_folder(config, putt_map.load_course("dogleg"), tmp_path)
    with pytest.raises(SystemExit, match=f"with another {what};"):
        create_or_check_folder(config, dataclasses.replace(course, **changes[what]), tmp_path)


@pytest.mark.parametrize(
    "invalid", [{"tee": (3.3, 1.5)}, {"course": "dogle"}, {"speeds": 0}, {"out": Path("/dev/null/map")}], ids=str
)
def test_invalid_arguments_end_with_one_line(config: PuttMapConfig, invalid: dict[str, Any]) -> None:
    """Arguments are checked before anything is sent to the cluster."""
    with pytest.raises(SystemExit, match="expected"):
        putt_map.main(dataclasses.replace(config, **invalid))
