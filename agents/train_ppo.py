"""Train stable-baselines3's PPO on a hole, and end with a table: random, search, PPO.

``python -m agents.train_ppo`` takes about two minutes on two cores; ``--resume runs/dogleg-1`` goes on after an
interruption; ``tensorboard --logdir runs`` shows how it went. What each setting is worth: docs/training.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecMonitor

from agents import runs
from minigolf_env.evaluation.evaluate import EvaluationResult

ENOUGH = 0.1
"""Mean strokes above search's with which a hole counts as learned."""

ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}


@dataclass(frozen=True)
class Settings(runs.Run):
    """What PPO is told, whoever's it is. Defaults are what worked best of what was tried."""

    n_steps: int = 1
    """Putts in each environment between two updates."""
    batch_size: int = 256
    n_epochs: int = 6
    target_kl: float = 0.1
    """How far an update may move the policy: it ends early then (RLlib: a penalty grows and shrinks accordingly)."""
    learning_rate: float = 2e-3
    """At the start; falls linearly to 0."""
    gamma: float = 0.5
    """The discount: with the shaped reward, a stroke's own part of it says nearly all."""
    gae_lambda: float = 0.5
    clip_range: float = 0.2
    log_std: tuple[float, float] = (-1.9, -5.0)
    """Log of the noise's standard deviation (shares of the top speed), first and, where it narrows on its way, last."""
    hidden: tuple[int, ...] = (64, 64)


@dataclass(frozen=True)
class Args(Settings):
    """The command line."""

    seeds: int = 1
    """Runs at most, each with the next seed, until one comes within 0.1 strokes of search: some may get stuck."""
    anneal: bool = False
    """Whether the noise narrows by ``log_std`` on a fixed way; else PPO learns it, from the first on."""
    ent_coef: float = 0.0
    """What a unit of the noise's entropy is worth, where PPO learns the noise."""
    activation: Literal["tanh", "relu"] = "tanh"


class Annealing(BaseCallback):
    """Narrows the noise that the policy explores with, on a fixed way from wide to narrow.

    Left to learn it from few updates, PPO may narrow it around the first putts that leave a tap-in, and never find the
    hole-in-one beside them. Wide noise blurs the landscape of scores; as the blur goes the policy stays on top.
    """

    def __init__(self, start: float, end: float, putts: int) -> None:
        super().__init__()
        self.start, self.end, self.putts = start, end, putts

    @property
    def log_std(self) -> torch.Tensor:
        """The policy's parameter (2,)."""
        return cast(torch.Tensor, self.model.policy.log_std)

    def _on_training_start(self) -> None:
        self.log_std.requires_grad_(False)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        share = min(1.0, self.num_timesteps / self.putts)
        self.log_std.data.fill_(self.start + share * (self.end - self.start))


def build(args: Args, envs: VecMonitor, policy: str = "MlpPolicy", **policy_kwargs: Any) -> PPO:
    """Return a new learner."""
    return PPO(
        policy,
        envs,
        learning_rate=LinearSchedule(args.learning_rate, 0.0, 1.0),
        n_steps=args.n_steps,
        batch_size=args.batch_size,
        n_epochs=args.n_epochs,
        target_kl=args.target_kl,
        gamma=args.gamma,
        gae_lambda=args.gae_lambda,
        clip_range=args.clip_range,
        ent_coef=args.ent_coef,
        policy_kwargs={
            "net_arch": list(args.hidden),
            "activation_fn": ACTIVATIONS[args.activation],
            "log_std_init": args.log_std[0],
            **policy_kwargs,
        },
        seed=args.seed,
        device="cpu",
    )


def callbacks(args: Args) -> Sequence[BaseCallback]:
    """Return what happens while it learns."""
    return [Annealing(*args.log_std, args.putts)] if args.anneal else []


def main(args: Args, build: runs.Build[Any] = build) -> list[EvaluationResult]:
    """Train, score, print the table; once more with the next seed if the hole is not learned and seeds are left."""
    if args.seeds > 1 and args.search_episodes == 0:
        raise SystemExit(f"seeds: expected 1 without search to compare with, received {args.seeds}; add --seeds 1.")
    scores = runs.run(args, build, callbacks)
    if args.seeds <= 1 or args.resume is not None:
        return scores
    behind = scores[-1].strokes - scores[-2].strokes
    if behind <= ENOUGH:
        return scores
    out = None if args.out is None else args.out.with_name(f"{args.out.name}-again")
    following = replace(args, seed=args.seed + 1, seeds=args.seeds - 1, out=out)
    runs.CONSOLE.print(f"Seed {args.seed} got stuck {behind:.2f} strokes above search: once more, with the next seed.")
    return main(following, build)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
