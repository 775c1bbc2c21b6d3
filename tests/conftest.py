"""Fixtures and settings of all tests."""

import functools
import os
import shutil
import subprocess
from collections.abc import Iterator

import pytest
from hypothesis import settings

from minigolf_env.rendering import RenderingError

# Continuous integration draws the same hypothesis examples in each run; other runs draw new ones.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")


@functools.cache
def rendering_error() -> str | None:
    """Return why this machine cannot render; None if it can."""
    from minigolf_env.rendering.gl.context import EGLContext

    try:
        EGLContext()
    except RenderingError as error:
        return str(error)
    return None


@pytest.fixture(scope="session")
def gl() -> None:
    """Skip tests that render on machines that cannot."""
    if rendering_error() is not None:
        pytest.skip(str(rendering_error()))


@pytest.fixture(scope="session")
def display(gl: None) -> Iterator[str]:
    """Start a virtual display (Xvfb); yield the value of DISPLAY."""
    xvfb = shutil.which("Xvfb")
    if xvfb is None:
        pytest.skip("windows need a display: apt-get install xvfb")
    read, write = os.pipe()
    command = [xvfb, "-displayfd", str(write), "-screen", "0", "1280x1024x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as pipe:
        number = pipe.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, exitstatus: int) -> None:
    """Print what to try next, before the summary line."""
    if exitstatus == 0:
        terminalreporter.write_line("Next: `make train` trains an agent, `minigolf play` is the game, docs/ says more.")
