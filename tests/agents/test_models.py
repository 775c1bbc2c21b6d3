"""Models saved by stable-baselines3 as the package plays them, and the release of pretrained models."""

from __future__ import annotations

import dataclasses
import importlib
import json
import shlex
from pathlib import Path
from typing import Any, get_type_hints

import gymnasium as gym
import numpy as np
import pytest
import torch
import tyro
from stable_baselines3 import PPO, SAC

from agents import release_model
from agents.release_model import ReleaseConfig
from agents.train_generalist import GeneralistConfig
from agents.train_ppo import PPOConfig
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.players import policies
from minigolf_env.players.mlp import MLP, Layer
from minigolf_env.players.model_files import save_model
from minigolf_env.players.policies import PRETRAINED_FOLDER, ModelPolicy, SB3Policy, load_policy
from minigolf_env.players.putt_features import NUM_FEATURES
from minigolf_env.players.putt_value_model import PuttValueModel

ENV = "minigolf_env:MiniGolf-v0"
TINY_ROLLOUT = {"n_steps": 8, "batch_size": 8}
TANH = torch.nn.Tanh
RELU = torch.nn.ReLU


@pytest.mark.parametrize(
    ("algorithm", "options"),
    [
        (PPO, TINY_ROLLOUT),
        (
            PPO,
            {**TINY_ROLLOUT, "policy_kwargs": {"net_arch": [16, 8, 8], "activation_fn": RELU, "log_std_init": -1.0}},
        ),
        (PPO, {**TINY_ROLLOUT, "policy_kwargs": {"net_arch": {"pi": [12], "vf": [3]}, "activation_fn": TANH}}),
        (SAC, {"policy_kwargs": {"net_arch": [16, 16]}}),
    ],
    ids=["PPO", "PPO relu", "PPO tanh", "SAC"],
)
@pytest.mark.parametrize("observation", ["state", "rays"])
def test_saved_model_plays_as_it_predicts(
    tmp_path: Path, algorithm: Any, options: dict[str, Any], observation: str
) -> None:
    """Policies of both file formats, single and batched, agree with ``predict`` to float32 rounding.

    This includes outputs beyond the bounds of the action space.
    """
    model = algorithm("MlpPolicy", gym.make(ENV, observation=observation), seed=0, device="cpu", **options)
    for weights in model.policy.parameters():
        torch.nn.init.normal_(weights, std=0.5)
    model.save(tmp_path / "model.zip")
    policy = ModelPolicy(tmp_path / "model.zip")
    save_model(policy.model, tmp_path / "model.npz")
    assert policy.observation == observation
    observations = np.random.default_rng(0).uniform(-1, 1, (50, policy.model.mlp.num_inputs)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    putts = policy.act_batch(observations)
    assert np.abs(expected).max() > 0.9 and np.abs(putts - expected).max() < 1e-4
    assert np.abs(SB3Policy(model, observation).act_batch(observations) - expected).max() < 1e-6
    assert ModelPolicy(tmp_path / "model.npz").act_batch(observations).tobytes() == putts.tobytes()
    env: Any = None
    assert all(policy.act(row, env).tobytes() == putt.tobytes() for row, putt in zip(observations, putts, strict=True))


def test_rejects_models_of_other_networks(tmp_path: Path) -> None:
    """For a CNN the message names the policy that plays it; for other observations it lists the known ones."""
    PPO("CnnPolicy", gym.make(ENV, observation="pixels"), device="cpu", **TINY_ROLLOUT).save(tmp_path / "cnn.zip")
    with pytest.raises(ValueError, match="SB3Policy"):
        ModelPolicy(tmp_path / "cnn.zip")
    PPO("MlpPolicy", gym.make("MountainCarContinuous-v0"), device="cpu", **TINY_ROLLOUT).save(tmp_path / "car.zip")
    with pytest.raises(ValueError, match="2 outputs"):
        ModelPolicy(tmp_path / "car.zip")


def test_release_of_ppo_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The best model of a run becomes policy "ppo", with its command and scores; a changed file is rejected."""
    run = tmp_path / "run"
    released = tmp_path / "models" / "dogleg.npz"
    run.mkdir()
    monkeypatch.setattr(policies, "PRETRAINED_FOLDER", released.parent)
    with pytest.raises(FileNotFoundError, match="train one"):
        load_policy("ppo")
    PPO("MlpPolicy", gym.make(ENV), seed=0, device="cpu", **TINY_ROLLOUT).save(run / "best.zip")
    config = PPOConfig(seed=7)
    (run / "config.json").write_text(json.dumps({**dataclasses.asdict(config), "out": None, "resume": None}))
    release_model.main(ReleaseConfig(run, folder=released.parent, n_episodes=3))
    card = json.loads(released.with_suffix(".json").read_text())
    assert card["command"] == "python -m agents.train_ppo --seed 7"
    assert {"torch", "numpy", "minigolf_env"} <= set(card["versions"])
    policy = load_policy("ppo")
    assert json.loads(json.dumps(dataclasses.asdict(evaluate(policy, "ppo", episodes=3, quiet=True)))) in card["scores"]
    with released.open("ab") as file:
        file.write(b"x")
    with pytest.raises(ValueError, match="install again"):
        load_policy("ppo")


def test_release_of_generalist(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The card has the command of its own program, and a score on each difficulty, without putt noise and with it."""
    run = tmp_path / "run"
    models = tmp_path / "models"
    run.mkdir()
    monkeypatch.setattr(policies, "PRETRAINED_FOLDER", models)
    weights = np.random.default_rng(0).normal(size=(NUM_FEATURES, 2)).astype(np.float32)
    save_model(PuttValueModel(MLP((Layer(weights, np.zeros(2, np.float32)),))), run / "best.npz")
    config = GeneralistConfig(seed=7)
    (run / "config.json").write_text(json.dumps({**dataclasses.asdict(config), "out": None, "resume": None}))
    release_model.main(ReleaseConfig(run, folder=models, n_episodes=2))
    card = json.loads((models / "procedural.json").read_text())
    assert card["command"] == "python -m agents.train_generalist --seed 7"
    assert [score["difficulty"] for score in card["scores"]] == ["easy", "easy", "medium", "medium"]
    policy = load_policy("generalist")
    assert isinstance(policy, ModelPolicy) and policy.observation == "bounce_rays" and policy.sha256 == card["sha256"]


@pytest.mark.parametrize("path", sorted(PRETRAINED_FOLDER.glob("*.json")), ids=lambda path: path.name)
def test_command_of_model_card_is_accepted(path: Path) -> None:
    """The training program parses the command on the card of each pretrained model."""
    _, _, module, *arguments = shlex.split(json.loads(path.read_text())["command"])
    config_class = get_type_hints(importlib.import_module(module).main)["config"]
    assert isinstance(tyro.cli(config_class, args=arguments), config_class)
