"""A run that is killed at any moment goes on from its last checkpoint."""

from __future__ import annotations

import dataclasses
import json
import multiprocessing
import resource
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO

from agents import runs, train_ppo

KILLS = 20

LONG = train_ppo.Args(
    putts=960,
    num_envs=16,
    n_steps=2,
    batch_size=32,
    check_every=32,
    check_episodes=2,
    final_episodes=2,
    search_episodes=0,
)
"""It writes a checkpoint, a score, and often a best model every few hundredths of a second."""

CONTEXT = multiprocessing.get_context("forkserver")
"""Processes that have all libraries, and no thread, when they start."""


def played(folder: Path) -> int:
    """Return the putts of the newest checkpoint, which is whole; 0 if there is none."""
    path = folder / "checkpoint.zip"
    return PPO.load(path).num_timesteps if path.is_file() else 0


def saves(folder: Path) -> int:
    """Return a number that changes with each checkpoint and its score."""
    path = folder / "progress.json"
    return path.stat().st_ino if path.is_file() else 0


def test_twenty_kills_lose_no_more_than_the_last_putts(tmp_path: Path) -> None:
    """After each all files are whole, the arguments the same, and the count goes on, to where an unkilled run ends."""
    CONTEXT.set_forkserver_preload(["agents.train_ppo"])
    rng = np.random.default_rng(1)
    folder, ended, before, kills = tmp_path / "0", 0, 0, 0
    while kills < KILLS or not ended:
        resume = (folder / "args.json").is_file()
        args = train_ppo.Args(resume=folder) if resume else dataclasses.replace(LONG, out=folder)
        process, first = CONTEXT.Process(target=train_ppo.main, args=(args,)), saves(folder)
        process.start()
        while process.is_alive() and saves(folder) == first:
            time.sleep(0.01)
        process.join(rng.uniform(0.0, 1.0) if kills < KILLS else None)
        process.kill()
        process.join()
        killed = process.exitcode == -signal.SIGKILL
        assert killed or process.exitcode == 0
        kills += killed
        now, history = played(folder), json.loads((folder / "progress.json").read_text())
        assert before <= now <= LONG.putts and (killed or now == LONG.putts)
        assert runs.read_args(train_ppo.Args, folder) == LONG
        assert [row["putts"] for row in history] == sorted(row["putts"] for row in history)
        before = now
        if not killed:
            assert not [file for file in folder.iterdir() if file.name.startswith(".")], "what was half written is gone"
            ended, before, folder = ended + 1, 0, tmp_path / str(ended + 1)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # The file that could not be written.
def test_a_full_disk_keeps_the_last_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a first checkpoint files may not grow beyond a few bytes; when they may again, the run goes on."""
    folder, limits = tmp_path / "run", resource.getrlimit(resource.RLIMIT_FSIZE)
    save, saved = runs.Checkpoints.save, []

    def fill(checkpoints: runs.Checkpoints, name: str) -> None:
        if len(saved) == 2:  # The first checkpoint, and that it is the best.
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
        save(checkpoints, name)
        saved.append((folder / name).read_bytes())

    with monkeypatch.context() as patched:
        patched.setattr(runs.Checkpoints, "save", fill)
        try:
            with pytest.raises(SystemExit, match=r"Could not save: .*The last checkpoint is whole.*--resume"):
                train_ppo.main(dataclasses.replace(LONG, putts=128, out=folder))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(saved) == 2 and (folder / "checkpoint.zip").read_bytes() == saved[0]
    assert not [file.name for file in folder.iterdir() if file.name.startswith(".")]
    train_ppo.main(train_ppo.Args(resume=folder))
    assert played(folder) == 128
