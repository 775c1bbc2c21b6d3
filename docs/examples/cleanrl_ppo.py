"""PPO in one file, in the manner of CleanRL: ``python -m docs.examples.cleanrl_ppo``.

It plays the native batch of environments and needs torch besides the package. A putt's action is drawn around the
network's mean with noise that narrows on a fixed way (docs/training.md says why).
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
    """The command line."""

    course: str = "dogleg"
    putts: int = 200_000
    num_envs: int = 1024
    num_steps: int = 2
    """Putts of each environment between two updates."""
    epochs: int = 6
    batch: int = 512
    learning_rate: float = 2e-3
    """Falls linearly to 0."""
    gamma: float = 0.5
    gae_lambda: float = 0.5
    clip: float = 0.2
    value_weight: float = 0.5
    max_grad_norm: float = 0.5
    log_std: tuple[float, float] = (-1.9, -5.0)
    """Log of the noise's standard deviation, first and last, shares of the top speed."""
    seed: int = 0


class Agent(nn.Module):
    """A network for the mean putt and one for the value of a state."""

    def __init__(self, observations: int, actions: int) -> None:
        super().__init__()
        self.mean = layers(observations, actions, 0.01)
        self.value = layers(observations, 1, 1.0)

    def forward(self, seen: torch.Tensor, std: float) -> tuple[Normal, torch.Tensor]:
        """Return the distribution of putts (N, 2), and the values (N,), of observations (N, K)."""
        return Normal(self.mean(seen), std), self.value(seen).squeeze(-1)


def layers(inputs: int, outputs: int, scale: float) -> nn.Sequential:
    """Return a network of two hidden layers with orthogonal weights."""
    sizes, scales = (inputs, 64, 64, outputs), (2**0.5, 2**0.5, scale)
    parts: list[nn.Module] = []
    for i, gain in enumerate(scales):
        linear = nn.Linear(sizes[i], sizes[i + 1])
        nn.init.orthogonal_(linear.weight, gain)
        nn.init.zeros_(linear.bias)
        parts += [linear, nn.Tanh()]
    return nn.Sequential(*parts[:-1])


def advantages(rewards: torch.Tensor, values: torch.Tensor, over: torch.Tensor, args: Args) -> torch.Tensor:
    """Return the generalised advantage estimates (T, N); ``values`` (T + 1, N) has those after the last putt, too."""
    found, last = torch.zeros_like(rewards), torch.zeros_like(rewards[0])
    for t in reversed(range(len(rewards))):
        alive = 1.0 - over[t]
        delta = rewards[t] + args.gamma * alive * values[t + 1] - values[t]
        last = found[t] = delta + args.gamma * args.gae_lambda * alive * last
    return found


def update(agent: Agent, optimizer: torch.optim.Optimizer, data: list[torch.Tensor], std: float, args: Args) -> None:
    """Improve the agent by what it saw (N, K), played (N, 2), its log-probability, advantage and return (N,)."""
    for _ in range(args.epochs):
        for rows in torch.randperm(len(data[0])).split(args.batch):
            seen, putts, log_old, advantage, returned = (column[rows] for column in data)
            putt, value = agent(seen, std)
            ratio = (putt.log_prob(putts).sum(-1) - log_old).exp()
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            gain = torch.minimum(ratio * advantage, ratio.clamp(1 - args.clip, 1 + args.clip) * advantage).mean()
            loss = args.value_weight * (value - returned).square().mean() - gain
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), args.max_grad_norm)
            optimizer.step()


def play(
    envs: Any, agent: Agent, seen: torch.Tensor, std: float, args: Args
) -> tuple[list[torch.Tensor], torch.Tensor, float]:
    """Play putts from where the batch stands, seen as (N, K).

    Returns:
        The columns that ``update`` takes, what is seen now, and the share of putts that ended in the cup.
    """
    rows, holed = [], 0.0
    for _ in range(args.num_steps):
        with torch.no_grad():
            putt, value = agent(seen, std)
            action = putt.sample()
        after, reward, terminated, _, infos = envs.step(action.clamp(-1, 1).numpy())
        over, log = torch.as_tensor(terminated), putt.log_prob(action).sum(-1)
        rows.append((seen, action, log, torch.as_tensor(reward).float(), over.float(), value))
        seen = torch.as_tensor(after)
        if over.any():  # What the episode ended with; "is_success" itself is of the new one.
            holed += float(np.mean(infos["final_info"]["is_success"])) / args.num_steps
    saw, played, logs, rewards, ends, values = (torch.stack(column) for column in zip(*rows, strict=True))
    with torch.no_grad():
        values = torch.cat([values, agent(seen, std)[1][None]])
    advantage = advantages(rewards, values, ends, args)
    columns = [saw, played, logs, advantage, advantage + values[:-1]]
    return [column.flatten(0, 1) for column in columns], seen, holed


def main(args: Args) -> list[float]:
    """Train and print how it goes; return the share of putts that ended in the cup, tenth by tenth of the way."""
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)  # The networks are tiny: a second thread would mostly wait.
    # SameStep: after an episode's last putt the next observation is already that of the new episode.
    envs: Any = gym.make_vec("MiniGolf-v0", args.num_envs, course=args.course, autoreset_mode="SameStep")
    agent = Agent(envs.single_observation_space.shape[0], envs.single_action_space.shape[0])
    optimizer = torch.optim.Adam(agent.parameters(), args.learning_rate, eps=1e-5)
    seen = torch.as_tensor(envs.reset(seed=args.seed)[0])
    rounds = max(1, args.putts // (args.num_envs * args.num_steps))
    shares, holed, began = [], [], time.monotonic()
    for n in range(rounds):
        wide, narrow = args.log_std
        std = float(np.exp(wide + n / rounds * (narrow - wide)))
        optimizer.param_groups[0]["lr"] = args.learning_rate * (1 - n / rounds)
        data, seen, share = play(envs, agent, seen, std, args)
        update(agent, optimizer, data, std, args)
        holed.append(share)
        if (n + 1) * 10 // rounds > n * 10 // rounds:
            shares.append(float(np.mean(holed)))
            holed.clear()
            putts = (n + 1) * args.num_envs * args.num_steps
            print(f"{putts:>8,} putts, {time.monotonic() - began:3.0f} s: {shares[-1]:.0%} of putts hole out")
    envs.close()
    return shares


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
