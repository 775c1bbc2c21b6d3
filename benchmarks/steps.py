"""Measure steps of environments per second: ``python -m benchmarks.steps``.

1. By hole and by difficulty of levels: one environment, 8 through ``gym.make_vec``, and a large batch.
2. By observation: one environment and a batch, on one hole and on levels.
3. The parts of the time in which stable-baselines3's PPO trains, by observation.

Times are CPU time on one thread; what a row compares is measured in turn, and medians are printed. Batches have
autoreset mode "SameStep", and resets are part of their steps. Levels are played once before, so that all are built.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numba
import numpy as np
import torch
import tyro
from stable_baselines3 import PPO

from agents.train_pixels import PixelsConfig, make_pixel_model
from agents.train_ppo import PPOConfig, make_model
from agents.training_run import make_sb3_envs
from benchmarks.report import format_rate, print_table
from benchmarks.timing import cpu_seconds
from minigolf_env.courses import list_courses
from minigolf_env.courses.procedural import DIFFICULTY_NAMES
from minigolf_env.envs.config import ignore_unseen_levels
from minigolf_env.envs.observations import OBSERVATIONS

SMALL_BATCH = 8
"""Number of environments in the small batch."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    courses: tuple[str, ...] = (*list_courses(), *DIFFICULTY_NAMES)
    """Holes, and difficulties of levels, of the first table."""
    observed: tuple[str, ...] = ("dogleg", *DIFFICULTY_NAMES)
    """Holes, and difficulties of levels, whose observations are compared."""
    envs: int = 512
    """Number of environments in the large batch, and number of levels."""
    observed_envs: int = 64
    """Number of environments in the batch whose observations are compared."""
    rounds: int = 15
    """Number of measurements of which the median is printed."""
    single_steps: int = 200
    """Number of steps of one environment in a measurement."""
    rollouts: int = 3
    """Number of rollouts of PPO, each with its update, in the measurement of training."""


def single_step_seconds(env: gym.Env[Any, Any], rng: np.random.Generator, steps: int) -> float:
    """Return the mean CPU time of ``env.unwrapped.step`` with random putts, s; resets are left out."""
    minigolf = env.unwrapped
    total = 0.0
    for putt in rng.uniform(-1, 1, (steps, 2)):
        start = time.process_time()
        ended = minigolf.step(putt)[2]
        total += time.process_time() - start
        if ended:
            minigolf.reset()
    return total / steps


def batch_step_seconds(envs: gym.vector.VectorEnv[Any, Any, Any], rng: np.random.Generator, steps: int) -> float:
    """Return the mean CPU time of a step with random putts for each environment, s."""
    putts = rng.uniform(-1, 1, (steps, envs.num_envs, 2))
    return cpu_seconds(lambda: [envs.step(row) for row in putts]) / (steps * envs.num_envs)


def measure(args: Args, batch_sizes: tuple[int, ...], **options: Any) -> list[float]:
    """Return median CPU times of a step for each environment, s: of one environment, and of batches, in turn."""
    rng = np.random.default_rng(0)
    env = gym.make("minigolf_env:MiniGolf-v0", **options)
    env.reset(seed=0)
    batches = []
    for size in batch_sizes:
        batches.append(gym.make_vec("MiniGolf-v0", num_envs=size, autoreset_mode="SameStep", **options))
        batches[-1].reset(seed=0)
    calls: list[Callable[[], float]] = [lambda: single_step_seconds(env, rng, args.single_steps)]
    for envs in batches:
        steps = max(1, 2 * args.single_steps // envs.num_envs)
        calls.append(lambda envs=envs, steps=steps: batch_step_seconds(envs, rng, steps))
    for call in calls:  # Compile the kernels.
        call()
    rounds = [[call() for call in calls] for _ in range(args.rounds)]
    return [statistics.median(column) for column in zip(*rounds, strict=True)]


def course_options(args: Args, name: str) -> dict[str, Any]:
    """Return the arguments of environments on a hole, or on levels of a difficulty, after building those levels."""
    if name not in DIFFICULTY_NAMES:
        return {"course": name}
    options = {"course": "procedural", "difficulty": name, "num_levels": args.envs}
    env = gym.make("minigolf_env:MiniGolf-v0", **options)
    for level in range(args.envs):
        env.reset(options={"level": level})
    return options


def print_hole_rates(args: Args) -> None:
    """Print steps per second by hole and difficulty."""
    rows = []
    for name in args.courses:
        single, small, large = measure(args, (SMALL_BATCH, args.envs), **course_options(args, name))
        title = f"{name} levels" if name in DIFFICULTY_NAMES else name
        rates = [format_rate(1.0 / seconds) for seconds in (single, small, large)]
        rows.append([title, *rates, f"{single / large:.1f}", f"{small / large:.1f}"])
    header = ["steps/s", "one environment", f"batch of {SMALL_BATCH}", f"batch of {args.envs}"]
    print_table([*header, "time, one / batch", f"time, {SMALL_BATCH} / batch"], rows)


def print_observation_rates(args: Args) -> None:
    """Print steps per second by observation."""
    rows = []
    for name in args.observed:
        for observation in OBSERVATIONS:
            options = course_options(args, name) | {"observation": observation}
            single, batch = measure(args, (args.observed_envs,), **options)
            title = f"{name} levels, {observation}" if name in DIFFICULTY_NAMES else f"{name}, {observation}"
            rows.append([title, format_rate(1.0 / single), format_rate(1.0 / batch), f"{batch * 1e6:.0f}"])
    print_table(["steps/s", "one environment", f"batch of {args.observed_envs}", "us per step"], rows)


class CallTimer:
    """CPU time of methods that call each other, each without the time of those it calls."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._nested = [0.0]

    def time_calls(self, name: str, owner: Any, method: str) -> None:
        """Add the time of all calls of an object's method to ``seconds[name]``."""
        function = getattr(owner, method)

        def timed(*args: Any, **kwargs: Any) -> Any:
            self._nested.append(0.0)
            start = time.process_time()
            try:
                return function(*args, **kwargs)
            finally:
                elapsed = time.process_time() - start
                self.seconds[name] = self.seconds.get(name, 0.0) + elapsed - self._nested.pop()
                self._nested[-1] += elapsed

        setattr(owner, method, timed)


def training_seconds(args: Args, config: PPOConfig, make: Callable[..., PPO]) -> dict[str, float]:
    """Return the CPU time of each part of some rollouts and updates, s."""
    timer = CallTimer()
    envs = make_sb3_envs(config)
    adapter = envs.venv
    model = make(config, envs)
    model.learn(config.n_envs * config.n_steps)  # Compile the kernels, and build levels.
    timer.time_calls("environment", adapter.envs, "step")
    timer.time_calls("SB3VecEnv", adapter, "step_wait")
    timer.time_calls("VecMonitor", envs, "step_wait")
    timer.time_calls("rollout: policy, buffer", model, "collect_rollouts")
    timer.time_calls("update", model, "train")
    model.learn(args.rollouts * config.n_envs * config.n_steps)
    envs.close()
    return timer.seconds


def print_training_parts(args: Args) -> None:
    """Print the shares of the CPU time of training, by observation."""
    runs: dict[str, tuple[PPOConfig, Callable[..., PPO]]] = {
        "state, dogleg": (PPOConfig(), make_model),
        "bounce_rays, medium levels": (
            PPOConfig(course="procedural", difficulty="medium", num_levels=100, observation="bounce_rays"),
            make_model,
        ),
        "pixels, dogleg": (PixelsConfig(), make_pixel_model),
    }
    rows = []
    for name, (config, make) in runs.items():
        seconds = training_seconds(args, config, make)
        total = sum(seconds.values())
        putts = args.rollouts * config.n_envs * config.n_steps
        rows.append([name, format_rate(putts / total), *(f"{value / total:.0%}" for value in seconds.values())])
    print_table(["training", "putts/s", *seconds], rows)


def main(args: Args) -> None:
    """Print the tables."""
    numba.set_num_threads(1)
    torch.set_num_threads(1)
    with ignore_unseen_levels():
        print_hole_rates(args)
        print_observation_rates(args)
        print_training_parts(args)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
