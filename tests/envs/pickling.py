"""Compare environments that continue in another process with the same ones in this process.

Run ``python -m tests.envs.pickling METHOD``: it prints two hashes for each environment, which are equal. METHOD is the
start method of processes: fork, spawn or forkserver. This runs in a process of its own, since forking a test runner
that has threads is undefined.
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

PUTT_NOISE = (0.5, 0.015)
"""Standard deviations of a putt's direction, degrees, and speed, as a fraction of it."""

ENV_OPTIONS: dict[str, dict[str, Any]] = {
    "dogleg": {"putt_noise": PUTT_NOISE, "max_strokes": 3},
    "round": {"course": "round", "max_strokes": 2, "observation": "rays"},
    "levels": {
        "course": "procedural",
        "max_strokes": 2,
        "putt_noise": PUTT_NOISE,
        "num_levels": 0,
        "observation": "rays",
    },
}
"""Arguments of environments, by name."""

NUM_ENVS = 5
"""Number of environments in a batch."""


def make(name: str, mode: str | None) -> Any:
    """Return an environment, or a batch with an autoreset mode."""
    if mode is None:
        return MiniGolfEnv(**ENV_OPTIONS[name])
    return MiniGolfVectorEnv(NUM_ENVS, autoreset_mode=mode, **ENV_OPTIONS[name])


ENV_KINDS = [(name, mode) for name in ENV_OPTIONS for mode in (None, "NextStep", "SameStep", "Disabled")]
"""Arguments of ``make``: single environments (None) and vector environments in each autoreset mode."""


def play(env: Any, steps: int, first: int) -> str:
    """Play, through the ends of episodes, and return a hash of all results and the final state."""
    digest = hashlib.sha256()
    for k in range(first, first + steps):
        shape = (NUM_ENVS, 2) if isinstance(env, MiniGolfVectorEnv) else (2,)
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


def send_hashes(connection: Any, envs: list[Any]) -> None:
    """Play environments and send the hashes."""
    connection.send([play(env, 4, 100) for env in envs])


def play_in_two_processes(method: str) -> Iterator[tuple[str, str]]:
    """Send environments in the middle of episodes to a process, and yield the hashes of what it and this one play."""
    context: Any = multiprocessing.get_context(method)
    envs = [make(name, mode) for name, mode in ENV_KINDS]
    for env in envs:
        env.reset(seed=3)
        play(env, 3, 0)
    receiver, sender = context.Pipe()
    child = context.Process(target=send_hashes, args=(sender, envs))
    child.start()
    sender.close()  # If the child dies, nobody else holds the pipe open.
    child_hashes = receiver.recv()
    yield from zip(child_hashes, [play(env, 4, 100) for env in envs], strict=True)
    child.join()


if __name__ == "__main__":
    for child_hash, own_hash in play_in_two_processes(sys.argv[1]):
        print(child_hash, own_hash)
