"""A little of the endurance run: putting, and making environments, gains nothing."""

from __future__ import annotations

import sys

import pytest

from tools.endurance import create, putt, too_much

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")


def test_putts_gain_nothing() -> None:
    """Fifty batches, after the first five."""
    grown, hours = putt(50 * 1024)
    assert hours > 10.0 and not too_much(grown), grown


def test_environments_gain_nothing() -> None:
    """Three hundred, after the first thirty."""
    grown = create(300)
    assert not too_much(grown), grown
