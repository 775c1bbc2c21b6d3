"""Rollouts: play whole episodes with a policy, one at a time or in a batch."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.players.policies import BatchPolicy, Policy
from minigolf_env.players.search import search


class EpisodeResult(NamedTuple):
    """The result of one episode."""

    strokes: int
    """Number of strokes of the episode."""
    holed: bool
    """True if the ball is in the cup at the end."""


def run_episode(
    env: gym.Env[Any, Any], policy: Policy, seed: int | None, options: dict[str, Any] | None = None
) -> EpisodeResult:
    """Reset the environment with a seed and options, play one episode with a policy and return its result."""
    observation, info = env.reset(seed=seed, options=options)
    done = False
    while not done:
        action = policy.act(observation, cast(MiniGolfEnv, env.unwrapped))
        observation, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    return EpisodeResult(info["strokes"], info["is_success"])


def run_episodes_batched(
    envs: MiniGolfVectorEnv, policy: BatchPolicy, seed: int | None, options: dict[str, Any] | None = None
) -> list[EpisodeResult]:
    """Play one episode in each environment of a NextStep batch and return the results.

    The batch is reset with the seed and options. The episode of environment i equals that of ``run_episode`` with the
    seed ``seed + i``.
    """
    observations, _ = envs.reset(seed=seed, options=options)
    strokes = np.zeros(envs.num_envs, np.int64)
    holed, done = np.zeros((2, envs.num_envs), np.bool_)
    while not done.all():
        # Environments whose episode has ended play on without being counted; a putt of length 0 costs no time.
        actions = np.where(done[:, None], np.float32(0.0), policy.act_batch(observations))
        observations, _, terminated, truncated, infos = envs.step(actions)
        ended = (terminated | truncated) & ~done
        strokes[ended] = infos["strokes"][ended]
        holed[ended] = infos["is_success"][ended]
        done |= ended
    return [EpisodeResult(*episode) for episode in zip(strokes.tolist(), holed.tolist(), strict=True)]


def search_strokes(env: MiniGolfEnv) -> int:
    """Play the current episode to its end with search and return its number of strokes."""
    done = False
    while not done:
        _, _, done, _, info = env.step(search(env).action)
    return int(info["strokes"])
