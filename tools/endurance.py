"""Does the package tire? ``python -m tools.endurance`` (make endurance): 10^7 putts, 10,000 environments, half an hour.

Prints how many megabytes, file descriptors and threads the process gained after the first tenth of each. Ends with an
error if it gained a descriptor or a thread, or more memory than ``ALLOWED``.
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

ALLOWED = 16.0
"""Megabytes that allocators may keep beyond what they kept after the first tenth."""

ENVIRONMENTS = 1024
"""Of a batch."""

GAMES: tuple[dict[str, Any], ...] = (
    {"course": "dogleg", "putt_noise": (0.5, 0.015)},
    {"course": "round", "reward": "strokes"},
    {"course": "procedural", "num_levels": 50, "observation": "rays"},
)
"""Played by turns."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    putts: int = 10**7
    environments: int = 10_000


def putt(times: int) -> tuple[Growth, float]:
    """Return what random putts in batches gain, and for how many hours the balls rolled."""
    rng, batches = np.random.default_rng(0), [MiniGolfVectorEnv(ENVIRONMENTS, **game) for game in GAMES]
    for batch in batches:
        batch.reset(seed=0)
    rolled = np.zeros(1)
    with tqdm(total=times, unit=" putts", leave=False, disable=None) as bar:

        def act(k: int) -> None:
            infos = batches[k % len(batches)].step(rng.uniform(-1.0, 1.0, (ENVIRONMENTS, 2)))[4]
            rolled[0] += infos["shot_time"].sum()
            bar.update(ENVIRONMENTS)

        return growth(act, -(-times // ENVIRONMENTS)), float(rolled[0]) / 3600.0


def create(times: int) -> Growth:
    """Return what making, playing and closing environments gains, single ones and batches by turns."""

    def act(k: int) -> None:
        game = GAMES[k % len(GAMES)]
        env = gym.make("MiniGolf-v0", **game) if k % 2 else gym.make_vec("MiniGolf-v0", num_envs=3, **game)
        env.reset(seed=k)
        env.step(env.action_space.sample())
        env.close()

    return growth(act, times)


def too_much(grown: Growth) -> bool:
    """Return whether a process that does the same on and on would end."""
    return grown.megabytes > ALLOWED or grown.descriptors > 0 or grown.threads > 0


def main(args: Args) -> int:
    """Print what was gained; return 1 if that is too much."""
    putts, hours = putt(args.putts)
    print(f"{args.putts:,} putts, the balls rolled for {hours:,.0f} hours: {putts}", flush=True)
    environments = create(args.environments)
    print(f"{args.environments:,} environments: {environments}")
    return int(any(too_much(grown) for grown in (putts, environments)))


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
