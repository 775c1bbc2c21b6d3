"""Drawing leaks neither memory nor file descriptors."""

from __future__ import annotations

import sys

import pytest

from tests.rendering.leaks import environments, pictures

pytestmark = [
    pytest.mark.usefixtures("gl"),
    pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc"),
]


def test_environments_leak_nothing() -> None:
    """More sizes than are kept come and go: memory grows by less than one small picture's buffers an environment."""
    grown = environments(300)
    assert grown.descriptors <= 0
    assert grown.megabytes < 8.0


def test_pictures_leak_nothing() -> None:
    """A thousand more pictures need no more memory."""
    grown = pictures(1000)
    assert grown.descriptors <= 0
    assert grown.megabytes < 4.0
