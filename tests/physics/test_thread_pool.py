"""Pieces on threads: all rows once, a bounded number each, none after an interrupt, no thread across a fork."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from minigolf_env.physics import thread_pool


@pytest.fixture(params=[1, 2, 3])
def threads(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """Let numba be set to so many threads."""
    monkeypatch.setattr(thread_pool, "_num_threads", lambda: request.param)
    return int(request.param)


@pytest.mark.parametrize("n", [0, 1, 2, 7, 1000, 100_003])
def test_pieces_are_all_rows_once(threads: int, n: int) -> None:
    """And short enough for an interrupt to come through, on one thread too."""
    pieces: list[tuple[int, int]] = []
    thread_pool.parallel_for(lambda first, last: pieces.append((first, last)), n)
    assert [row for first, last in sorted(pieces) for row in range(first, last)] == list(range(n))
    assert max(last - first for first, last in pieces) <= thread_pool.MAX_CHUNK_SIZE


def test_no_piece_begins_after_an_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that run come to their end; those that wait for a thread are dropped."""
    monkeypatch.setattr(thread_pool, "_num_threads", lambda: 2)
    gate, begun = threading.Event(), []

    def run(first: int, last: int) -> None:
        begun.append(first)
        gate.wait()

    def interrupted(futures: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(thread_pool, "wait", interrupted)
        with pytest.raises(KeyboardInterrupt):
            thread_pool.parallel_for(run, 1000)
    gate.set()
    after: list[int] = []
    thread_pool.parallel_for(lambda first, last: after.extend(range(first, last)), 1000)  # Behind what is still queued.
    assert len(begun) <= 2 and sorted(after) == list(range(1000))


def test_an_error_in_a_piece_comes_out(threads: int) -> None:
    """Whichever thread it ran on."""

    def run(first: int, last: int) -> None:
        if first <= 70 < last:
            raise ArithmeticError("row 70")

    with pytest.raises(ArithmeticError, match="row 70"):
        thread_pool.parallel_for(run, 100)


def test_batches_of_all_sizes_share_their_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """No more are kept than numba is set to use."""
    monkeypatch.setattr(thread_pool, "_num_threads", lambda: 3)
    names: set[int] = set()
    for n in (2, 3, 4, 100):
        thread_pool.parallel_for(lambda first, last: names.add(threading.get_ident()), n)
    assert len(names) <= 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_no_threads_are_there_at_a_fork() -> None:
    """Python 3.12 warns of them; parent and child start threads again, and a second fork is as good as the first."""
    code = """
import os, threading
seen = []
os.register_at_fork(before=lambda: seen.append(threading.active_count()))  # The first to register is the last asked.
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
