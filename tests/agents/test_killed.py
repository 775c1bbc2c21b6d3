"""A run that is killed at any moment resumes from its last checkpoint."""

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

from agents import train_ppo
from agents.run_evaluation import EvalCheckpointCallback
from agents.train_ppo import PPOConfig
from agents.training_run import read_config

NUM_KILLS = 20

LONG_RUN = PPOConfig(
    total_timesteps=960,
    n_envs=16,
    n_steps=2,
    batch_size=32,
    eval_freq=32,
    n_eval_episodes=2,
    n_test_episodes=2,
    n_search_episodes=0,
)
"""Run that writes a checkpoint, its evaluation, and often a best model every few hundredths of a second."""

CONTEXT = multiprocessing.get_context("forkserver")
"""Start method of processes that have imported all libraries, but have no thread, when they start."""


def timesteps_of_checkpoint(folder: Path) -> int:
    """Return the time steps of the newest checkpoint, which must be intact; 0 if there is none."""
    path = folder / "checkpoint.zip"
    return PPO.load(path).num_timesteps if path.is_file() else 0


def evaluation_version(folder: Path) -> int:
    """Return a number that changes when a checkpoint has been evaluated: the inode of the file that is replaced."""
    path = folder / "progress.json"
    return path.stat().st_ino if path.is_file() else 0


def test_killed_run_resumes_from_last_checkpoint(tmp_path: Path) -> None:
    """After each of 20 kills all files are intact and the configuration is the same; time steps never decrease.

    The last resumed run ends at the same time step as a run that is not killed.
    """
    CONTEXT.set_forkserver_preload(["agents.train_ppo"])
    rng = np.random.default_rng(1)
    folder = tmp_path / "0"
    num_finished = 0
    num_kills = 0
    previous_timesteps = 0
    while num_kills < NUM_KILLS or not num_finished:
        can_resume = (folder / "config.json").is_file()
        config = PPOConfig(resume=folder) if can_resume else dataclasses.replace(LONG_RUN, out=folder)

        # Start the program, wait for an evaluation, and kill it at a random moment after.
        process = CONTEXT.Process(target=train_ppo.main, args=(config,))
        version = evaluation_version(folder)
        process.start()
        while process.is_alive() and evaluation_version(folder) == version:
            time.sleep(0.01)
        process.join(rng.uniform(0.0, 1.0) if num_kills < NUM_KILLS else None)
        process.kill()
        process.join()
        is_killed = process.exitcode == -signal.SIGKILL
        assert is_killed or process.exitcode == 0
        num_kills += is_killed

        # Check the files.
        timesteps = timesteps_of_checkpoint(folder)
        history = json.loads((folder / "progress.json").read_text())
        assert previous_timesteps <= timesteps <= LONG_RUN.total_timesteps
        assert is_killed or timesteps == LONG_RUN.total_timesteps
        assert read_config(PPOConfig, folder) == LONG_RUN
        assert [row["timesteps"] for row in history] == sorted(row["timesteps"] for row in history)
        previous_timesteps = timesteps
        if not is_killed:
            assert not [file for file in folder.iterdir() if file.name.startswith(".")], "temporary files are left"
            num_finished += 1
            previous_timesteps = 0
            folder = tmp_path / str(num_finished)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # The file that could not be written.
def test_full_disk_keeps_last_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit on file sizes ends a run after its first checkpoint; without the limit the run resumes from there."""
    folder = tmp_path / "run"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    save = EvalCheckpointCallback.save
    saved: list[bytes] = []

    def save_with_full_disk(callback: EvalCheckpointCallback, name: str = "checkpoint.zip") -> None:
        if len(saved) == 2:  # The first checkpoint, and the same model as the best one.
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
        save(callback, name)
        saved.append((folder / name).read_bytes())

    with monkeypatch.context() as patched:
        patched.setattr(EvalCheckpointCallback, "save", save_with_full_disk)
        try:
            with pytest.raises(SystemExit, match=r"Could not save: .*The last checkpoint is intact.*--resume"):
                train_ppo.main(dataclasses.replace(LONG_RUN, total_timesteps=128, out=folder))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(saved) == 2 and (folder / "checkpoint.zip").read_bytes() == saved[0]
    assert not [file.name for file in folder.iterdir() if file.name.startswith(".")]
    train_ppo.main(PPOConfig(resume=folder))
    assert timesteps_of_checkpoint(folder) == 128
