"""The generalist, a Q-function over putts, on tiny budgets."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from agents import train_generalist, train_ppo, train_rllib
from agents.train_generalist import GeneralistConfig, QLearner
from agents.train_ppo import PPOConfig
from agents.train_rllib import RLlibConfig
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.players.model_files import load_model
from minigolf_env.players.policies import ModelPolicy
from minigolf_env.players.putt_features import NUM_FEATURES
from minigolf_env.players.putt_value_model import PuttValueModel

TINY = GeneralistConfig(
    total_timesteps=64,
    n_envs=2,
    num_candidates=8,
    num_levels=3,
    buffer_size=50,
    batch_size=16,
    eval_freq=32,
    n_eval_episodes=2,
    n_test_episodes=2,
    n_search_episodes=0,
)


def test_generalist_trains_and_evaluates(tmp_path: Path) -> None:
    """The model is evaluated on each difficulty, and its file alone gives the same score again."""
    folder = tmp_path / "run"
    scores = train_generalist.main(dataclasses.replace(TINY, total_timesteps=672, out=folder))
    history = json.loads((folder / "progress.json").read_text())
    assert history[-1]["timesteps"] == 672 and len(history) > 2
    assert [(score.policy, score.difficulty) for score in scores[1::2]] == [
        ("generalist", "easy"),
        ("generalist", "medium"),
    ]
    policy = ModelPolicy(folder / "best.npz")
    assert policy.observation == "bounce_rays" and isinstance(policy.model, PuttValueModel)
    assert policy.model.mlp.num_inputs == NUM_FEATURES
    score = evaluate(policy, "generalist", "procedural", difficulty="easy", episodes=2, quiet=True)
    assert dataclasses.replace(score, sha256=None) == dataclasses.replace(scores[1], sha256=None)
    with pytest.raises(SystemExit, match="of another"):
        train_ppo.main(PPOConfig(resume=folder))


def test_generalist_resumes_from_checkpoint_bitwise(tmp_path: Path) -> None:
    """A resumed run has the saved weights, time steps and evaluations; a new run can start from the weights."""
    config = dataclasses.replace(TINY, out=tmp_path / "a")
    train_generalist.main(config)
    resumed = QLearner(config, tmp_path / "a")
    assert resumed.num_timesteps == 96 and len(resumed.history.rows) == 3
    stored = load_model(tmp_path / "a" / "checkpoint.npz")
    initialized = QLearner(
        dataclasses.replace(config, seed=1, init_weights=tmp_path / "a" / "checkpoint.npz"), tmp_path
    )
    for q_function in (resumed.q_function, initialized.q_function):
        for layer, stored_layer in zip(q_function.mlp.layers, stored.mlp.layers, strict=True):
            assert all(np.array_equal(actual, expected) for actual, expected in zip(layer, stored_layer, strict=True))


def test_same_seed_gives_same_generalist_bitwise(tmp_path: Path) -> None:
    """Collecting and learning run in two threads, and yet the model depends on the seed alone."""
    models = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        folder = tmp_path / name
        folder.mkdir()
        learner = QLearner(dataclasses.replace(TINY, seed=seed), folder)
        learner.start()
        learner.learn()
        learner.save_model("model.npz")
        models.append((folder / "model.npz").read_bytes())
    assert models[0] == models[1] != models[2]


def test_q_function_learns_which_putts_hole_out(tmp_path: Path) -> None:
    """After some putts on one level, putts that hole out have a higher predicted probability to do so."""
    config = dataclasses.replace(
        TINY,
        total_timesteps=1_000_000,
        n_envs=8,
        buffer_size=20_000,
        replay_ratio=4.0,
        batch_size=128,
        num_levels=1,
        difficulties=("easy",),
    )
    learner = QLearner(config, tmp_path)
    learner.start()
    for _ in range(100):
        learner.buffer.add(*learner.collector.collect(learner.q_function))
        learner.update(4)
    features, targets = learner.collector.collect(learner.q_function)
    logits = learner.net(torch.from_numpy(features))[:, 0].detach().numpy()
    holed = targets[:, 0] > 0.0
    assert holed.any() and logits[holed].mean() > logits[~holed].mean() + 1.0


@pytest.mark.parametrize(
    ("invalid", "message"),
    [
        ({"reward": "strokes"}, "shaped"),
        ({"observation": "rays"}, "bounce_rays"),
        ({"difficulties": ("soft",)}, "difficulty"),
        ({"difficulty": "hard"}, "--difficulties"),
    ],
    ids=str,
)
def test_invalid_arguments_create_no_folder(invalid: dict[str, Any], message: str, tmp_path: Path) -> None:
    """Arguments are checked before anything is written."""
    with pytest.raises(SystemExit, match=message):
        train_generalist.main(dataclasses.replace(TINY, **invalid, out=tmp_path / "run"))
    assert not list(tmp_path.iterdir())


def test_damaged_run_ends_with_one_line(tmp_path: Path) -> None:
    """A truncated checkpoint, and initial weights of another network, are errors before anything changes."""
    train_generalist.main(dataclasses.replace(TINY, out=tmp_path / "run"))
    checkpoint = tmp_path / "run" / "checkpoint.pt"
    checkpoint.write_bytes(checkpoint.read_bytes()[:100])
    with pytest.raises(SystemExit, match=r"^resume: expected an intact model"):
        train_generalist.main(GeneralistConfig(resume=tmp_path / "run"))
    weights = tmp_path / "run" / "best.npz"
    config = dataclasses.replace(TINY, out=tmp_path / "new", net_arch=(3,), init_weights=weights)
    with pytest.raises(SystemExit, match=r"^init_weights: expected a model with layers .*--net-arch"):
        train_generalist.main(config)
    assert not (tmp_path / "new").exists()


def test_rllib_arguments_are_checked_before_ray_is_imported(tmp_path: Path) -> None:
    """A number out of its range is named where Ray is not installed, too."""
    for name, value in (("n_envs", 0), ("num_env_runners", 0), ("gamma", 2.0), ("num_learners", -1)):
        with pytest.raises(SystemExit, match=f"^{name}: expected a number"):
            train_rllib.main(dataclasses.replace(RLlibConfig(), out=tmp_path / "run", **{name: value}))
    assert not list(tmp_path.iterdir())
