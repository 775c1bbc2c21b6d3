"""A short endurance run: putts and new environments do not make the process grow."""

from __future__ import annotations

import sys

import pytest

from tools.endurance import exceeds_limits, measure_environments, measure_putts

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")


def test_putts_leak_nothing() -> None:
    """After five batches of putts, forty-five more add no memory, descriptor or thread."""
    grown, hours = measure_putts(50 * 1024)
    assert hours > 10.0
    assert not exceeds_limits(grown), grown


def test_environments_leak_nothing() -> None:
    """After thirty environments, 270 more add no memory, descriptor or thread."""
    grown = measure_environments(300)
    assert not exceeds_limits(grown), grown
