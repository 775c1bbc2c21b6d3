"""Is every bit what it was, however it is played? Run: python -m tools.determinism.

Plays 1,000 episodes and the golden trajectories, alone, in batches, and on several threads, each way in a process of
its own, and compares the hashes of all that was seen with those stored for the environment's version. Ends with an
error if one differs: then the version of the environment's id rises in ``minigolf_env/__init__.py``, CHANGELOG.md says
so in a line, and ``--write`` stores what is played now. A version that no release has had yet may be written again.
Where a machine's sine is another, "machine" differs too, and not all episodes can be the same.

With ``--batch`` it plays one way only, in this process, and prints the hashes: so can another Python be asked, another
Gymnasium, or, with NUMBA_DISABLE_JIT=1, Python itself instead of machine code.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import struct
import subprocess
import sys
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
from tests.physics import golden

ROOT = Path(__file__).parents[1]
STORED = ROOT / "tests" / "data" / "hashes.json"
ID = max((spec for spec in gym.registry.values() if spec.name == "MiniGolf"), key=lambda spec: spec.version or 0).id
"""The environment of today."""

NOISE = (0.5, 0.015)
KINDS: dict[str, dict[str, Any]] = {
    "dogleg": {},
    "dogleg, rays": {"observation": "rays", "reward": "strokes", "impact": "conservative", "putt_noise": NOISE},
    "bank": {"course": "bank", "tee": "fixed", "putt_noise": NOISE, "top_speed": 3.0},
    "loop": {"course": "loop", "impact": "conservative", "max_strokes": 4},
    "volcano": {"course": "volcano", "observation": "rays", "dt": 1 / 60, "max_strokes": 4},
    "round": {"course": "round", "max_strokes": 2, "putt_noise": NOISE},
    "easy": {"course": "procedural", "num_levels": 0, "max_strokes": 3},
    "medium": {"course": "procedural", "difficulty": "medium", "observation": "rays", "max_strokes": 3},
    "hard": {"course": "procedural", "difficulty": "hard", "start_level": 7000, "max_strokes": 3, "putt_noise": NOISE},
    "hard, rays": {"course": "procedural", "difficulty": "hard", "observation": "rays", "impact": "conservative"},
}
"""Of episodes: the options of their environment."""

EPISODES, FIRST = 100, 10
"""Of each kind, and how many of them the tests play."""

WAYS = [(batch, threads) for batch in (0, 1, 7, 64) for threads in (1, 2)]
"""To play: environments at a time (0: alone, no batch), and threads."""

REMEDY = (
    "bits have changed: undo it, or raise the version of the id in minigolf_env/__init__.py, say why in CHANGELOG.md, "
    "and store the new ones: python -m tools.determinism --write"
)

Hashes = dict[str, dict[str, str]]
"""Of "golden" trajectories, "first" and "all" episodes, and of the "machine", each by name."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    batch: int | None = None
    """Play in one way only, so many environments at a time (0: alone), and print the hashes."""
    only: tuple[str, ...] = ()
    """Kinds of episodes to play with --batch; all without."""
    episodes: int = EPISODES
    """Of each kind to play with --batch."""
    write: bool = False
    """Store the hashes."""


def feed(digest: hashlib._Hash, value: Any) -> None:
    """Take a value into a hash: its type, its size and its raw bytes, the values of a dict in the order of its keys."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, dict):
        value = [pair for key in sorted(value) for pair in (key, value[key])]
    if isinstance(value, (list, tuple)):
        digest.update(f"list {len(value)}:".encode())
        for one in value:
            feed(digest, one)
        return
    if isinstance(value, np.ndarray):
        what, content = f"{value.dtype.str} {value.shape}", value.tobytes()
    elif isinstance(value, float):
        what, content = "float", struct.pack("<d", value)
    else:
        what, content = type(value).__name__, str(value).encode()
    digest.update(f"{what} {len(content)}:".encode() + content)


def putts(seed: int, strokes: int) -> np.ndarray:
    """Return the putts (strokes, 2) of an episode: multiples of irrational numbers, modulo 1, over the whole square."""
    steps = np.arange(1, strokes + 1)[:, None] * [0.618033988749895, 0.414213562373095] + seed * 0.732050807568877
    return (2.0 * (steps % 1.0) - 1.0).astype(np.float32)


def play_alone(kind: str, seeds: range) -> Iterator[list[Any]]:
    """Yield all that is seen of each episode: observations, rewards, ends, infos and states."""
    options = KINDS[kind]
    env: Any = gym.make(ID, **options).unwrapped
    for seed in seeds:
        seen = [*env.reset(seed=seed, options=round_reset_options(options.get("course", ""), seed)), env.get_state()]
        for putt in putts(seed, env.task.max_strokes):
            seen += [*env.step(putt), env.get_state()]
            if env.get_state()["over"]:
                break
        yield seen


def play_together(kind: str, seeds: range) -> Iterator[list[Any]]:
    """Yield the same, played by a batch as large as there are seeds."""
    options, n = KINDS[kind], len(seeds)
    envs: Any = gym.make_vec(ID, num_envs=n, **options).unwrapped
    chosen = [round_reset_options(options.get("course", ""), seed) for seed in seeds]
    results = envs.reset(seed=seeds[0], options={key: [one[key] for one in chosen] for key in chosen[0]})
    seen: list[list[Any]] = [[*row(results, i), state] for i, state in enumerate(envs.get_state())]
    playing = set(range(n))
    for stroke in range(envs.task_batch.max_strokes):
        results = envs.step(np.array([putts(seed, stroke + 1)[stroke] for seed in seeds]))
        states = envs.get_state()
        for i in sorted(playing):
            seen[i] += [*row(results, i), states[i]]
        playing = {i for i in playing if not states[i]["over"]}
    yield from seen


def row(results: tuple[Any, ...], i: int) -> list[Any]:
    """Return what a batch gave to environment i."""
    *arrays, infos = results
    return [array[i] for array in arrays] + [{key: infos[key][i] for key in infos if not key.startswith("_")}]


def digests(kind: str, episodes: int, batch: int) -> list[bytes]:
    """Return the hash of each of a kind's first episodes, played so many at a time (0: alone)."""
    found = []
    for first in range(0, episodes, batch or episodes):
        seeds = range(first, min(episodes, first + (batch or episodes)))
        for seen in play_together(kind, seeds) if batch else play_alone(kind, seeds):
            digest = hashlib.sha256()
            feed(digest, seen)
            found.append(digest.digest())
    return found


def hashes(batch: int, kinds: tuple[str, ...] = (), episodes: int = EPISODES) -> Hashes:
    """Return the hashes of golden trajectories and episodes: "all" are as many as given, "first" are FIRST of them."""
    played = {kind: digests(kind, episodes, batch) for kind in kinds or KINDS}
    return {
        "golden": {name: golden.hash_of(name) for name in golden.SCENES},
        "first": {kind: together(each[:FIRST]) for kind, each in played.items()},
        "all": {kind: together(each) for kind, each in played.items()},
        "machine": {"sines": sines()},
    }


def together(each: list[bytes]) -> str:
    """Return one hash of many."""
    return hashlib.sha256(b"".join(each)).hexdigest()


def sines() -> str:
    """Return a hash of functions whose last bits differ between systems, as their libraries for mathematics do.

    Courses, putt noise and rays are computed with them, golden trajectories are not.
    """
    x = np.linspace(-7.0, 7.0, 100_001)
    exact = [[math.cos(turn), math.sin(turn)] for turn in x[::10].tolist()]
    values = [np.sin(x), np.cos(x), np.exp(1j * x), np.hypot(x, x[::-1] + 0.1), np.array(exact)]
    return together([value.tobytes() for value in values])


def stored() -> dict[str, Hashes]:
    """Return the stored hashes of each version."""
    content: dict[str, Hashes] = json.loads(STORED.read_text())
    return content


def line_of(version: str, those: Hashes) -> str:
    """Return the words by which CHANGELOG.md names a version's hashes."""
    digest = hashlib.sha256(json.dumps(those, sort_keys=True).encode()).hexdigest()
    return f"bits of `{version}`: `{digest[:12]}`"


def is_released(version: str) -> bool:
    """Return whether CHANGELOG.md names the hashes of a version below what is not released yet."""
    sections = (ROOT / "CHANGELOG.md").read_text().split("\n## ")
    return any(f"bits of `{version}`" in section for section in sections[2:])


def ask(batch: int, threads: int) -> Hashes:
    """Return the hashes that a process of its own finds, with so many threads."""
    command = [sys.executable, "-m", "tools.determinism", "--batch", str(batch)]
    environment = {**os.environ, "NUMBA_NUM_THREADS": str(threads)}
    done = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    answer: Hashes = json.loads(done.stdout)
    return answer


def differing(some: Hashes, others: Hashes) -> list[str]:
    """Return the names of hashes that differ, or that only one has."""
    names = {(group, name) for hashes in (some, others) for group in hashes for name in hashes[group]}
    return sorted(f"{group} {name!r}" for group, name in names if _of(some, group, name) != _of(others, group, name))


def _of(those: Hashes, group: str, name: str) -> str | None:
    return those.get(group, {}).get(name)


def main(args: Args) -> int:
    """Play in one way and print the hashes, or in all and compare; return 1 if a hash is another."""
    if args.batch is not None:
        print(json.dumps(hashes(args.batch, args.only, args.episodes), indent=2))
        return 0
    before = stored() if STORED.exists() else {}
    expected, good = None if args.write else before.get(ID, {}), True
    for batch, threads in WAYS:
        found = ask(batch, threads)
        expected = found if expected is None else expected
        wrong = differing(found, expected)
        good = good and not wrong
        way = f"{batch} at a time" if batch else "alone"
        print(f"{way:14} {threads} threads  {line_of(ID, found)}  {'; '.join(wrong) or 'the same'}", flush=True)
    if not args.write or not good:
        return 0 if good else 1
    if before.get(ID, expected) != expected and is_released(ID):
        print(f"{ID} is released, and its bits stay: raise the version of the id in minigolf_env/__init__.py.")
        return 1
    write_text(STORED, json.dumps(before | {ID: expected}, indent=2) + "\n")
    print(f"Stored. Into CHANGELOG.md, with the reason: {line_of(ID, expected or {})}")
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
