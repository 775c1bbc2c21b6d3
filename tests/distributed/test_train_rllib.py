"""RLlib's PPO on two nodes: it learns, outlives its workers and its interruptions, and is read without Ray."""

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

from agents import runs, train_rllib
from agents.cluster import connect
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.players.policies import SB3Policy

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")

EASY = """
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
def args(cluster: Any, tmp_path: Path) -> train_rllib.Args:
    """Return a short run on the cluster, on a hole that is learned in some thousand putts."""
    course = tmp_path / "easy.toml"
    course.write_text(EASY)
    return train_rllib.Args(
        course=str(course),
        putts=12_000,
        out=tmp_path / "run",
        address=cluster.address,
        num_envs=64,
        batch_size=256,
        # The defaults are for 30 times as many putts: in so few they end at two strokes, with a tap-in.
        gamma=0.9,
        log_std=(-1.5, -2.5),
        check_every=4_000,
        check_episodes=20,
        final_episodes=50,
        search_episodes=0,
    )


def where(training: train_rllib.Training) -> list[tuple[str, int]]:
    """Return the node and the process of each worker."""
    import ray

    def here(_: Any) -> tuple[str, int]:
        return ray.get_runtime_context().get_node_id(), os.getpid()

    return sorted(training.algorithm.env_runner_group.foreach_env_runner(here, local_env_runner=False))


def noise_of(training: train_rllib.Training) -> list[float]:
    """Return log_std as the learner has it and each worker."""
    name = "pi.log_std"
    states = training.algorithm.env_runner_group.foreach_env_runner(
        lambda worker: worker.module.get_state()[name], local_env_runner=False
    )
    mine = training.algorithm.learner_group.get_weights()[train_rllib.MODULE][name]
    return np.concatenate([mine, *states]).tolist()


def test_scores_improve_and_a_killed_worker_is_replaced(
    args: train_rllib.Args, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker of each node plays; one is killed at the first checkpoint; the hole is learned all the same.

    The noise has gone all its way by then, on the learner and on the workers, the new one too.
    """
    assert args.out is not None
    places: list[list[tuple[str, int]]] = []
    noises: list[list[float]] = []
    first_strokes: list[float] = []
    lend, check = train_rllib.Training.lend, train_rllib.Training.check

    def score(training: train_rllib.Training) -> float:
        training.carry()
        policy = SB3Policy(training.model, args.observation)
        return evaluate(policy, "first", args.course, episodes=50, quiet=True).strokes

    def lend_and_score(training: train_rllib.Training) -> None:
        lend(training)
        first_strokes.append(score(training))

    def check_and_kill(training: train_rllib.Training) -> None:
        check(training)
        places.append(where(training))
        noises.append(noise_of(training))
        if len(places) == 1:
            os.kill(places[0][0][1], signal.SIGKILL)

    monkeypatch.setattr(train_rllib.Training, "lend", lend_and_score)
    monkeypatch.setattr(train_rllib.Training, "check", check_and_kill)
    random, learned = train_rllib.main(args)
    assert learned.strokes < 1.5 < random.strokes < first_strokes[0]
    (first, second), after = places[0], places[-1]
    assert first[0] != second[0], "a worker on each node"
    assert second in after and first not in after and len(after) == 2, "one of them replaced"
    assert args.log_std[1] < min(noises[0]) == max(noises[0]) < args.log_std[0]
    assert np.allclose(noises[-1], args.log_std[1]) and len(noises[-1]) == 6
    assert json.loads((args.out / "progress.json").read_text())[-1]["putts"] >= args.putts


def test_an_interrupted_run_goes_on(args: train_rllib.Args, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C saves; --resume has the same weights, plays the putts that were left, and nothing half-written stays."""
    assert args.out is not None
    weights: list[dict[str, Any]] = []
    keep, learn = train_rllib.Training.keep, train_rllib.Training.learn

    def remember(training: train_rllib.Training) -> None:
        weights.append(training.algorithm.learner_group.get_weights()[train_rllib.MODULE])

    def interrupt(training: train_rllib.Training) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(train_rllib.Training, "check", interrupt)
        patched.setattr(train_rllib.Training, "keep", lambda training: (remember(training), keep(training)))
        with pytest.raises(SystemExit, match="--resume"):
            train_rllib.main(args)
    (checkpoint,) = args.out.glob("checkpoint-*")
    assert args.check_every <= train_rllib.putts_of(checkpoint) < args.putts
    monkeypatch.setattr(train_rllib.Training, "learn", lambda training: (remember(training), learn(training)))
    train_rllib.main(train_rllib.Args(resume=args.out, address=args.address))
    (checkpoint,) = args.out.glob("checkpoint-*")
    assert args.putts <= train_rllib.putts_of(checkpoint) < args.putts + args.check_every
    assert not [file for file in args.out.iterdir() if file.name.startswith(".")], "half-written files"
    saved, resumed = weights
    assert all(np.array_equal(saved[name], resumed[name]) for name in saved)


def test_the_exported_model_plays_the_same_putts_without_ray(args: train_rllib.Args, tmp_path: Path) -> None:
    """RLlib's network and the file's agree, where nothing of Ray can be imported."""
    import torch

    ray = connect(args.address)
    (folder := tmp_path / "exported").mkdir()
    training = train_rllib.Training(args, folder)
    observations = np.random.default_rng(0).uniform(-1, 1, (100, 10)).astype(np.float32)
    training.algorithm.train()
    with torch.no_grad():
        means = training.algorithm.get_module().forward_inference({"obs": torch.as_tensor(observations)})
    np.save(tmp_path / "observations.npy", observations)
    training.carry()
    training.save("model.zip")
    training.algorithm.stop()
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


@pytest.mark.parametrize("mistake", [{"observation": "pixels"}, {"num_env_runners": 0}], ids=str)
def test_what_it_cannot_learn_from_is_refused(args: train_rllib.Args, mistake: dict[str, Any]) -> None:
    """With a line, before there is a folder."""
    with pytest.raises(SystemExit, match="expected"):
        train_rllib.main(dataclasses.replace(args, **mistake))
    assert args.out is not None and not args.out.exists()


def test_more_workers_than_cores_are_refused(args: train_rllib.Args) -> None:
    """RLlib would wait for ever."""
    with pytest.raises(SystemExit, match="at most 2"):
        train_rllib.main(dataclasses.replace(args, num_learners=1))


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nowhere"])
def test_a_wrong_address_is_one_line(cluster: Any, address: str) -> None:
    """No cluster, no traceback."""
    with pytest.raises(SystemExit, match="address: expected"):
        connect(address)


def test_without_ray_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """In whatever environment the program is started."""
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(SystemExit, match="pip install"):
        connect()


class Kept:
    """What stands for RLlib's learner: its checkpoint is a folder with a file."""

    def save_to_path(self, path: str) -> None:
        """Write the checkpoint."""
        Path(path).mkdir()
        (Path(path) / "weights").touch()


def test_at_no_moment_is_the_folder_without_a_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before and after each removal and each rename, a whole one is there to go on from; in the end one alone."""
    training = train_rllib.Training.__new__(train_rllib.Training)
    training.folder, training.algorithm, training.num_timesteps = tmp_path, Kept(), 100
    training.keep()

    def watch(module: Any, name: str) -> None:
        change = getattr(module, name)

        def watched(*args: Any, **options: Any) -> None:
            change(*args, **options)
            assert (training.kept()[-1] / "weights").is_file()

        monkeypatch.setattr(module, name, watched)

    watch(shutil, "rmtree")
    watch(train_rllib, "commit")
    for training.num_timesteps in (100, 100, 200):
        training.keep()
    assert [file.name for file in tmp_path.iterdir()] == ["checkpoint-200"]


def test_a_timeout_of_rays_is_not_taken_for_a_full_disk(tmp_path: Path) -> None:
    """To Python it is an OSError, too."""
    with pytest.raises(TimeoutError), runs.stoppable(tmp_path, lambda: None):
        raise TimeoutError("Get timed out: some object(s) not ready.")
    with pytest.raises(SystemExit, match="Could not save"), runs.stoppable(tmp_path, lambda: None):
        raise OSError(28, "No space left on device")
