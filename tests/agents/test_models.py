"""Models that stable-baselines3 saved, as the package plays them, and the one that ships."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO, SAC

from agents import release_model as ship
from agents import train_generalist, train_ppo
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.players import policies
from minigolf_env.players.mlp import MLP, Layer
from minigolf_env.players.model_files import save_model
from minigolf_env.players.policies import ModelPolicy, SB3Policy, load_policy
from minigolf_env.players.putt_features import NUM_FEATURES
from minigolf_env.players.putt_value_model import PuttValueModel

ENV = "minigolf_env:MiniGolf-v0"
SMALL = {"n_steps": 8, "batch_size": 8}
TANH, RELU = torch.nn.Tanh, torch.nn.ReLU


@pytest.mark.parametrize(
    ("algorithm", "options"),
    [
        (PPO, SMALL),
        (PPO, {**SMALL, "policy_kwargs": {"net_arch": [16, 8, 8], "activation_fn": RELU, "log_std_init": -1.0}}),
        (PPO, {**SMALL, "policy_kwargs": {"net_arch": {"pi": [12], "vf": [3]}, "activation_fn": TANH}}),
        (SAC, {"policy_kwargs": {"net_arch": [16, 16]}}),
    ],
    ids=["PPO", "PPO relu", "PPO tanh", "SAC"],
)
@pytest.mark.parametrize("observation", ["state", "rays"])
def test_a_saved_model_plays_as_it_predicts(
    tmp_path: Path, algorithm: Any, options: dict[str, Any], observation: str
) -> None:
    """To float32 rounding, beyond the action space's edge too, single and batched, through either file."""
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


def test_other_networks_are_refused(tmp_path: Path) -> None:
    """A CNN's file says how to play it all the same; a model of other numbers says which are known."""
    PPO("CnnPolicy", gym.make(ENV, observation="pixels"), device="cpu", **SMALL).save(tmp_path / "cnn.zip")
    with pytest.raises(ValueError, match="SB3Policy"):
        ModelPolicy(tmp_path / "cnn.zip")
    PPO("MlpPolicy", gym.make("MountainCarContinuous-v0"), device="cpu", **SMALL).save(tmp_path / "car.zip")
    with pytest.raises(ValueError, match="2 outputs"):
        ModelPolicy(tmp_path / "car.zip")


def test_the_model_that_ships(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run's best becomes "ppo", with a card that says how to train it and what it scores; nothing else does."""
    run, shipped = tmp_path / "run", tmp_path / "models" / "dogleg.npz"
    run.mkdir()
    monkeypatch.setattr(policies, "PRETRAINED_FOLDER", shipped.parent)
    with pytest.raises(FileNotFoundError, match="train one"):
        load_policy("ppo")
    PPO("MlpPolicy", gym.make(ENV), seed=0, device="cpu", **SMALL).save(run / "best.zip")
    trained = train_ppo.Args(seed=7)
    (run / "args.json").write_text(json.dumps({**dataclasses.asdict(trained), "out": None, "resume": None}))
    ship.main(ship.Args(run, folder=shipped.parent, episodes=3))
    card = json.loads(shipped.with_suffix(".json").read_text())
    assert card["command"] == "python -m agents.train_ppo --seed 7"
    assert {"torch", "numpy", "minigolf_env"} <= set(card["versions"])
    policy = load_policy("ppo")
    assert json.loads(json.dumps(dataclasses.asdict(evaluate(policy, "ppo", episodes=3, quiet=True)))) in card["scores"]
    with shipped.open("ab") as file:
        file.write(b"x")
    with pytest.raises(ValueError, match="install again"):
        load_policy("ppo")


def test_a_generalist_ships(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With its own program's command, and a score on each difficulty, without noise and with it."""
    run, models = tmp_path / "run", tmp_path / "models"
    run.mkdir()
    monkeypatch.setattr(policies, "PRETRAINED_FOLDER", models)
    weights = np.random.default_rng(0).normal(size=(NUM_FEATURES, 2)).astype(np.float32)
    save_model(PuttValueModel(MLP((Layer(weights, np.zeros(2, np.float32)),))), run / "best.npz")
    trained = train_generalist.Args(seed=7)
    (run / "args.json").write_text(json.dumps({**dataclasses.asdict(trained), "out": None, "resume": None}))
    ship.main(ship.Args(run, folder=models, episodes=2))
    card = json.loads((models / "procedural.json").read_text())
    assert card["command"] == "python -m agents.train_generalist --seed 7"
    assert [score["difficulty"] for score in card["scores"]] == ["easy", "easy", "medium", "medium"]
    policy = load_policy("generalist")
    assert isinstance(policy, ModelPolicy) and policy.observation == "bounce_rays" and policy.sha256 == card["sha256"]
