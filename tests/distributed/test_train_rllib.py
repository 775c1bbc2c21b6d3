"""RLlib's PPO on two nodes: learning, killed workers, interruptions, and models that play without Ray."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents import train_rllib
from agents.cluster import connect
from agents.train_rllib import MODULE_ID, RLlibConfig, RLlibTrainer, timesteps_of
from agents.training_run import save_on_interrupt
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.players.policies import SB3Policy

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")

EASY_COURSE = """
name = "easy"
par = 2
about = "Straight on into a bucket."
top_speed = 3.0

[tee]
lower = [0.3, -0.2]
upper = [0.6, 0.2]

[cup]
position = [1.8, 0.0, 0.0]
radius = 0.2

[[parts]]
kind = "lane"
outline = [{ polygon = [[0, -0.5], [2.5, -0.5], [2.5, 0.5], [0, 0.5]] }]
"""


@pytest.fixture
def config(cluster: Any, tmp_path: Path) -> RLlibConfig:
    """Return a short run on the cluster, on a hole that is learned in some thousand putts."""
    course = tmp_path / "easy.toml"
    course.write_text(EASY_COURSE)
    return RLlibConfig(
        course=str(course),
        total_timesteps=12_000,
        out=tmp_path / "run",
        address=cluster.address,
        n_envs=64,
        batch_size=256,
        # The defaults are for 30 times as many putts: with so few they end at two strokes, with a tap-in.
        gamma=0.9,
        log_std_init=-1.5,
        log_std_final=-2.5,
        eval_freq=4_000,
        n_eval_episodes=20,
        n_test_episodes=50,
        n_search_episodes=0,
    )


def worker_locations(trainer: RLlibTrainer) -> list[tuple[str, int]]:
    """Return the node and the process of each worker."""
    import ray

    def location(_: Any) -> tuple[str, int]:
        return ray.get_runtime_context().get_node_id(), os.getpid()

    return sorted(trainer.algorithm.env_runner_group.foreach_env_runner(location, local_env_runner=False))


def log_std_everywhere(trainer: RLlibTrainer) -> list[float]:
    """Return log_std of the learner and of each worker."""
    name = "pi.log_std"
    worker_values = trainer.algorithm.env_runner_group.foreach_env_runner(
        lambda worker: worker.module.get_state()[name], local_env_runner=False
    )
    learner_values = trainer.algorithm.learner_group.get_weights()[MODULE_ID][name]
    return np.concatenate([learner_values, *worker_values]).tolist()


def test_learns_and_replaces_killed_worker(config: RLlibConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker of each node plays; one is killed at the first checkpoint, and the hole is learned nevertheless.

    At the end the action noise has its final value on the learner and on the workers, including the new one.
    """
    assert config.out is not None
    locations: list[list[tuple[str, int]]] = []
    log_stds: list[list[float]] = []
    initial_strokes: list[float] = []
    init_from_sb3 = RLlibTrainer.init_from_sb3
    save_and_evaluate = RLlibTrainer.save_and_evaluate

    def init_and_evaluate(trainer: RLlibTrainer) -> None:
        init_from_sb3(trainer)
        trainer.sync_to_sb3()
        policy = SB3Policy(trainer.model, config.observation)
        initial_strokes.append(evaluate(policy, "initial", config.course, episodes=50, quiet=True).strokes)

    def save_evaluate_and_kill(trainer: RLlibTrainer) -> None:
        save_and_evaluate(trainer)
        locations.append(worker_locations(trainer))
        log_stds.append(log_std_everywhere(trainer))
        if len(locations) == 1:
            os.kill(locations[0][0][1], signal.SIGKILL)

    monkeypatch.setattr(RLlibTrainer, "init_from_sb3", init_and_evaluate)
    monkeypatch.setattr(RLlibTrainer, "save_and_evaluate", save_evaluate_and_kill)
    random, learned = train_rllib.main(config)
    assert learned.strokes < 1.5 < random.strokes < initial_strokes[0]
    (killed, survivor), at_end = locations[0], locations[-1]
    assert killed[0] != survivor[0], "a worker on each node"
    assert survivor in at_end and killed not in at_end and len(at_end) == 2, "one of them replaced"
    assert config.log_std_final < min(log_stds[0]) == max(log_stds[0]) < config.log_std_init
    assert np.allclose(log_stds[-1], config.log_std_final) and len(log_stds[-1]) == 6
    assert json.loads((config.out / "progress.json").read_text())[-1]["timesteps"] >= config.total_timesteps


def test_interrupted_run_resumes(config: RLlibConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C saves; --resume has the same weights and plays the remaining putts; no temporary files are left."""
    assert config.out is not None
    weights: list[dict[str, Any]] = []
    save_rllib_checkpoint = RLlibTrainer.save_rllib_checkpoint
    learn = RLlibTrainer.learn

    def record_weights(trainer: RLlibTrainer) -> None:
        weights.append(trainer.algorithm.learner_group.get_weights()[MODULE_ID])

    def record_and_save(trainer: RLlibTrainer) -> None:
        record_weights(trainer)
        save_rllib_checkpoint(trainer)

    def record_and_learn(trainer: RLlibTrainer) -> None:
        record_weights(trainer)
        learn(trainer)

    def interrupt(trainer: RLlibTrainer) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(RLlibTrainer, "save_and_evaluate", interrupt)
        patched.setattr(RLlibTrainer, "save_rllib_checkpoint", record_and_save)
        with pytest.raises(SystemExit, match="--resume"):
            train_rllib.main(config)
    (checkpoint,) = config.out.glob("checkpoint-*")
    assert config.eval_freq <= timesteps_of(checkpoint) < config.total_timesteps
    monkeypatch.setattr(RLlibTrainer, "learn", record_and_learn)
    assert train_rllib.address_of(RLlibConfig(resume=config.out)) == config.address
    assert train_rllib.address_of(RLlibConfig(resume=config.out, address="auto")) == "auto"
    train_rllib.main(RLlibConfig(resume=config.out))
    (checkpoint,) = config.out.glob("checkpoint-*")
    assert config.total_timesteps <= timesteps_of(checkpoint) < config.total_timesteps + config.eval_freq
    assert not [file for file in config.out.iterdir() if file.name.startswith(".")], "temporary files are left"
    saved, resumed = weights
    assert all(np.array_equal(saved[name], resumed[name]) for name in saved)


def test_exported_model_plays_same_putts_without_ray(config: RLlibConfig, tmp_path: Path) -> None:
    """RLlib's network and the exported model agree in a process that cannot import Ray."""
    import torch

    ray = connect(config.address)
    (folder := tmp_path / "exported").mkdir()
    trainer = RLlibTrainer(config, folder)
    observations = np.random.default_rng(0).uniform(-1, 1, (100, 10)).astype(np.float32)
    trainer.algorithm.train()
    with torch.no_grad():
        means = trainer.algorithm.get_module().forward_inference({"obs": torch.as_tensor(observations)})
    np.save(tmp_path / "observations.npy", observations)
    trainer.sync_to_sb3()
    trainer.save("model.zip")
    trainer.algorithm.stop()
    ray.shutdown()
    code = """if True:
        import sys
        sys.modules["ray"] = None
        import numpy as np
        from minigolf_env.players.policies import load_policy
        policy = load_policy("exported/model.zip")
        np.save("actions.npy", [policy.act(observation, None) for observation in np.load("observations.npy")])
    """
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    expected = means["action_dist_inputs"][:, :2].numpy().clip(-1.0, 1.0)
    assert np.allclose(np.load(tmp_path / "actions.npy"), expected, rtol=0.0, atol=1e-6)
    assert np.ptp(expected) > 0.0


@pytest.mark.parametrize("invalid", [{"observation": "pixels"}, {"num_env_runners": 0}], ids=str)
def test_invalid_arguments_create_no_folder(config: RLlibConfig, invalid: dict[str, Any]) -> None:
    """The program ends with one line."""
    with pytest.raises(SystemExit, match="expected"):
        train_rllib.main(dataclasses.replace(config, **invalid))
    assert config.out is not None and not config.out.exists()


def test_rejects_more_workers_than_cores(config: RLlibConfig) -> None:
    """RLlib itself would wait for the cores for ever."""
    with pytest.raises(SystemExit, match="at most 2"):
        train_rllib.main(dataclasses.replace(config, num_learners=1))


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nowhere"])
def test_unreachable_address_ends_with_one_line(cluster: Any, address: str) -> None:
    """An address without a cluster ends the program without a traceback."""
    with pytest.raises(SystemExit, match="address: expected"):
        connect(address)


def test_missing_ray_ends_with_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message names the command that installs Ray."""
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(SystemExit, match="pip install"):
        connect()


class FakeAlgorithm:
    """Stand-in for RLlib's algorithm, whose checkpoint is a folder with one file."""

    def save_to_path(self, path: str) -> None:
        """Write the checkpoint."""
        Path(path).mkdir()
        (Path(path) / "weights").touch()


def test_folder_always_has_a_complete_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After each removal and rename there is a complete checkpoint to resume from; at the end there is only one."""
    trainer = RLlibTrainer.__new__(RLlibTrainer)
    trainer.folder = tmp_path
    trainer.algorithm = FakeAlgorithm()
    trainer.num_timesteps = 100
    trainer.save_rllib_checkpoint()

    def check_after_each_call(module: Any, name: str) -> None:
        function = getattr(module, name)

        def checked(*args: Any, **options: Any) -> None:
            function(*args, **options)
            assert (trainer.checkpoints()[-1] / "weights").is_file()

        monkeypatch.setattr(module, name, checked)

    check_after_each_call(shutil, "rmtree")
    check_after_each_call(train_rllib, "commit")
    for timesteps in (100, 100, 200):
        trainer.num_timesteps = timesteps
        trainer.save_rllib_checkpoint()
    assert [file.name for file in tmp_path.iterdir()] == ["checkpoint-200"]


def test_timeout_of_ray_is_not_reported_as_full_disk(tmp_path: Path) -> None:
    """TimeoutError is a subclass of OSError."""
    with pytest.raises(TimeoutError), save_on_interrupt(tmp_path):
        raise TimeoutError("Get timed out: some object(s) not ready.")
    with pytest.raises(SystemExit, match="Could not save"), save_on_interrupt(tmp_path):
        raise OSError(28, "No space left on device")
