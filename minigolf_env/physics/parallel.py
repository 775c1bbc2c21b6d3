"""Batches on all cores."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from itertools import pairwise
from typing import Any

import numba
import numpy as np

CHUNKS = 4
"""Pieces of a batch for each thread: putts differ in length, so the threads share more pieces than they are."""

LONGEST = 4096
"""Rows of a piece at most: after an interrupt the pieces that run come to their end."""

_pools: dict[int, ThreadPoolExecutor] = {}
"""By the number of their threads."""

_lock = threading.RLock()
"""Held while a pool is given work, and during a fork."""


def in_parallel(run: Callable[..., None], n: int, *arguments: Any) -> None:
    """Call run(first, last, *arguments) on pieces of range(n), on as many threads as numba is set to use.

    Plain threads, because the kernels release the GIL: no threading layer that a fork breaks, no second compilation.
    They are kept: to start them takes as long as a thousand balls that lie still. After an interrupt, as by Ctrl-C, no
    further piece begins.
    """
    threads = _number()
    alone = min(threads, n) <= 1
    number = max(1 if alone else min(n, CHUNKS * threads), math.ceil(n / LONGEST))
    pieces = list(pairwise(np.linspace(0, n, number + 1).astype(int).tolist()))
    if alone:
        for a, b in pieces:
            run(a, b, *arguments)
        return
    done: list[Future[None]] = []
    try:
        with _lock:
            pool = _pools.get(threads) or _pools.setdefault(threads, ThreadPoolExecutor(threads))
            for a, b in pieces:
                done.append(pool.submit(run, a, b, *arguments))
        wait(done)
    except BaseException:
        for piece in done:
            piece.cancel()
        raise
    for piece in done:
        piece.result()


def _number() -> int:
    """Return how many threads numba is set to use, without starting any of numba's own.

    Its OpenMP layer, once started, tells the process's OpenMP how many threads there are. torch shares that, and its
    elementwise functions would wait for threads that torch.set_num_threads(1) had ruled out: a tenth of the speed.
    """
    try:
        numba.threading_layer()  # type: ignore[attr-defined]
    except ValueError:  # Not started, so that nobody has set a number either.
        return int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    return int(numba.get_num_threads())


def _before_fork() -> None:
    """End the threads: a child process would have none of them, and Python warns of a fork beside threads."""
    _lock.acquire()
    try:
        for pool in _pools.values():
            pool.shutdown()  # Once the pieces that another thread waits for have run.
    finally:
        _pools.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before_fork, after_in_parent=_lock.release, after_in_child=_lock.release)
