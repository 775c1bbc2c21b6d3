"""Check that episodes and trajectories have the same bits as when their hashes were stored.

Run: python -m tools.determinism. It plays 1,000 episodes and the golden trajectories in single environments and in
batches of several sizes, with one and two threads, each configuration in a process of its own. It compares the hashes
of all observations, rewards, infos and states with those stored for the version of the environment. It ends with an
error if one differs: then raise the version of the environment's id in ``minigolf_env/__init__.py``, explain the change
in CHANGELOG.md, and store the new hashes with ``--write``. The hashes of an unreleased version may be replaced.

The hash "machine" is that of functions such as sine, whose last bits depend on the machine's mathematical library. If
it differs too, differences in episodes prove nothing: compare on a machine where it is equal, and store no hashes here.

With ``--batch`` it plays one configuration in this process and prints the hashes. That checks another version of Python
or Gymnasium, or, with NUMBA_DISABLE_JIT=1, the uncompiled physics.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import struct
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import tyro

import minigolf_env  # noqa: F401 (registers the environment)
from minigolf_env._atomic_io import write_text
from minigolf_env.envs import round_reset_options
from minigolf_env.envs.config import UnseenLevelWarning
from tests.physics import golden

warnings.filterwarnings("ignore", category=UnseenLevelWarning)  # No agent learns here.

ROOT = Path(__file__).parents[1]
HASHES_FILE = ROOT / "tests" / "data" / "hashes.json"
ENV_ID = max((spec for spec in gym.registry.values() if spec.name == "MiniGolf"), key=lambda spec: spec.version or 0).id
"""Id of the newest version of the environment."""

PUTT_NOISE = (0.5, 0.015)
EPISODE_KINDS: dict[str, dict[str, Any]] = {
    "dogleg": {},
    "dogleg, rays": {"observation": "rays", "reward": "strokes", "impact": "conservative", "putt_noise": PUTT_NOISE},
    "bank": {"course": "bank", "tee": "fixed", "putt_noise": PUTT_NOISE, "top_speed": 3.0},
    "loop": {"course": "loop", "impact": "conservative", "max_strokes": 4},
    "volcano": {"course": "volcano", "observation": "rays", "dt": 1 / 60, "max_strokes": 4},
    "round": {"course": "round", "max_strokes": 2, "putt_noise": PUTT_NOISE},
    "easy": {"course": "procedural", "num_levels": 0, "max_strokes": 3},
    "medium": {"course": "procedural", "difficulty": "medium", "observation": "rays", "max_strokes": 3},
    "hard": {
        "course": "procedural",
        "difficulty": "hard",
        "start_level": 7000,
        "max_strokes": 3,
        "putt_noise": PUTT_NOISE,
    },
    "hard, rays": {"course": "procedural", "difficulty": "hard", "observation": "rays", "impact": "conservative"},
}
"""Keyword arguments of the environment, by the name of the kind of episode."""

EPISODES_PER_KIND = 100
"""Number of episodes of each kind that the tool plays."""

TESTED_EPISODES = 10
"""Number of episodes of each kind that tests/test_determinism.py plays."""

RUN_CONFIGS = [(batch, threads) for batch in (0, 1, 7, 64) for threads in (1, 2)]
"""Pairs of batch size (0: single environments) and number of threads."""

HINT = (
    "the hashes differ: undo the change, or raise the version of the id in minigolf_env/__init__.py, explain it in "
    "CHANGELOG.md, and store the new hashes: python -m tools.determinism --write"
)

Hashes = dict[str, dict[str, str]]
"""Hashes by group ("golden" trajectories, "first" and "all" episodes, "machine") and name."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    batch: int | None = None
    """Play only with this batch size (0: single environments), in this process, and print the hashes."""
    only: tuple[str, ...] = ()
    """Kinds of episodes to play with --batch; empty: all."""
    episodes: int = EPISODES_PER_KIND
    """Number of episodes of each kind to play with --batch."""
    write: bool = False
    """Store the hashes."""


def update_digest(digest: hashlib._Hash, value: Any) -> None:
    """Add a value to a hash: its type, size and raw bytes; of a dict, the items in the order of the keys."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, dict):
        value = [pair for key in sorted(value) for pair in (key, value[key])]
    if isinstance(value, (list, tuple)):
        digest.update(f"list {len(value)}:".encode())
        for item in value:
            update_digest(digest, item)
        return
    if isinstance(value, np.ndarray):
        kind = f"{value.dtype.str} {value.shape}"
        content = value.tobytes()
    elif isinstance(value, float):
        kind = "float"
        content = struct.pack("<d", value)
    else:
        kind = type(value).__name__
        content = str(value).encode()
    digest.update(f"{kind} {len(content)}:".encode() + content)


def putt_sequence(seed: int, strokes: int) -> np.ndarray:
    """Return an episode's actions (strokes, 2): multiples of irrational numbers, modulo 1, over the whole square."""
    steps = np.arange(1, strokes + 1)[:, None] * [0.618033988749895, 0.414213562373095] + seed * 0.732050807568877
    return (2.0 * (steps % 1.0) - 1.0).astype(np.float32)


def play_single(kind: str, seeds: range) -> Iterator[list[Any]]:
    """Play one episode per seed in a single environment; yield its observations, rewards, ends, infos and states."""
    options = EPISODE_KINDS[kind]
    env: Any = gym.make(ENV_ID, **options).unwrapped
    for seed in seeds:
        record = [*env.reset(seed=seed, options=round_reset_options(options.get("course", ""), seed)), env.get_state()]
        for putt in putt_sequence(seed, env.task.max_strokes):
            record += [*env.step(putt), env.get_state()]
            if env.get_state()["over"]:
                break
        yield record


def play_batch(kind: str, seeds: range) -> Iterator[list[Any]]:
    """Play the episodes of ``play_single`` in one batch with an environment for each seed; yield the same records."""
    options = EPISODE_KINDS[kind]
    envs: Any = gym.make_vec(ENV_ID, num_envs=len(seeds), **options).unwrapped
    reset_options = [round_reset_options(options.get("course", ""), seed) for seed in seeds]
    results = envs.reset(seed=seeds[0], options={key: [row[key] for row in reset_options] for key in reset_options[0]})
    records: list[list[Any]] = [[*select_row(results, i), state] for i, state in enumerate(envs.get_state())]
    running = set(range(len(seeds)))
    for stroke in range(envs.task_batch.max_strokes):
        results = envs.step(np.array([putt_sequence(seed, stroke + 1)[stroke] for seed in seeds]))
        states = envs.get_state()
        for i in sorted(running):
            records[i] += [*select_row(results, i), states[i]]
        running = {i for i in running if not states[i]["over"]}
    yield from records


def select_row(results: tuple[Any, ...], i: int) -> list[Any]:
    """Return environment i's part of what ``reset`` or ``step`` of a batch returned."""
    *arrays, infos = results
    return [array[i] for array in arrays] + [{key: infos[key][i] for key in infos if not key.startswith("_")}]


def episode_digests(kind: str, episodes: int, batch: int) -> list[bytes]:
    """Play the first episodes of a kind with a batch size (0: single environments); return the hash of each."""
    digests = []
    for first in range(0, episodes, batch or episodes):
        seeds = range(first, min(episodes, first + (batch or episodes)))
        for record in play_batch(kind, seeds) if batch else play_single(kind, seeds):
            digest = hashlib.sha256()
            update_digest(digest, record)
            digests.append(digest.digest())
    return digests


def compute_hashes(batch: int, kinds: tuple[str, ...] = (), episodes: int = EPISODES_PER_KIND) -> Hashes:
    """Return the hashes of golden trajectories and episodes: "all" covers ``episodes``, "first" TESTED_EPISODES."""
    digests = {kind: episode_digests(kind, episodes, batch) for kind in kinds or EPISODE_KINDS}
    return {
        "golden": {name: golden.hash_of(name) for name in golden.SCENES},
        "first": {kind: combine_digests(each[:TESTED_EPISODES]) for kind, each in digests.items()},
        "all": {kind: combine_digests(each) for kind, each in digests.items()},
        "machine": {"sines": hash_math_functions()},
    }


def combine_digests(digests: list[bytes]) -> str:
    """Return one hash for a list of digests."""
    return hashlib.sha256(b"".join(digests)).hexdigest()


def hash_math_functions() -> str:
    """Return a hash of functions whose last bits depend on the system's mathematical library.

    Courses, putt noise and rays are computed with them; golden trajectories are not.
    """
    x = np.linspace(-7.0, 7.0, 100_001)
    python_values = [[math.cos(angle), math.sin(angle)] for angle in x[::10].tolist()]
    values = [np.sin(x), np.cos(x), np.exp(1j * x), np.hypot(x, x[::-1] + 0.1), np.array(python_values)]
    return combine_digests([value.tobytes() for value in values])


def load_stored_hashes() -> dict[str, Hashes]:
    """Return the stored hashes by version of the environment's id."""
    content: dict[str, Hashes] = json.loads(HASHES_FILE.read_text())
    return content


def changelog_line(version: str, hashes: Hashes) -> str:
    """Return the text by which CHANGELOG.md states a version's hashes."""
    digest = hashlib.sha256(json.dumps(hashes, sort_keys=True).encode()).hexdigest()
    return f"bits of `{version}`: `{digest[:12]}`"


def is_released(version: str) -> bool:
    """Return whether CHANGELOG.md states the hashes of a version in a section below the unreleased one."""
    sections = (ROOT / "CHANGELOG.md").read_text().split("\n## ")
    return any(f"bits of `{version}`" in section for section in sections[2:])


def run_in_subprocess(batch: int, threads: int) -> Hashes:
    """Return the hashes that a new process computes with a batch size and a number of threads."""
    command = [sys.executable, "-m", "tools.determinism", "--batch", str(batch)]
    environment = {**os.environ, "NUMBA_NUM_THREADS": str(threads)}
    done = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    hashes: Hashes = json.loads(done.stdout)
    return hashes


def differing_hashes(first: Hashes, second: Hashes) -> list[str]:
    """Return the names of hashes that differ or that only one of both has."""
    names = {(group, name) for hashes in (first, second) for group in hashes for name in hashes[group]}
    return sorted(
        f"{group} {name!r}"
        for group, name in names
        if first.get(group, {}).get(name) != second.get(group, {}).get(name)
    )


def main(args: Args) -> int:
    """Play one configuration and print its hashes, or play all and compare; return 1 if a hash differs."""
    if args.batch is not None:
        print(json.dumps(compute_hashes(args.batch, args.only, args.episodes), indent=2))
        return 0
    stored = load_stored_hashes() if HASHES_FILE.exists() else {}
    # Without --write the stored hashes are expected, with it those of the first configuration.
    expected = None if args.write else stored.get(ENV_ID, {})
    all_equal = True
    for batch, threads in RUN_CONFIGS:
        hashes = run_in_subprocess(batch, threads)
        expected = hashes if expected is None else expected
        differences = differing_hashes(hashes, expected)
        all_equal = all_equal and not differences
        label = f"batch of {batch}" if batch else "single"
        result = "; ".join(differences) or "equal"
        print(f"{label:12} {threads} threads  {changelog_line(ENV_ID, hashes)}  {result}", flush=True)
    if not args.write or not all_equal:
        return 0 if all_equal else 1
    # Store the new hashes, unless a release has had this version of the environment.
    if stored.get(ENV_ID, expected) != expected and is_released(ENV_ID):
        print(
            f"{ENV_ID} is released, and its results must not change: raise the version of the id in "
            "minigolf_env/__init__.py."
        )
        return 1
    write_text(HASHES_FILE, json.dumps(stored | {ENV_ID: expected}, indent=2) + "\n")
    print(f"Stored. State in CHANGELOG.md, with the reason: {changelog_line(ENV_ID, expected or {})}")
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
