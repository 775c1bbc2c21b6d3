"""Check that a long-running process does not grow. Run: python -m tools.endurance (make endurance); half an hour.

Plays 10^7 putts in batches, then makes, plays and closes 10,000 environments. Prints how many megabytes, file
descriptors and threads the process gained after the first tenth of each. Ends with an error if it gained a descriptor
or a thread, or more memory than ``MAX_GROWTH_MB``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import tyro
from tqdm import tqdm

from minigolf_env.envs import MiniGolfVectorEnv
from tests.rendering.leaks import Growth, growth

MAX_GROWTH_MB = 16.0
"""Megabytes that allocators may keep in addition to what they kept after the first tenth."""

BATCH_SIZE = 1024
"""Number of environments in a batch."""

ENV_OPTIONS: tuple[dict[str, Any], ...] = (
    {"course": "dogleg", "putt_noise": (0.5, 0.015)},
    {"course": "round", "reward": "strokes"},
    {"course": "procedural", "num_levels": 50, "observation": "rays"},
)
"""Keyword arguments of the environments, used in turn."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    putts: int = 10**7
    """Number of putts."""
    environments: int = 10_000
    """Number of environments to make."""


def measure_putts(putts: int) -> tuple[Growth, float]:
    """Play random putts in batches; return the process's growth and how many hours of ball time were simulated."""
    rng = np.random.default_rng(0)
    batches = [MiniGolfVectorEnv(BATCH_SIZE, **options) for options in ENV_OPTIONS]
    for batch in batches:
        batch.reset(seed=0)
    seconds = 0.0
    with tqdm(total=putts, unit=" putts", leave=False, disable=None) as bar:

        def step_batch(k: int) -> None:
            nonlocal seconds
            infos = batches[k % len(batches)].step(rng.uniform(-1.0, 1.0, (BATCH_SIZE, 2)))[4]
            seconds += float(infos["shot_time"].sum())
            bar.update(BATCH_SIZE)

        return growth(step_batch, -(-putts // BATCH_SIZE)), seconds / 3600.0


def measure_environments(count: int) -> Growth:
    """Make, play and close environments, single ones and batches in turn; return the process's growth."""

    def use_environment(k: int) -> None:
        options = ENV_OPTIONS[k % len(ENV_OPTIONS)]
        env = gym.make("MiniGolf-v0", **options) if k % 2 else gym.make_vec("MiniGolf-v0", num_envs=3, **options)
        env.reset(seed=k)
        env.step(env.action_space.sample())
        env.close()

    return growth(use_environment, count)


def exceeds_limits(grown: Growth) -> bool:
    """Return whether the growth would exhaust a machine's memory, descriptors or threads in the long run."""
    return grown.megabytes > MAX_GROWTH_MB or grown.descriptors > 0 or grown.threads > 0


def main(args: Args) -> int:
    """Print the growth; return 1 if it exceeds the limits."""
    putts, hours = measure_putts(args.putts)
    print(f"{args.putts:,} putts, {hours:,.0f} hours of ball time: {putts}", flush=True)
    environments = measure_environments(args.environments)
    print(f"{args.environments:,} environments: {environments}")
    return int(exceeds_limits(putts) or exceeds_limits(environments))


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
