"""What all tests share."""

import functools
import os
import shutil
import subprocess
from collections.abc import Iterator

import pytest
from hypothesis import settings

from minigolf_env.rendering import RenderingError

# Continuous integration must say the same twice; elsewhere each run tries new examples.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")


@functools.cache
def why_no_pictures() -> str | None:
    """Return why nothing can be drawn on this machine; None if it can."""
    from minigolf_env.rendering.gl.context import EGLContext

    try:
        EGLContext()
    except RenderingError as error:
        return str(error)
    return None


@pytest.fixture(scope="session")
def gl() -> None:
    """Skip what draws pictures where that is impossible."""
    if why_no_pictures() is not None:
        pytest.skip(str(why_no_pictures()))


@pytest.fixture(scope="session")
def display(gl: None) -> Iterator[str]:
    """Start a screen in memory; yield its name, the value of DISPLAY."""
    xvfb = shutil.which("Xvfb")
    if xvfb is None:
        pytest.skip("windows need a screen: apt-get install xvfb")
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
    """Say what to try next, before the closing line."""
    if exitstatus == 0:
        terminalreporter.write_line("Next: `make train` trains an agent, `minigolf play` is the game, docs/ says more.")
