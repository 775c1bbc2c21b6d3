"""Engines that a user could pick instead, each behind the same few methods: see ``engine.Engine``."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from benchmarks.peers.engine import Engine

PEERS = {"pybullet": "bullet.Bullet", "rapier3d": "rapier.Rapier", "mujoco": "mujoco_peer.Mujoco"}
"""Where the engine is, by the name of its package."""


def load_peers(packages: Sequence[str]) -> list[type[Engine]]:
    """Return the engines of these packages, leaving out with a word each that is not installed."""
    engines = []
    for package in packages:
        if package not in PEERS:
            raise ValueError(f"peers: expected some of {', '.join(PEERS)}, received {package!r}.")
        module, _, name = PEERS[package].partition(".")
        try:
            engines.append(getattr(importlib.import_module(f"benchmarks.peers.{module}"), name))
        except ImportError as error:
            print(f"{package} is left out ({error}): pip install -r benchmarks/requirements.txt brings it.\n")
    return engines
