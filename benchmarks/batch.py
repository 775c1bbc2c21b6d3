"""What does the batch cost besides its putts? Run: ``python -m benchmarks.batch``.

The step of the vector environment beside ``World.simulate_batch`` of the same putts, the two in turn, on random putts
and on putts of length 0, with which the physics is idle; with episodes of ten strokes and of a million, which never
begin anew; then what stable-baselines3's adapter and its VecMonitor add; what a state, and putts that are only
imagined, take; and how much memory environments need. Processor time on one thread, medians.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numba
import numpy as np
import tyro
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecMonitor

from agents.sb3_vec_env import SB3VecEnv
from benchmarks.report import print_table, short
from minigolf_env.envs import MiniGolfVectorEnv
from minigolf_env.envs.task import MAX_PUTT_TIME

NEVER = 1_000_000
"""Strokes of an episode that does not end in time."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    envs: int = 2048
    rounds: int = 40
    """Of a step and the same putts without it; with idle physics ten times as many."""
    large: int = 8192
    """Environments whose memory is measured."""


def seconds(call: Callable[[], Any]) -> float:
    """Return the processor time of a call, s."""
    began = time.process_time()
    call()
    return time.process_time() - began


class Cost(NamedTuple):
    """What a step takes, s of processor time."""

    whole: float
    """Median."""
    best: float
    """The least: with nobody else on the machine."""
    alone: float
    """Its putts in simulate_batch, median."""
    ratio: float
    """Of step and putts, the median of all rounds."""
    own: float
    """Their difference, the median of all rounds."""


def steps(args: Args, idle: bool, **options: Any) -> Cost:
    """Return what steps cost beside their putts, the two in turn."""
    envs = MiniGolfVectorEnv(args.envs, **options)
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    times = []
    for _ in range(args.rounds * (10 if idle else 1)):
        putts = np.zeros((args.envs, 2)) if idle else rng.uniform(-1, 1, (args.envs, 2))
        # With SameStep every environment plays in every step.
        starts = np.array([state["position"] for state in envs.get_state()])
        velocities, world = envs.task_batch.launch_velocity(putts), envs.task_batch.world
        alone = seconds(lambda: world.simulate_batch(starts, velocities, MAX_PUTT_TIME))  # noqa: B023 (called at once)
        whole = seconds(lambda: envs.step(putts))  # noqa: B023
        times.append((whole, alone, whole / alone, whole - alone))
    whole, alone, ratio, own = (statistics.median(column) for column in zip(*times, strict=True))
    return Cost(whole, min(times)[0], alone, ratio, own)


def beside_the_physics(args: Args) -> None:
    """Print what a step costs beside its putts."""
    kinds: dict[str, tuple[bool, dict[str, Any]]] = {
        "random putts": (False, {}),
        "random putts, rays": (False, {"observation": "rays"}),
        "random putts with noise": (False, {"putt_noise": (0.5, 0.015)}),
        "random putts, easy levels": (False, {"course": "procedural"}),
        "putts of length 0, ten an episode": (True, {}),
        "putts of length 0, no episode ends": (True, {"max_strokes": NEVER}),
    }
    rows = []
    for name, (idle, options) in kinds.items():
        cost = steps(args, idle, autoreset_mode="SameStep", **options)
        rates = [short(args.envs / value) for value in cost[:3]]
        rows.append([name, *rates, f"{cost.ratio:.2f}", f"{cost.own / args.envs * 1e6:.2f}"])
    print_table(["step", "steps/s", "at best", "putts alone/s", "ratio", "own, us a putt"], rows)


def beside_the_batch(args: Args) -> None:
    """Print what stable-baselines3's side costs, all with putts of length 0 in episodes of ten."""
    made = [MiniGolfVectorEnv(args.envs, autoreset_mode="SameStep") for _ in range(3)]
    putts: NDArray[np.float32] = np.zeros((args.envs, 2), np.float32)
    players: dict[str, Any] = {
        "the batch": made[0],
        "+ SB3VecEnv": SB3VecEnv(made[1]),
        "+ VecMonitor": VecMonitor(SB3VecEnv(made[2])),
    }
    times: dict[str, list[float]] = {name: [] for name in players}
    for player in players.values():
        player.reset()
    for _ in range(args.rounds):  # In turn, and ten steps at a time, so that each has the same ends of episodes.
        for name, player in players.items():
            times[name].append(seconds(lambda: [player.step(putts) for _ in range(10)]) / 10)  # noqa: B023
    base = statistics.median(times["the batch"])
    medians = {name: statistics.median(values) for name, values in times.items()}
    cost = [[name, f"{value * 1e3:.2f}", f"{(value - base) / args.envs * 1e6:.2f}"] for name, value in medians.items()]
    print_table(["who steps", "ms a step", "more, us a putt"], cost)


def states(args: Args) -> None:
    """Print what states and imagined putts take."""
    envs = MiniGolfVectorEnv(args.envs)
    envs.reset(seed=0)
    kept = envs.get_state()
    putts = np.random.default_rng(0).uniform(-1, 1, (16, 2))
    calls: dict[str, tuple[Callable[[], Any], int]] = {
        "get_state": (envs.get_state, args.envs),
        "set_state": (lambda: envs.set_state(kept), args.envs),
        "what_if of 16 putts, a putt": (lambda: envs.what_if(putts), 16 * args.envs),
    }
    rows = []
    for name, (call, many) in calls.items():
        rows.append([name, f"{statistics.median(seconds(call) for _ in range(3)) / many * 1e6:.1f}"])
    print_table(["call", "us an environment"], rows)


def memory(args: Args) -> None:
    """Print the most memory that a process of many environments had, after 20 steps."""
    rows = []
    for course in ("dogleg", "procedural"):
        code = (
            "import resource, numpy as np; from minigolf_env.envs import MiniGolfVectorEnv; "
            f"envs = MiniGolfVectorEnv({args.large}, {course!r}, autoreset_mode='SameStep'); envs.reset(seed=0); "
            f"[envs.step(np.random.default_rng(k).uniform(-1, 1, ({args.large}, 2))) for k in range(20)]; "
            "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
        )
        kib = int(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
        rows.append([f"{args.large:,} on {course}", f"{kib / 1024:.0f} MiB"])
    print_table(["environments", "most memory"], rows)


def main(args: Args) -> None:
    """Print the tables."""
    numba.set_num_threads(1)
    beside_the_physics(args)
    beside_the_batch(args)
    states(args)
    memory(args)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
