"""Agents that see pictures: stable-baselines3's CNN policy takes them as they are."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

from agents.sb3_vec_env import SB3VecEnv

pytestmark = pytest.mark.usefixtures("gl")


def test_ppo_trains_on_pixels() -> None:
    """An update changes the network's eyes, and what it then plays is a putt."""
    batch = gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=4, autoreset_mode="SameStep", observation="pixels")
    envs = VecMonitor(SB3VecEnv(batch))
    model = PPO("CnnPolicy", envs, n_steps=4, batch_size=8, n_epochs=1, seed=0, device="cpu")
    eyes = next(model.policy.features_extractor.parameters())
    before = eyes.detach().clone()
    model.learn(16)
    assert torch.isfinite(eyes).all() and (eyes != before).any()
    observation = np.asarray(envs.reset())
    assert observation.shape == (4, 84, 84, 3) and observation.dtype == np.uint8
    action, _ = model.predict(observation, deterministic=True)
    assert envs.action_space.contains(action[0])
