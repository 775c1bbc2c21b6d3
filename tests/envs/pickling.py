"""Environments continue in another process as in this one. Run: python -m tests.envs.pickling METHOD.

METHOD is the start method of processes: fork, spawn or forkserver. This runs in a process of its own, since forking a
test runner that has threads is undefined.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from tools.determinism import update_digest

NOISE = (0.5, 0.015)
OPTIONS: dict[str, dict[str, Any]] = {
    "dogleg": {"putt_noise": NOISE, "max_strokes": 3},
    "round": {"course": "round", "max_strokes": 2, "observation": "rays"},
    "levels": {"course": "procedural", "max_strokes": 2, "putt_noise": NOISE, "num_levels": 0},
}
"""Arguments of environments, by name."""

N = 5
"""Number of environments in a batch."""


def make(name: str, mode: str | None) -> Any:
    """Return an environment, or a batch with an autoreset mode."""
    return MiniGolfEnv(**OPTIONS[name]) if mode is None else MiniGolfVectorEnv(N, autoreset_mode=mode, **OPTIONS[name])


MADE = [(name, mode) for name in OPTIONS for mode in (None, "NextStep", "SameStep", "Disabled")]


def play(env: Any, steps: int, first: int) -> str:
    """Play, through the ends of episodes, and return a hash of all results and the final state."""
    digest = hashlib.sha256()
    for k in range(first, first + steps):
        shape = (N, 2) if isinstance(env, MiniGolfVectorEnv) else (2,)
        results = env.step(np.random.default_rng(k).uniform(-1.0, 1.0, shape))
        update_digest(
            digest, [*results[:4], results[4]["shot_time"], results[4]["course"].tolist() if shape[:-1] else []]
        )
        if shape == (2,) and results[2]:
            update_digest(digest, list(env.reset()))
        if shape != (2,) and env.metadata["autoreset_mode"].value == "Disabled" and results[2].any():
            update_digest(digest, env.reset(options={"reset_mask": results[2]})[0])
    update_digest(digest, env.get_state())
    return digest.hexdigest()


def answer(connection: Any, envs: list[Any]) -> None:
    """Play environments and send the hashes."""
    connection.send([play(env, 4, 100) for env in envs])


def elsewhere(method: str) -> Iterator[tuple[str, str]]:
    """Yield the hashes of environments in the middle of episodes from another process, and from this one."""
    context: Any = multiprocessing.get_context(method)
    envs = [make(name, mode) for name, mode in MADE]
    for env in envs:
        env.reset(seed=3)
        play(env, 3, 0)
    ours, theirs = context.Pipe()
    child = context.Process(target=answer, args=(theirs, envs))
    child.start()
    theirs.close()  # If the child dies, nobody else holds the pipe open.
    there = ours.recv()
    yield from zip(there, [play(env, 4, 100) for env in envs], strict=True)
    child.join()


if __name__ == "__main__":
    for there, here in elsewhere(sys.argv[1]):
        print(there, here)
