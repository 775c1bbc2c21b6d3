"""RLlib's PPO on two nodes: it learns, outlives its workers and its interruptions, and is read without Ray."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents import evaluate, train_rllib
from agents.cluster import connect
from minigolf_env.policies import load_policy

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
        minutes=60.0,
        out=tmp_path / "run",
        address=cluster.address,
        num_envs=64,
        batch_size=256,
        check_every=4_000,
        check_episodes=20,
        final_episodes=50,
        search_episodes=0,
    )


def where(run: train_rllib.Run) -> list[tuple[str, int]]:
    """Return the node and the process of each worker."""
    import ray

    def here(_: Any) -> tuple[str, int]:
        return ray.get_runtime_context().get_node_id(), os.getpid()

    return sorted(run.algorithm.env_runner_group.foreach_env_runner(here, local_env_runner=False))


def test_scores_improve_and_a_killed_worker_is_replaced(
    args: train_rllib.Args, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker of each node plays; one is killed at the first checkpoint; the hole is learned all the same."""
    assert args.out is not None
    places: list[list[tuple[str, int]]] = []
    first_strokes: list[float] = []
    lend, check = train_rllib.Run.lend, train_rllib.Run.check

    def score(run: train_rllib.Run) -> float:
        options = evaluate.Args(course=args.course, episodes=50)
        return evaluate.evaluate(load_policy(run.export("first.zip")), "first", options, quiet=True).strokes

    def lend_and_score(run: train_rllib.Run) -> None:
        lend(run)
        first_strokes.append(score(run))

    def check_and_kill(run: train_rllib.Run) -> None:
        check(run)
        places.append(where(run))
        if len(places) == 1:
            os.kill(places[0][0][1], signal.SIGKILL)

    monkeypatch.setattr(train_rllib.Run, "lend", lend_and_score)
    monkeypatch.setattr(train_rllib.Run, "check", check_and_kill)
    random, learned = train_rllib.main(args)
    assert learned.strokes < 1.5 < random.strokes < first_strokes[0]
    (first, second), after = places[0], places[-1]
    assert first[0] != second[0], "a worker on each node"
    assert second in after and first not in after and len(after) == 2, "one of them replaced"
    assert json.loads((args.out / "progress.json").read_text())["putts"] >= args.putts


def test_an_interrupted_run_goes_on(args: train_rllib.Args, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C saves; --resume has the same weights, plays the putts that were left, and nothing half-written stays."""
    assert args.out is not None
    weights: list[dict[str, Any]] = []
    save, learn = train_rllib.Run.save, train_rllib.Run.learn

    def remember(run: train_rllib.Run) -> None:
        weights.append(run.algorithm.learner_group.get_weights()[train_rllib.MODULE])

    def interrupt(run: train_rllib.Run) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(train_rllib.Run, "check", interrupt)
        patched.setattr(train_rllib.Run, "save", lambda run: (remember(run), save(run)))
        with pytest.raises(SystemExit, match="--resume"):
            train_rllib.main(args)
    putts = json.loads((args.out / "progress.json").read_text())["putts"]
    assert args.check_every <= putts < args.putts
    monkeypatch.setattr(train_rllib.Run, "learn", lambda run, seconds: (remember(run), learn(run, seconds)))
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
    run = train_rllib.Run(args, folder)
    observations = np.random.default_rng(0).uniform(-1, 1, (100, 10)).astype(np.float32)
    run.algorithm.train()
    with torch.no_grad():
        means = run.algorithm.get_module().forward_inference({"obs": torch.as_tensor(observations)})
    np.save(tmp_path / "observations.npy", observations)
    run.export("model.zip")
    run.algorithm.stop()
    ray.shutdown()
    code = """if True:
        import sys
        sys.modules["ray"] = None
        import numpy as np
        from minigolf_env.policies import load_policy
        policy = load_policy("exported/model.zip")
        np.save("actions.npy", [policy.act(observation, None) for observation in np.load("observations.npy")])
    """
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    expected = means["action_dist_inputs"][:, :2].numpy().clip(-1.0, 1.0)
    assert np.allclose(np.load(tmp_path / "actions.npy"), expected, rtol=0.0, atol=1e-6)
    assert np.ptp(expected) > 0.0


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
