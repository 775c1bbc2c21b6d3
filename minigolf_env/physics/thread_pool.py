"""Batches on all cores: contiguous chunks of rows on a pool of plain threads."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from itertools import pairwise

import numba

CHUNKS_PER_THREAD = 4
"""Number of chunks of a batch for each thread: putts differ in length, and several chunks even out the load."""

MIN_CHUNK_SIZE = 8
"""Minimum number of rows in a chunk: balls share SIMD instructions, and fewer take less time than starting a thread."""

MAX_CHUNK_SIZE = 4096
"""Maximum number of rows in a chunk: after an interrupt the chunks that are running finish."""

_pools: dict[int, ThreadPoolExecutor] = {}
"""Thread pools by their number of threads."""

_lock = threading.RLock()
"""Held while chunks are submitted to a pool, and during a fork."""


def parallel_for(process_chunk: Callable[[int, int], None], n: int) -> None:
    """Call process_chunk(first, last) on chunks of range(n), on as many threads as numba is set to use.

    Plain threads suffice, as the kernels release the GIL: there is no threading layer that a fork breaks, and no second
    compilation. The threads are kept, since starting them takes as long as simulating a thousand balls at rest. After
    an interrupt, such as Ctrl-C, no further chunk starts.
    """
    if n <= 1:
        process_chunk(0, n)
        return
    num_threads = _num_threads()
    num_chunks = 1 if num_threads == 1 else min(math.ceil(n / MIN_CHUNK_SIZE), CHUNKS_PER_THREAD * num_threads)
    num_chunks = max(num_chunks, math.ceil(n / MAX_CHUNK_SIZE))
    chunks = list(pairwise(n * k // num_chunks for k in range(num_chunks + 1)))
    if num_threads == 1 or num_chunks == 1:
        for first, last in chunks:
            process_chunk(first, last)
        return
    futures: list[Future[None]] = []
    try:
        with _lock:
            pool = _pools.get(num_threads) or _pools.setdefault(num_threads, ThreadPoolExecutor(num_threads))
            for first, last in chunks:
                futures.append(pool.submit(process_chunk, first, last))
        wait(futures)
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    for future in futures:
        future.result()


def _num_threads() -> int:
    """Return the number of threads that numba is set to use, without starting numba's threading layer.

    Its OpenMP layer, once started, sets the number of threads of the process's OpenMP, which torch shares: torch's
    elementwise functions would wait for threads that torch.set_num_threads(1) had ruled out, at a tenth of the speed.
    """
    try:
        numba.threading_layer()  # type: ignore[attr-defined]
    except ValueError:  # The layer has not started, so that no number has been set either.
        return int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    return int(numba.get_num_threads())


def _before_fork() -> None:
    """End the threads: a child process would have none of them, and Python warns of a fork with running threads."""
    _lock.acquire()
    try:
        for pool in _pools.values():
            pool.shutdown()  # Waits for the chunks that another thread has submitted.
    finally:
        _pools.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before_fork, after_in_parent=_lock.release, after_in_child=_lock.release)
