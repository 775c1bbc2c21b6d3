"""Arguments and stored files that no program can use: one line, and nothing is made or changed."""

from __future__ import annotations

import dataclasses
import io
import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from agents import putt_map, release_model, train_generalist, train_pixels, train_ppo
from agents.putt_map import PuttMapConfig, create_or_check_folder, merge_shards, shard_path, shard_ranges
from agents.release_model import ReleaseConfig
from agents.train_generalist import GeneralistConfig
from agents.train_pixels import PixelsConfig
from agents.train_ppo import PPOConfig
from agents.training_run import create_run_folder

TINY_PPO = PPOConfig(
    total_timesteps=64,
    n_envs=16,
    n_steps=2,
    batch_size=32,
    eval_freq=32,
    n_eval_episodes=1,
    n_test_episodes=1,
    n_search_episodes=0,
    net_arch=(4,),
)
TINY_GENERALIST = GeneralistConfig(
    difficulties=("easy",),
    total_timesteps=64,
    n_envs=2,
    num_candidates=4,
    buffer_size=100,
    batch_size=8,
    net_arch=(4,),
    eval_freq=32,
    n_eval_episodes=1,
    n_test_episodes=1,
    n_search_episodes=0,
)
TINY_MAP = PuttMapConfig(directions=4, speeds=2)


def one_line(program: Callable[[Any], object], config: Any) -> str:
    """Return the line with which a program ends."""
    with pytest.raises(SystemExit) as stop:
        program(config)
    assert isinstance(stop.value.code, str) and "\n" not in stop.value.code
    return stop.value.code


@pytest.mark.parametrize(
    ("program", "config", "message"),
    [
        (train_ppo.main, dataclasses.replace(TINY_PPO, n_envs=1, n_steps=1), "must be greater than 1"),
        (train_ppo.main, dataclasses.replace(TINY_PPO, n_envs=10**30), "n_envs: expected"),
        (train_ppo.main, dataclasses.replace(TINY_PPO, learning_rate=1e300), "learning_rate: expected"),
        (train_ppo.main, dataclasses.replace(TINY_PPO, n_test_episodes=1_000_001), "n_test_episodes: expected"),
        (train_pixels.main, PixelsConfig(observation="state"), "observation: expected"),
        (train_generalist.main, dataclasses.replace(TINY_GENERALIST, difficulties=()), "difficulties: expected"),
        (train_generalist.main, dataclasses.replace(TINY_GENERALIST, replay_ratio=1e300), "replay_ratio: expected"),
    ],
)
def test_arguments_without_a_model_leave_no_folder(
    program: Callable[[Any], object], config: Any, message: str, tmp_path: Path
) -> None:
    """Environments and model are made before the folder, so that no argument fails after it exists."""
    assert message in one_line(program, dataclasses.replace(config, out=tmp_path / "run"))
    assert not list(tmp_path.iterdir())


def test_lack_of_memory_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The replay buffer is allocated before the folder is made."""

    def fail(*args: Any) -> None:
        raise MemoryError("Unable to allocate 2.7 PiB")

    monkeypatch.setattr(train_generalist, "ReplayBuffer", fail)
    line = one_line(train_generalist.main, dataclasses.replace(TINY_GENERALIST, out=tmp_path / "run"))
    assert "MemoryError Unable to allocate" in line and not list(tmp_path.iterdir())


def test_folder_that_cannot_be_renamed_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The search for a free name ends if the names are not the reason."""
    names: list[str] = []

    def fail(path: Path, target: Path) -> None:
        assert not names, "tried again with the next name"
        names.append(target.name)
        raise OSError("Input/output error")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="Input/output"):
        create_run_folder(TINY_PPO)
    assert names == ["dogleg-1"] and not list(Path("runs").iterdir())


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a finished run of PPO and one of the generalist."""
    folder = tmp_path_factory.mktemp("runs")
    train_ppo.main(dataclasses.replace(TINY_PPO, out=folder / "ppo"))
    train_generalist.main(dataclasses.replace(TINY_GENERALIST, out=folder / "generalist"))
    return folder


def replace_by_folder(path: Path) -> None:
    """Put a folder in place of a file."""
    path.unlink()
    path.mkdir()


def change_entry(path: Path, name: str, change: Callable[[bytes], bytes]) -> None:
    """Change an entry of a zip file."""
    with zipfile.ZipFile(path) as archive:
        entries = {entry: archive.read(entry) for entry in archive.namelist()}
    entries[name] = change(entries[name])
    with zipfile.ZipFile(path, "w") as archive:
        for entry, content in entries.items():
            archive.writestr(entry, content)


def spoil_weights(content: bytes) -> bytes:
    """Return weights of torch with all numbers replaced by NaN."""
    spoilt = io.BytesIO()
    weights = torch.load(io.BytesIO(content), weights_only=True)
    torch.save({name: values * float("nan") for name, values in weights.items()}, spoilt)
    return spoilt.getvalue()


def spoil_updates(content: bytes) -> bytes:
    """Return the data of a checkpoint with a text as the number of updates."""
    return json.dumps(json.loads(content) | {"_n_updates": "many"}).encode()


def spoil_net(path: Path) -> None:
    """Replace all weights in a checkpoint of the generalist by NaN."""
    stored = torch.load(path, weights_only=True)
    stored["net"] = {name: values * float("nan") for name, values in stored["net"].items()}
    torch.save(stored, path)


def change_count(path: Path, count: object) -> None:
    """Change the time steps in a checkpoint of the generalist."""
    torch.save({**torch.load(path, weights_only=True), "num_timesteps": count}, path)


DAMAGES: dict[str, tuple[str, Callable[[Path], object]]] = {
    "no checkpoint": ("ppo", lambda run: (run / "checkpoint.zip").unlink()),
    "checkpoint that is a folder": ("ppo", lambda run: replace_by_folder(run / "checkpoint.zip")),
    "updates that are a text": ("ppo", lambda run: change_entry(run / "checkpoint.zip", "data", spoil_updates)),
    "weights that are no numbers": (
        "ppo",
        lambda run: change_entry(run / "checkpoint.zip", "policy.pth", spoil_weights),
    ),
    "best model without numbers": ("ppo", lambda run: change_entry(run / "best.zip", "policy.pth", spoil_weights)),
    "evaluations that are a folder": ("ppo", lambda run: replace_by_folder(run / "progress.json")),
    "evaluations that are an object": ("ppo", lambda run: (run / "progress.json").write_text("{}")),
    "evaluations that are a text": ("ppo", lambda run: (run / "progress.json").write_text('""')),
    "evaluation that is no number": ("ppo", lambda run: (run / "progress.json").write_text('[{"strokes": NaN}]')),
    "generalist without checkpoint": ("generalist", lambda run: (run / "checkpoint.pt").unlink()),
    "generalist with a folder": ("generalist", lambda run: replace_by_folder(run / "checkpoint.pt")),
    "generalist without numbers": ("generalist", lambda run: spoil_net(run / "checkpoint.pt")),
    "generalist with a text as count": ("generalist", lambda run: change_count(run / "checkpoint.pt", "many")),
    "generalist with a negative count": ("generalist", lambda run: change_count(run / "checkpoint.pt", -5)),
    "generalist with a fraction": ("generalist", lambda run: change_count(run / "checkpoint.pt", 1.5)),
}
"""Ways to damage a run folder, each with the program that wrote it."""


@pytest.mark.parametrize("damage", DAMAGES)
def test_stored_run_that_cannot_be_resumed_stays_as_it_is(damage: str, runs: Path, tmp_path: Path) -> None:
    """A run never starts again from nothing in the folder of its evaluations."""
    name, change = DAMAGES[damage]
    run = tmp_path / "run"
    shutil.copytree(runs / name, run)
    change(run)
    before = {path: path.read_bytes() if path.is_file() else None for path in run.rglob("*")}
    if name == "ppo":
        line = one_line(train_ppo.main, PPOConfig(resume=run))
    else:
        line = one_line(train_generalist.main, GeneralistConfig(resume=run))
    assert line.startswith("resume: expected an intact model")
    assert {path: path.read_bytes() if path.is_file() else None for path in run.rglob("*")} == before


def test_initial_weights_that_are_no_numbers_leave_no_folder(runs: Path, tmp_path: Path) -> None:
    """A network of such weights can neither play nor learn."""
    weights = tmp_path / "weights.zip"
    shutil.copy(runs / "ppo" / "best.zip", weights)
    change_entry(weights, "policy.pth", spoil_weights)
    config = dataclasses.replace(TINY_PPO, out=tmp_path / "run", init_weights=weights)
    assert "expected finite weights" in one_line(train_ppo.main, config)
    assert list(tmp_path.iterdir()) == [weights]


def test_resumed_run_does_not_need_its_initial_weights(runs: Path, tmp_path: Path) -> None:
    """The checkpoint replaces the file that the run started from."""
    run = tmp_path / "run"
    shutil.copytree(runs / "ppo", run)
    config = json.loads((run / "config.json").read_text()) | {"init_weights": str(tmp_path / "removed.zip")}
    (run / "config.json").write_text(json.dumps(config))
    assert train_ppo.main(PPOConfig(resume=run))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"n_episodes": 0}, "n_episodes: expected"),
        ({"putt_noise": (-1.0, 0.0)}, "putt_noise: expected"),
        ({"run": Path("no_run")}, "expected the folder of a run"),
        ({"folder": Path("/dev/null/models")}, "not a folder"),
    ],
)
def test_release_checks_its_arguments_before_it_makes_anything(
    changes: dict[str, Any], message: str, runs: Path, tmp_path: Path
) -> None:
    """A mistake is one line."""
    config = dataclasses.replace(ReleaseConfig(runs / "ppo", folder=tmp_path / "models", n_episodes=1), **changes)
    assert message in one_line(release_model.main, config)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["best.zip", "config.json"])
def test_release_of_a_damaged_run_makes_nothing(name: str, runs: Path, tmp_path: Path) -> None:
    """A truncated model or configuration is one line."""
    run = tmp_path / "run"
    shutil.copytree(runs / "ppo", run)
    (run / name).write_bytes((run / name).read_bytes()[:50])
    assert "expected" in one_line(release_model.main, ReleaseConfig(run, folder=tmp_path / "models", n_episodes=1))
    assert not (tmp_path / "models").exists()


@pytest.mark.parametrize(
    ("name", "value"),
    [("cell_size", float("nan")), ("cell_size", 1e-12), ("num_cpus", 0), ("directions", 10**30), ("speeds", 10**8)],
)
def test_putt_map_checks_its_numbers_before_it_makes_a_folder(name: str, value: Any, tmp_path: Path) -> None:
    """One line names the argument."""
    line = one_line(putt_map.main, dataclasses.replace(TINY_MAP, out=tmp_path / "map", **{name: value}))
    assert name in line and "expected" in line and not list(tmp_path.iterdir())


def test_putt_map_without_ray_makes_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ray is imported before the folder is made."""

    def fail(address: str | None) -> None:
        raise SystemExit("Ray is missing.")

    monkeypatch.setattr(putt_map, "import_ray", fail)
    assert one_line(putt_map.main, dataclasses.replace(TINY_MAP, out=tmp_path / "map")) == "Ray is missing."
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", ["", "[1]", "null", "[" * 100_000])
def test_putt_map_in_the_folder_of_another_file_is_one_line(content: str, tmp_path: Path) -> None:
    """The message names the file that holds no arguments of a map."""
    (tmp_path / "putts.json").write_text(content)
    course = putt_map.load_course("dogleg")
    line = one_line(lambda config: create_or_check_folder(config, course, tmp_path), TINY_MAP)
    assert line.startswith("out: expected the arguments of a putt map") and "putts.json" in line


def test_damaged_putts_of_a_map_are_named(tmp_path: Path) -> None:
    """The message names the file, which can then be removed and simulated again."""
    path = shard_path(tmp_path, shard_ranges(TINY_MAP)[0])
    np.savez(path, result=np.zeros(3))
    path.write_bytes(path.read_bytes()[:20])
    course = putt_map.load_course("dogleg")
    line = one_line(lambda config: merge_shards(config, course, tmp_path), TINY_MAP)
    assert line.startswith(f"out: expected the putts of a map in {path}")
