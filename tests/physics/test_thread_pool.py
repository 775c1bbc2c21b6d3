"""parallel_for runs all rows once in bounded chunks, none after an interrupt, and keeps no thread across a fork."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from minigolf_env.physics import thread_pool


@pytest.fixture(params=[1, 2, 3])
def threads(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """Set the number of threads."""
    monkeypatch.setattr(thread_pool, "_num_threads", lambda: request.param)
    return int(request.param)


@pytest.mark.parametrize("n", [0, 1, 2, 7, 1000, 100_003])
def test_chunks_cover_all_rows_once(threads: int, n: int) -> None:
    """Chunks are short enough for an interrupt to be handled soon, also on one thread."""
    chunks: list[tuple[int, int]] = []
    thread_pool.parallel_for(lambda first, last: chunks.append((first, last)), n)
    assert [row for first, last in sorted(chunks) for row in range(first, last)] == list(range(n))
    assert max(last - first for first, last in chunks) <= thread_pool.MAX_CHUNK_SIZE


def test_no_chunk_starts_after_an_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Running chunks finish; waiting ones are dropped."""
    monkeypatch.setattr(thread_pool, "_num_threads", lambda: 2)
    gate = threading.Event()
    started = []

    def run(first: int, last: int) -> None:
        started.append(first)
        gate.wait()

    def interrupted(futures: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(thread_pool, "wait", interrupted)
        with pytest.raises(KeyboardInterrupt):
            thread_pool.parallel_for(run, 1000)
    gate.set()
    after: list[int] = []
    thread_pool.parallel_for(
        lambda first, last: after.extend(range(first, last)), 1000
    )  # Runs after what is still queued.
    assert len(started) <= 2 and sorted(after) == list(range(1000))


def test_exception_in_a_chunk_is_raised(threads: int) -> None:
    """The caller gets the exception of any thread."""

    def run(first: int, last: int) -> None:
        if first <= 70 < last:
            raise ArithmeticError("row 70")

    with pytest.raises(ArithmeticError, match="row 70"):
        thread_pool.parallel_for(run, 100)


def test_batches_of_all_sizes_share_one_pool(monkeypatch: pytest.MonkeyPatch) -> None:
    """No more threads are kept than numba is set to use."""
    monkeypatch.setattr(thread_pool, "_num_threads", lambda: 3)
    names: set[int] = set()
    for n in (2, 3, 4, 100):
        thread_pool.parallel_for(lambda first, last: names.add(threading.get_ident()), n)
    assert len(names) <= 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_threads_are_stopped_before_a_fork() -> None:
    """Python 3.12 warns of threads at a fork; parent and child start threads again, also after a second fork."""
    code = """
import os, threading
seen = []
os.register_at_fork(before=lambda: seen.append(threading.active_count()))  # Runs after those registered later.
from minigolf_env.physics import thread_pool
thread_pool._num_threads = lambda: 2

def rows():
    found = []
    thread_pool.parallel_for(lambda first, last: found.extend(range(first, last)), 100)
    return sorted(found) == list(range(100)) and threading.active_count() > 1

good = rows()
for _ in range(2):
    child = os.fork()
    if child == 0:
        os._exit(0 if rows() else 1)
    good = good and rows() and os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
print(good, seen)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout == "True [1, 1]\n", done.stderr
