"""Policies: random, trained models, and loading by name."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.observations import OBSERVATIONS
from minigolf_env.evaluation.rollout import run_episodes_batched
from minigolf_env.players.mlp_policy import MLPPolicy
from minigolf_env.players.model_files import save_model
from minigolf_env.players.policies import (
    PRETRAINED_FOLDER,
    PRETRAINED_MODELS,
    ModelPolicy,
    RandomPolicy,
    SB3Policy,
    load_policy,
    warn_if_untrained,
)
from minigolf_env.players.putt_features import NUM_FEATURES
from minigolf_env.players.putt_value_model import PuttValueModel
from tests.players.samples import random_mlp


def test_random_policy_is_uniform_in_disc_and_reproducible() -> None:
    """The mean squared length is 1/2, no direction is preferred, and the same seed gives the same putts."""
    env = MiniGolfEnv()
    observation, _ = env.reset(seed=0)
    policy = RandomPolicy(seed=1)
    putts = np.array([policy.act(observation, env) for _ in range(4000)])
    lengths = np.hypot(*putts.T)
    assert lengths.max() <= 1.0 + 1e-6
    assert (lengths**2).mean() == pytest.approx(0.5, abs=0.03)
    assert np.abs(putts.mean(axis=0)).max() < 0.03
    assert np.array_equal(putts[0], RandomPolicy(seed=1).act(observation, env))


def test_rejects_value_model_with_wrong_number_of_features(tmp_path: Path) -> None:
    """A model with another number of features was trained on those of another version."""
    save_model(PuttValueModel(random_mlp(NUM_FEATURES + 1, 2)), tmp_path / "other.npz")
    with pytest.raises(ValueError, match=f"value model of {NUM_FEATURES} features, received {NUM_FEATURES + 1}"):
        load_policy(tmp_path / "other.npz")


def test_value_model_plays_same_putts_alone_and_in_batch(tmp_path: Path) -> None:
    """The policy needs bounce rays, and its putts are valid actions."""
    save_model(PuttValueModel(random_mlp(NUM_FEATURES, 2)), tmp_path / "value.npz")
    policy = ModelPolicy(tmp_path / "value.npz")
    assert policy.observation == "bounce_rays"
    env = MiniGolfEnv(observation="bounce_rays")
    observations = np.array([env.reset(seed=seed)[0] for seed in range(3)])
    putts = policy.act_batch(observations)
    assert np.abs(putts).max() <= 1.0
    assert all(policy.act(row, env).tobytes() == putt.tobytes() for row, putt in zip(observations, putts, strict=True))


def test_rejects_model_whose_observation_is_ambiguous(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A model's file holds only the number of its inputs: two observations of that shape could both be meant."""
    save_model(MLPPolicy(random_mlp(10, 2)), tmp_path / "model.npz")
    assert ModelPolicy(tmp_path / "model.npz").observation == "state"
    monkeypatch.setitem(OBSERVATIONS, "other", OBSERVATIONS["state"])
    with pytest.raises(ValueError, match=r"received \['state', 'other'\]"):
        ModelPolicy(tmp_path / "model.npz")


def test_pretrained_generalist_holes_out_on_unseen_levels() -> None:
    """The model that ships holes out on every level, in fewer than 1.9 strokes on average."""
    policy = load_policy("generalist")
    assert isinstance(policy, ModelPolicy)
    envs = MiniGolfVectorEnv(30, "procedural", difficulty="easy", observation="bounce_rays", tee="fixed", num_levels=1)
    results = run_episodes_batched(envs, policy, None, {"level": list(range(2_000_000, 2_000_030))})
    assert all(episode.holed for episode in results)
    assert np.mean([episode.strokes for episode in results]) < 1.9


def test_rejects_unknown_policy_names(tmp_path: Path) -> None:
    """The error suggests a name, or says that there is no such file."""
    with pytest.raises(ValueError, match="did you mean 'search'"):
        load_policy("serch")
    with pytest.raises(FileNotFoundError, match=r"\.zip"):
        load_policy(tmp_path / "model.zip")


def test_model_on_a_course_that_it_was_not_trained_on_is_a_warning(tmp_path: Path) -> None:
    """A model that observes no walls warns on other courses; its card or the configuration of its run names its own."""
    model = load_policy("ppo")
    with pytest.warns(UserWarning, match="trained on dogleg"):
        warn_if_untrained(model, "bank")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_if_untrained(model, "dogleg")
        warn_if_untrained(load_policy("search"), "bank")
        warn_if_untrained(load_policy("generalist"), "bank")
    file = tmp_path / "best_model.zip"
    shutil.copy(PRETRAINED_FOLDER / PRETRAINED_MODELS["ppo"], file.with_suffix(PRETRAINED_MODELS["ppo"][-4:]))
    (tmp_path / "config.json").write_text('{"course": "bank"}')
    copied = load_policy(next(tmp_path.glob("best_model*")))
    with pytest.warns(UserWarning, match="trained on bank"):
        warn_if_untrained(copied, "dogleg")


@pytest.mark.parametrize(
    ("trained_on", "played", "observation", "warns"),
    [
        ("dogleg", "bank", "rays", True),
        ("dogleg", "dogleg", "rays", False),
        ("round", "straight", "state", False),
        ("round", "volcano", "state", True),
        ("round", "volcano", "rays", False),
        ("procedural", "bank", "rays", False),
        ("procedural", "bank", "state", True),
    ],
)
def test_only_a_model_that_saw_walls_of_many_courses_plays_others_without_a_warning(
    tmp_path: Path, trained_on: str, played: str, observation: str, warns: bool
) -> None:
    """A round consists of its holes; one hole, or walls that were never observed, teach nothing about another."""
    (num_inputs,) = OBSERVATIONS[observation].space().shape or ()
    save_model(MLPPolicy(random_mlp(num_inputs, 2)), tmp_path / "best_model.npz")
    (tmp_path / "config.json").write_text(f'{{"course": "{trained_on}"}}')
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warn_if_untrained(load_policy(tmp_path / "best_model.npz"), played)
    assert [str(warning.message).partition(",")[0] for warning in caught] == [
        f"the model was trained on {trained_on}"
    ] * warns


def test_sb3_policy_checks_the_shape_of_its_observation() -> None:
    """A model that was trained on another observation is an error, not a crash in its network."""
    model = SimpleNamespace(observation_space=OBSERVATIONS["rays"].space(), predict=None)
    assert SB3Policy(model, "rays").observation == "rays"
    with pytest.raises(ValueError, match=r"of shape \(48,\), received 'state'"):
        SB3Policy(model, "state")
