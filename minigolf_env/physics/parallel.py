"""Batches on all cores."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import pairwise
from typing import Any

import numba
import numpy as np

CHUNKS = 4
"""Pieces of a batch for each thread: putts differ in length, so the threads share more pieces than they are."""


def in_parallel(run: Callable[..., None], n: int, *arguments: Any) -> None:
    """Call run(first, last, *arguments) on pieces of range(n), on as many threads as numba is set to use.

    Plain threads, because the kernels release the GIL: no threading layer that a fork breaks, no second compilation.
    They are kept: to start them takes as long as a thousand balls that lie still.
    """
    threads = min(_number(), n)
    if threads <= 1:
        return run(0, n, *arguments)
    ends = np.linspace(0, n, min(n, CHUNKS * threads) + 1).astype(int).tolist()
    pool = _threads(threads)
    done = [pool.submit(run, a, b, *arguments) for a, b in pairwise(ends)]
    wait(done)
    for piece in done:
        piece.result()
    return None


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


@functools.cache
def _threads(many: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(many)


if hasattr(os, "register_at_fork"):  # A child process has none of its parent's threads, and starts its own.
    os.register_at_fork(after_in_child=_threads.cache_clear)
