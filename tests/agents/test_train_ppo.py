"""The training program on a tiny budget."""

from __future__ import annotations

import base64
import dataclasses
import json
import pickle
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from stable_baselines3 import PPO

from agents import runs, train_ppo

TINY = train_ppo.Args(
    putts=256,
    num_envs=16,
    n_steps=4,
    batch_size=64,
    check_every=128,
    check_episodes=2,
    final_episodes=2,
    search_episodes=0,
)


def test_a_run_learns_saves_and_scores(tmp_path: Path) -> None:
    """All putts are played; checkpoint, best model, arguments and scores are in the folder; it is never overwritten."""
    folder = tmp_path / "run"
    scores = train_ppo.main(dataclasses.replace(TINY, out=folder))
    assert [score.policy for score in scores] == ["random", "PPO"]
    assert PPO.load(folder / "checkpoint.zip").num_timesteps == TINY.putts
    assert json.loads((folder / "scores.json").read_text())["scores"][1]["episodes"] == TINY.final_episodes
    assert {file.name for file in folder.iterdir()} >= {"best.zip", "args.json", "progress.json"}
    assert not [file for file in folder.iterdir() if file.name.startswith(".")], "half-written files"
    with pytest.raises(SystemExit, match="exists"):
        train_ppo.main(dataclasses.replace(TINY, out=folder))


@pytest.mark.parametrize(
    ("strokes", "seeds", "tried"),
    [
        ((1.0,), 3, [5]),
        ((1.09,), 3, [5]),
        ((1.3, 1.0), 3, [5, 6]),
        ((1.3, 1.3, 1.3, 1.0), 3, [5, 6, 7]),
        ((1.3,), 1, [5]),
    ],
)
def test_a_run_that_got_stuck_is_followed_by_another(
    strokes: tuple[float, ...], seeds: int, tried: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each with the next seed and a folder of its own, until one comes near to search or no seeds are left."""
    ran: list[train_ppo.Args] = []

    def run(args: train_ppo.Args, *_: object) -> list[Any]:
        ran.append(args)
        return [SimpleNamespace(strokes=mean) for mean in (9.0, 1.0, strokes[len(ran) - 1])]

    monkeypatch.setattr(runs, "run", run)
    scores = train_ppo.main(train_ppo.Args(seed=5, seeds=seeds, out=tmp_path / "run"))
    assert [args.seed for args in ran] == tried and scores[-1].strokes == strokes[len(tried) - 1]
    assert len({args.out for args in ran}) == len(tried)


def test_more_seeds_need_search() -> None:
    """Without it nothing tells that a run got stuck: that is said before it begins."""
    with pytest.raises(SystemExit, match="seeds: expected 1 without search"):
        train_ppo.main(train_ppo.Args(seeds=2, search_episodes=0))


def test_an_interrupted_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C saves; --resume plays just the putts that were left, with the run's own arguments."""
    folder = tmp_path / "run"

    def interrupt(callback: runs.Checkpoints) -> bool:
        if callback.num_timesteps >= TINY.putts / 2:
            raise KeyboardInterrupt
        return True

    with monkeypatch.context() as patched:
        patched.setattr(runs.Checkpoints, "_on_step", interrupt)
        with pytest.raises(SystemExit, match="--resume"):
            train_ppo.main(dataclasses.replace(TINY, out=folder))
    interrupted = PPO.load(folder / "checkpoint.zip").num_timesteps
    assert TINY.putts / 2 <= interrupted < TINY.putts
    train_ppo.main(train_ppo.Args(resume=folder))
    model = PPO.load(folder / "checkpoint.zip")
    assert model.num_timesteps == TINY.putts and model.n_envs == TINY.num_envs


class Trap:
    """Makes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what unpickling calls."""
        return Path.touch, (self.path,)


def test_going_on_with_a_strangers_run_runs_no_code_of_its_files(tmp_path: Path) -> None:
    """Neither of its checkpoint nor of its best model; stable-baselines3's own load would."""
    folder, trap = tmp_path / "run", tmp_path / "sprung"
    train_ppo.main(dataclasses.replace(TINY, out=folder))
    for file in (folder / "checkpoint.zip", folder / "best.zip"):
        with zipfile.ZipFile(file) as archive:
            entries = {name: archive.read(name) for name in archive.namelist()}
        about = json.loads(entries["data"])
        about["trap"] = {":type:": "trap", ":serialized:": base64.b64encode(pickle.dumps(Trap(trap))).decode()}
        with zipfile.ZipFile(file, "w") as archive:
            for name, content in {**entries, "data": json.dumps(about)}.items():
                archive.writestr(name, content)
    train_ppo.main(train_ppo.Args(resume=folder))
    assert not trap.exists()
    PPO.load(folder / "best.zip")
    assert trap.exists()


def test_resuming_nothing_is_refused(tmp_path: Path) -> None:
    """A folder without a run ends the program with one line."""
    with pytest.raises(SystemExit, match="resume"):
        train_ppo.main(train_ppo.Args(resume=tmp_path))


@pytest.mark.parametrize("text", ["{", "[]", "\xff"], ids=str)
def test_resuming_with_damaged_arguments_is_refused(tmp_path: Path, text: str) -> None:
    """With one line, too."""
    (tmp_path / "args.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(SystemExit, match=r"resume: expected .*run"):
        train_ppo.main(train_ppo.Args(resume=tmp_path))


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    """With the system's reason and a remedy."""
    (tmp_path / "file").touch()
    with pytest.raises(SystemExit, match=r"out: .*Not a directory.*choose another folder"):
        runs.begin(dataclasses.replace(TINY, out=tmp_path / "file" / "run"))


def test_of_two_starts_at_once_each_has_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The slower one takes the next name, rather than be told to go on with the other's run."""
    monkeypatch.chdir(tmp_path)
    mkdir = Path.mkdir

    def too_late(path: Path, *args: Any, **options: Any) -> None:
        if path.name == "dogleg-1":
            mkdir(path, parents=True, exist_ok=True)
        mkdir(path, *args, **options)

    monkeypatch.setattr(Path, "mkdir", too_late)
    assert runs.new_folder(TINY) == Path("runs/dogleg-2")


def test_an_interruption_on_a_full_disk_ends_with_one_line(tmp_path: Path) -> None:
    """It could not save, and says so."""

    def save() -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(SystemExit, match=r"Could not save: .*No space.*--resume"), runs.stoppable(tmp_path, save):
        raise KeyboardInterrupt
