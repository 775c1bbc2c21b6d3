"""The cost of a block in function calls and bytes, which unlike its time is the same on every machine."""

from __future__ import annotations

import sys
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass
class CallCount:
    """Result of ``count_calls``."""

    count: int = 0
    """Number of calls and returns of functions, Python's and built-in ones."""


@dataclass
class MemoryUse:
    """Result of ``measure_memory``."""

    peak: int = 0
    """Most memory, bytes, that Python and numpy held at once for what the block allocated."""


@contextmanager
def count_calls() -> Iterator[CallCount]:
    """Count the calls and returns of functions in a block, whether it raises or not."""
    calls = CallCount()

    def count(*_: object) -> None:
        calls.count += 1

    sys.setprofile(count)
    try:
        yield calls
    finally:
        sys.setprofile(None)


@contextmanager
def measure_memory() -> Iterator[MemoryUse]:
    """Measure the peak memory of a block, whether it raises or not; it is known after the block."""
    memory = MemoryUse()
    tracemalloc.start()
    try:
        yield memory
    finally:
        memory.peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
