"""Measure the overhead of the vector environment: ``python -m benchmarks.batch``.

- A step is compared with ``World.simulate_batch`` of the same putts, the two in turn. Putts are random, or have length
  0, for which the physics has nothing to do. Episodes have ten strokes, or so many that none ends.
- Then follow the cost of stable-baselines3's adapter and VecMonitor, of ``get_state``, ``set_state`` and ``what_if``,
  and the memory of environments.

Times are CPU time on one thread, medians.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numba
import numpy as np
import tyro
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecMonitor

from agents.sb3_vec_env import SB3VecEnv
from benchmarks.report import format_rate, print_table
from benchmarks.timing import cpu_seconds
from minigolf_env.envs import MiniGolfVectorEnv
from minigolf_env.envs.task import MAX_PUTT_TIME
from minigolf_env.physics import WorldBatch

ENDLESS_EPISODE_STROKES = 1_000_000
"""Stroke limit of an episode that does not end during a measurement."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    envs: int = 2048
    """Number of environments."""
    rounds: int = 40
    """Number of pairs of a step and its putts; ten times as many with putts of length 0."""
    large: int = 8192
    """Number of environments whose memory is measured."""


class StepCost(NamedTuple):
    """CPU time of a step, s."""

    step: float
    """Median time of a step."""
    best: float
    """Shortest time of a step."""
    physics: float
    """Median time of its putts in simulate_batch."""
    ratio: float
    """Median ratio of a step to its putts."""
    overhead: float
    """Median difference of a step and its putts."""


def measure_steps(args: Args, idle: bool, **options: Any) -> StepCost:
    """Measure steps and their putts, the two in turn."""
    envs = MiniGolfVectorEnv(args.envs, **options)
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    times = []
    for _ in range(args.rounds * (10 if idle else 1)):
        putts = np.zeros((args.envs, 2)) if idle else rng.uniform(-1, 1, (args.envs, 2))
        # With SameStep every environment plays in every step.
        starts = np.array([state["position"] for state in envs.get_state()])
        velocities = envs.task_batch.launch_velocity(putts)
        world = WorldBatch([task.world for task in envs.task_batch.tasks])
        physics = cpu_seconds(lambda: world.simulate_batch(starts, velocities, MAX_PUTT_TIME))  # noqa: B023 (called at once)
        step = cpu_seconds(lambda: envs.step(putts))  # noqa: B023
        times.append((step, physics, step / physics, step - physics))
    step, physics, ratio, overhead = (statistics.median(column) for column in zip(*times, strict=True))
    return StepCost(step, min(times)[0], physics, ratio, overhead)


def print_step_cost(args: Args) -> None:
    """Print the cost of a step compared with its putts."""
    kinds: dict[str, tuple[bool, dict[str, Any]]] = {
        "random putts": (False, {}),
        "random putts, rays": (False, {"observation": "rays"}),
        "random putts with noise": (False, {"putt_noise": (0.5, 0.015)}),
        "random putts, easy levels": (False, {"course": "procedural"}),
        "putts of length 0, ten per episode": (True, {}),
        "putts of length 0, no episode ends": (True, {"max_strokes": ENDLESS_EPISODE_STROKES}),
    }
    rows = []
    for name, (idle, options) in kinds.items():
        cost = measure_steps(args, idle, autoreset_mode="SameStep", **options)
        rates = [format_rate(args.envs / value) for value in cost[:3]]
        rows.append([name, *rates, f"{cost.ratio:.2f}", f"{cost.overhead / args.envs * 1e6:.2f}"])
    print_table(["step", "steps/s", "best steps/s", "simulate_batch/s", "ratio", "overhead, us per putt"], rows)


def print_adapter_cost(args: Args) -> None:
    """Print the cost of stable-baselines3's adapter and monitor, with putts of length 0 in episodes of ten."""
    envs = [MiniGolfVectorEnv(args.envs, autoreset_mode="SameStep") for _ in range(3)]
    putts: NDArray[np.float32] = np.zeros((args.envs, 2), np.float32)
    stacks: dict[str, Any] = {
        "the batch": envs[0],
        "+ SB3VecEnv": SB3VecEnv(envs[1]),
        "+ VecMonitor": VecMonitor(SB3VecEnv(envs[2])),
    }
    times: dict[str, list[float]] = {name: [] for name in stacks}
    for stack in stacks.values():
        stack.reset()
    for _ in range(args.rounds):  # Ten steps in turn, so that each has the same number of episode ends.
        for name, stack in stacks.items():
            times[name].append(cpu_seconds(lambda: [stack.step(putts) for _ in range(10)]) / 10)  # noqa: B023
    base = statistics.median(times["the batch"])
    medians = {name: statistics.median(values) for name, values in times.items()}
    rows = [[name, f"{value * 1e3:.2f}", f"{(value - base) / args.envs * 1e6:.2f}"] for name, value in medians.items()]
    print_table(["stack", "ms per step", "added, us per putt"], rows)


def print_state_cost(args: Args) -> None:
    """Print the time of get_state, set_state and what_if."""
    envs = MiniGolfVectorEnv(args.envs)
    envs.reset(seed=0)
    state = envs.get_state()
    putts = np.random.default_rng(0).uniform(-1, 1, (16, 2))
    calls: dict[str, tuple[Callable[[], Any], int]] = {
        "get_state": (envs.get_state, args.envs),
        "set_state": (lambda: envs.set_state(state), args.envs),
        "what_if of 16 putts, per putt": (lambda: envs.what_if(putts), 16 * args.envs),
    }
    rows = []
    for name, (call, count) in calls.items():
        rows.append([name, f"{statistics.median(cpu_seconds(call) for _ in range(3)) / count * 1e6:.1f}"])
    print_table(["call", "us per environment"], rows)


def print_memory(args: Args) -> None:
    """Print the peak memory of a process with many environments after 20 steps."""
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
    print_table(["environments", "peak memory"], rows)


def main(args: Args) -> None:
    """Print the tables."""
    numba.set_num_threads(1)
    print_step_cost(args)
    print_adapter_cost(args)
    print_state_cost(args)
    print_memory(args)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
