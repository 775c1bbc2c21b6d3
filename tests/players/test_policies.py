"""Players behind one interface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.evaluation.rollout import run_episodes_batched
from minigolf_env.players.network import Layer, Network
from minigolf_env.players.policies import ModelPolicy, RandomPolicy, load_policy
from minigolf_env.players.putt_features import NUMBERS


def test_random_putts_fill_the_disc_evenly() -> None:
    """Uniform in the disc: the mean squared length is 1/2, no direction is preferred, and a seed repeats them."""
    env = MiniGolfEnv()
    observation, _ = env.reset(seed=0)
    policy = RandomPolicy(seed=1)
    putts = np.array([policy.act(observation, env) for _ in range(4000)])
    lengths = np.hypot(*putts.T)
    assert lengths.max() <= 1.0 + 1e-6
    assert (lengths**2).mean() == pytest.approx(0.5, abs=0.03)
    assert np.abs(putts.mean(axis=0)).max() < 0.03
    assert np.array_equal(putts[0], RandomPolicy(seed=1).act(observation, env))


def test_a_judge_of_other_numbers_is_refused(tmp_path: Path) -> None:
    """It learned from another version's sights; and a judge plays by echoes, alone as in a batch."""
    for inputs in (NUMBERS, NUMBERS + 1):
        weights = np.random.default_rng(0).normal(size=(inputs, 2)).astype(np.float32)
        Network((Layer(weights, np.zeros(2, np.float32)),), judges=True).save(tmp_path / f"{inputs}.npz")
    with pytest.raises(ValueError, match=f"judge of {NUMBERS} numbers, received one of {NUMBERS + 1}"):
        load_policy(tmp_path / f"{NUMBERS + 1}.npz")
    policy = ModelPolicy(tmp_path / f"{NUMBERS}.npz")
    assert policy.observation == "bounce_rays"
    env = MiniGolfEnv(observation="bounce_rays")
    seen = np.array([env.reset(seed=seed)[0] for seed in range(3)])
    putts = policy.act_batch(seen)
    assert np.abs(putts).max() <= 1.0
    assert all(policy.act(row, env).tobytes() == putt.tobytes() for row, putt in zip(seen, putts, strict=True))


def test_the_generalist_plays_levels_it_has_never_seen() -> None:
    """Well below the strokes of two putts on each."""
    policy = load_policy("generalist")
    assert isinstance(policy, ModelPolicy)
    envs = MiniGolfVectorEnv(30, "procedural", difficulty="easy", observation="bounce_rays", tee="fixed", num_levels=1)
    played = run_episodes_batched(envs, policy, None, {"level": list(range(2_000_000, 2_000_030))})
    assert all(episode.holed for episode in played)
    assert np.mean([episode.strokes for episode in played]) < 1.9


def test_unknown_players_are_refused(tmp_path: Path) -> None:
    """The error guesses the name, or says that the file is not there."""
    with pytest.raises(ValueError, match="did you mean 'search'"):
        load_policy("serch")
    with pytest.raises(FileNotFoundError, match=r"\.zip"):
        load_policy(tmp_path / "model.zip")
