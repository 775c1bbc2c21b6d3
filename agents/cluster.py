"""Connection to Ray, on this machine alone or on a running cluster (docs/scaling.md)."""

from __future__ import annotations

import logging
import os
import socket
from typing import Any

from minigolf_env._validation import quote, quote_error

SINGLE_CORE_ENV = {"env_vars": {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}}
"""Runtime environment of the workers: one thread each, as Ray starts one worker for each core."""

CONNECT_TIMEOUT = 10.0
"""Time in which a cluster has to answer, s; Ray itself would keep trying for many minutes."""


def connect(address: str | None = None, num_cpus: int | None = None) -> Any:
    """Join the cluster at an address, or start Ray on this machine alone; return the module ``ray``.

    Args:
        address: "auto" on a node of the cluster, or HOST:PORT; None starts Ray here, reachable from this machine only.
        num_cpus: number of cores for a Ray started here; None uses all.

    Raises:
        SystemExit: Ray is not installed, or there is no cluster at the address.
    """
    ray = import_ray(address)
    logging.getLogger("ray.rllib").setLevel(logging.ERROR)  # RLlib's warnings are about its own deprecations.
    quiet = {"logging_level": logging.ERROR, "log_to_driver": False, "ignore_reinit_error": True}
    if address is None:
        ray.init("local", num_cpus=num_cpus, include_dashboard=False, runtime_env=SINGLE_CORE_ENV, **quiet)
        return ray
    try:
        if address != "auto":
            host, _, port = address.rpartition(":")
            socket.create_connection((host, int(port)), CONNECT_TIMEOUT).close()
        ray.init(address=address, runtime_env=SINGLE_CORE_ENV, **quiet)
    except (OSError, ValueError) as error:
        reason = quote_error(error).splitlines()[0]
        raise SystemExit(
            f'address: expected "auto" on a node of a running cluster, or HOST:PORT, received {quote(address)}: '
            f"{reason}"
        ) from None
    return ray


def import_ray(address: str | None) -> Any:
    """Import Ray, configured for a cluster at an address or, without one, for this machine alone.

    Raises:
        SystemExit: Ray is not installed.
    """
    # Ray reads these when it is imported. The first turns off its usage reports. The second makes it listen to this
    # machine alone: without it Ray listens to the whole network, except on systems where it supports no clusters.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    if address is None:
        os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
    try:
        import ray
    except ImportError:
        raise SystemExit(
            "Ray is missing. It needs a virtual environment of its own, and in it: "
            'pip install -c constraints-distributed.txt -e ".[agents,distributed]"'
        ) from None
    return ray
