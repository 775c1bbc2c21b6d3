"""Measures leaks of the rendering: ``python -m tests.rendering.leaks`` draws 2,000 environments and 10,000 images.

It takes a minute and prints how many megabytes, file descriptors and threads the process gained after the first tenth.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from minigolf_env.envs import MiniGolfEnv

CAMERAS_IN_TURN = ("follow", "top", "tee")


class Growth(NamedTuple):
    """Resources that a process gained."""

    megabytes: float
    """Resident memory, MiB."""
    descriptors: int
    """Open file descriptors."""
    threads: int
    """Threads."""


def growth(act: Callable[[int], None], n: int) -> Growth:
    """Return the resources that the process gained in n calls of a function, after the first tenth of them."""
    num_warm_up = n // 10
    for k in range(num_warm_up):
        act(k)
    megabytes = _resident_megabytes()
    descriptors = _num_entries("fd")
    threads = _num_entries("task")
    for k in range(num_warm_up, n):
        act(k)
    return Growth(_resident_megabytes() - megabytes, _num_entries("fd") - descriptors, _num_entries("task") - threads)


def growth_of_environments(n: int) -> Growth:
    """Return the growth by making, rendering and closing n environments of several sizes and cameras."""

    def act(k: int) -> None:
        size = 32 + k % 12
        env = MiniGolfEnv(
            render_mode="rgb_array", render_size=(size, size), render_profile="fast", camera=CAMERAS_IN_TURN[k % 3]
        )
        env.reset(seed=k)
        env.render()
        env.close()

    return growth(act, n)


def growth_of_images(n: int) -> Growth:
    """Return the growth by rendering n images of one environment."""
    env = MiniGolfEnv(render_mode="rgb_array", render_size=(48, 48), render_profile="fast")
    env.reset(seed=0)

    def act(k: int) -> None:
        if k % 50 == 0:
            env.reset(seed=k)
            env.step(np.array([0.3, 0.1], np.float32))
        env.render()

    return growth(act, n)


def _resident_megabytes() -> float:
    """Return the resident memory of this process, MiB."""
    status = Path("/proc/self/statm").read_text().split()
    return int(status[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def _num_entries(folder: str) -> int:
    """Return the number of entries of a folder of this process in /proc."""
    return len(list((Path("/proc/self") / folder).iterdir()))


if __name__ == "__main__":
    print("2,000 environments:", growth_of_environments(2000))
    print("10,000 images:", growth_of_images(10_000))
