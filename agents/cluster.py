"""Ray, on this machine alone or on a cluster that is already running (docs/scaling.md)."""

from __future__ import annotations

import logging
import os
import socket
from typing import Any

ONE_CORE = {"env_vars": {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}}
"""A process plays on the one core that Ray counts for it: as many processes as cores, and no more threads than that."""

REACHED = 10.0
"""Seconds in which a cluster has to answer: Ray itself would try again for many minutes."""


def connect(address: str | None = None, num_cpus: int | None = None) -> Any:
    """Join the cluster at an address, or start Ray on this machine alone; return the module ray.

    Args:
        address: "auto" on a node of the cluster, or HOST:PORT; None starts Ray here, where only this machine hears it.
        num_cpus: cores that a Ray started here uses; None: all.

    Raises:
        SystemExit: Ray is not installed, or there is no cluster at the address.
    """
    ray = import_ray(address)
    logging.getLogger("ray.rllib").setLevel(logging.ERROR)  # Its warnings are about its own past and future versions.
    quiet = {"logging_level": logging.ERROR, "log_to_driver": False, "ignore_reinit_error": True}
    if address is None:
        ray.init("local", num_cpus=num_cpus, include_dashboard=False, runtime_env=ONE_CORE, **quiet)
        return ray
    try:
        if address != "auto":
            host, _, port = address.rpartition(":")
            socket.create_connection((host, int(port)), REACHED).close()
        ray.init(address=address, runtime_env=ONE_CORE, **quiet)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise SystemExit(
            f'address: expected "auto" on a node of a running cluster, or HOST:PORT, received {address!r}: {reason}'
        ) from None
    return ray


def import_ray(address: str | None) -> Any:
    """Return the module ray, ready for a cluster at an address or, without one, for this machine alone.

    Raises:
        SystemExit: it is not installed.
    """
    # Ray looks here when it is imported: it tells its makers how it is used unless told not to, and it listens to the
    # whole network unless it takes itself to be on a system where it knows no clusters.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    if address is None:
        os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
    try:
        import ray
    except ImportError:
        raise SystemExit(
            "Ray is missing. It wants a virtual environment of its own, and in it: "
            'pip install -c constraints-distributed.txt -e ".[agents,distributed]"'
        ) from None
    return ray
