"""PPO in one file, in the manner of CleanRL: ``python -m docs.examples.cleanrl_ppo``.

It trains on the vector environment and needs torch in addition to the package. Actions are drawn from a
normal distribution around the network's mean, whose standard deviation decreases on a fixed schedule (docs/training.md
gives the reason).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import torch
import tyro
from torch import nn
from torch.distributions import Normal

import minigolf_env  # noqa: F401 (importing registers MiniGolf-v0)


@dataclass(frozen=True)
class Args:
    """Command-line arguments."""

    course: str = "dogleg"
    putts: int = 200_000
    num_envs: int = 1024
    num_steps: int = 2
    """Number of putts in each environment between two updates."""
    epochs: int = 6
    batch: int = 512
    learning_rate: float = 2e-3
    """Initial learning rate; it decreases linearly to 0."""
    gamma: float = 0.5
    gae_lambda: float = 0.5
    clip: float = 0.2
    value_weight: float = 0.5
    max_grad_norm: float = 0.5
    log_std: tuple[float, float] = (-1.9, -5.0)
    """Logarithm of the actions' standard deviation at the start and at the end, as a share of the top speed."""
    seed: int = 0


class Agent(nn.Module):
    """Policy and value function: a network for the mean putt, and one for the value of a state."""

    def __init__(self, num_features: int, num_actions: int) -> None:
        super().__init__()
        self.mean = layers(num_features, num_actions, 0.01)
        self.value = layers(num_features, 1, 1.0)

    def forward(self, observations: torch.Tensor, std: float) -> tuple[Normal, torch.Tensor]:
        """Return the distribution of putts (N, 2) and the values (N,) for observations (N, K)."""
        return Normal(self.mean(observations), std), self.value(observations).squeeze(-1)


def layers(inputs: int, outputs: int, scale: float) -> nn.Sequential:
    """Return a network of two hidden layers with orthogonal weights."""
    sizes = (inputs, 64, 64, outputs)
    modules: list[nn.Module] = []
    for i, gain in enumerate((2**0.5, 2**0.5, scale)):
        linear = nn.Linear(sizes[i], sizes[i + 1])
        nn.init.orthogonal_(linear.weight, gain)
        nn.init.zeros_(linear.bias)
        modules += [linear, nn.Tanh()]
    return nn.Sequential(*modules[:-1])


def advantages(rewards: torch.Tensor, values: torch.Tensor, dones: torch.Tensor, args: Args) -> torch.Tensor:
    """Return the generalised advantage estimates (T, N); ``values`` (T + 1, N) includes those after the last putt."""
    estimates = torch.zeros_like(rewards)
    last = torch.zeros_like(rewards[0])
    for t in reversed(range(len(rewards))):
        not_done = 1.0 - dones[t]
        delta = rewards[t] + args.gamma * not_done * values[t + 1] - values[t]
        last = delta + args.gamma * args.gae_lambda * not_done * last
        estimates[t] = last
    return estimates


def update(agent: Agent, optimizer: torch.optim.Optimizer, data: list[torch.Tensor], std: float, args: Args) -> None:
    """Improve the agent by PPO.

    Args:
        agent: the agent.
        optimizer: of the agent's weights.
        data: observations (N, K), putts (N, 2), and their log-probabilities, advantages and returns (N,).
        std: standard deviation of the actions.
        args: the hyper-parameters.
    """
    for _ in range(args.epochs):
        for rows in torch.randperm(len(data[0])).split(args.batch):
            observations, putts, old_log_probs, advantage, returns = (column[rows] for column in data)
            distribution, values = agent(observations, std)
            ratio = (distribution.log_prob(putts).sum(-1) - old_log_probs).exp()
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            clipped = ratio.clamp(1 - args.clip, 1 + args.clip) * advantage
            policy_loss = -torch.minimum(ratio * advantage, clipped).mean()
            value_loss = (values - returns).square().mean()
            optimizer.zero_grad()
            (args.value_weight * value_loss + policy_loss).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), args.max_grad_norm)
            optimizer.step()


def collect_rollout(
    envs: Any, agent: Agent, observations: torch.Tensor, std: float, args: Args
) -> tuple[list[torch.Tensor], torch.Tensor, float]:
    """Play ``num_steps`` putts in every environment, from the present observations (N, K).

    Returns:
        The data that ``update`` takes, the next observations, and the share of putts that holed out.
    """
    steps, holed = [], 0.0
    for _ in range(args.num_steps):
        with torch.no_grad():
            distribution, values = agent(observations, std)
            putts = distribution.sample()
        next_observations, rewards, terminated, _, infos = envs.step(putts.clamp(-1, 1).numpy())
        dones = torch.as_tensor(terminated)
        log_probs = distribution.log_prob(putts).sum(-1)
        steps.append((observations, putts, log_probs, torch.as_tensor(rewards).float(), dones.float(), values))
        observations = torch.as_tensor(next_observations)
        if dones.any():  # "final_info" is of the episodes that ended; "is_success" itself is of the new ones.
            holed += float(np.mean(infos["final_info"]["is_success"])) / args.num_steps
    all_observations, all_putts, log_probs, rewards, dones, values = map(torch.stack, zip(*steps, strict=True))
    with torch.no_grad():
        values = torch.cat([values, agent(observations, std)[1][None]])
    advantage = advantages(rewards, values, dones, args)
    data = [all_observations, all_putts, log_probs, advantage, advantage + values[:-1]]
    return [column.flatten(0, 1) for column in data], observations, holed


def main(args: Args) -> list[float]:
    """Train and print the progress; return the share of putts that holed out in each tenth of the training."""
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)  # The networks are tiny: a second thread would mostly wait.
    # SameStep: after an episode's last putt the next observation is already that of the new episode.
    envs: Any = gym.make_vec("MiniGolf-v0", args.num_envs, course=args.course, autoreset_mode="SameStep")
    agent = Agent(envs.single_observation_space.shape[0], envs.single_action_space.shape[0])
    optimizer = torch.optim.Adam(agent.parameters(), args.learning_rate, eps=1e-5)
    observations = torch.as_tensor(envs.reset(seed=args.seed)[0])
    num_updates = max(1, args.putts // (args.num_envs * args.num_steps))
    shares: list[float] = []
    holed: list[float] = []
    start = time.monotonic()
    for n in range(num_updates):
        # Anneal the noise and the learning rate.
        first, last = args.log_std
        std = float(np.exp(first + n / num_updates * (last - first)))
        optimizer.param_groups[0]["lr"] = args.learning_rate * (1 - n / num_updates)
        # Play, and learn from it.
        data, observations, share = collect_rollout(envs, agent, observations, std, args)
        update(agent, optimizer, data, std, args)
        # Print the progress after each tenth of the updates.
        holed.append(share)
        if (n + 1) * 10 // num_updates > n * 10 // num_updates:
            shares.append(float(np.mean(holed)))
            holed.clear()
            putts = (n + 1) * args.num_envs * args.num_steps
            print(f"{putts:>8,} putts, {time.monotonic() - start:3.0f} s: {shares[-1]:.0%} of putts hole out")
    envs.close()
    return shares


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
