"""Other physics engines behind the interface ``engine.Engine``."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from benchmarks.peers.engine import Engine

PEER_ENGINES = {"pybullet": "bullet.Bullet", "rapier3d": "rapier.Rapier", "mujoco": "mujoco_peer.Mujoco"}
"""Module and class of each engine, by the name of its package."""


def load_peers(packages: Sequence[str]) -> list[type[Engine]]:
    """Return the engines of packages; an engine that is not installed is left out with a message.

    Raises:
        ValueError: there is no such engine.
    """
    engines = []
    for package in packages:
        if package not in PEER_ENGINES:
            raise ValueError(f"peers: expected some of {', '.join(PEER_ENGINES)}, received {package!r}.")
        module, _, name = PEER_ENGINES[package].partition(".")
        try:
            engines.append(getattr(importlib.import_module(f"benchmarks.peers.{module}"), name))
        except ImportError as error:
            print(f"{package} is left out ({error}); install it with pip install -r benchmarks/requirements.txt.\n")
    return engines
