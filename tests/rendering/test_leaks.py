"""Rendering leaks neither memory nor file descriptors."""

from __future__ import annotations

import sys

import pytest

from tests.rendering.leaks import growth_of_environments, growth_of_images

pytestmark = [
    pytest.mark.usefixtures("gl"),
    pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc"),
]


def test_environments_leak_no_memory_and_no_descriptors() -> None:
    """With more sizes than framebuffers are cached, memory grows by less than one small framebuffer an environment."""
    grown = growth_of_environments(300)
    assert grown.descriptors <= 0
    assert grown.megabytes < 8.0


def test_images_leak_no_memory_and_no_descriptors() -> None:
    """A thousand more images use no more memory."""
    grown = growth_of_images(1000)
    assert grown.descriptors <= 0
    assert grown.megabytes < 4.0
