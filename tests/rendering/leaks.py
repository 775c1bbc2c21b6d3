"""Does drawing leak? ``python -m tests.rendering.leaks``: 2,000 environments and 10,000 pictures, a minute.

Prints how many megabytes, file descriptors and threads the process gained after the first tenth.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from minigolf_env.envs import MiniGolfEnv


class Growth(NamedTuple):
    """What a process gained."""

    megabytes: float
    descriptors: int
    threads: int


def growth(act: Callable[[int], None], times: int) -> Growth:
    """Return what the process gained by acting so often, after the first tenth of them."""
    warm = times // 10
    for k in range(warm):
        act(k)
    before = _megabytes(), _count("fd"), _count("task")
    for k in range(warm, times):
        act(k)
    return Growth(_megabytes() - before[0], _count("fd") - before[1], _count("task") - before[2])


def environments(times: int) -> Growth:
    """Return what creating, rendering and closing environments gains; sizes and cameras change."""

    def act(k: int) -> None:
        size = 32 + k % 12
        env = MiniGolfEnv(
            render_mode="rgb_array", render_size=(size, size), render_profile="fast", camera=CAMERAS_IN_TURN[k % 3]
        )
        env.reset(seed=k)
        env.render()
        env.close()

    return growth(act, times)


def pictures(times: int) -> Growth:
    """Return what rendering one environment gains."""
    env = MiniGolfEnv(render_mode="rgb_array", render_size=(48, 48), render_profile="fast")
    env.reset(seed=0)

    def act(k: int) -> None:
        if k % 50 == 0:
            env.reset(seed=k)
            env.step(np.array([0.3, 0.1], np.float32))
        env.render()

    return growth(act, times)


CAMERAS_IN_TURN = ("follow", "top", "tee")


def _megabytes() -> float:
    status = Path("/proc/self/statm").read_text().split()
    return int(status[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def _count(what: str) -> int:
    return len(list((Path("/proc/self") / what).iterdir()))


if __name__ == "__main__":
    print("2,000 environments:", environments(2000))
    print("10,000 pictures:", pictures(10_000))
