"""The game on a virtual desktop (Xvfb), controlled by synthetic input events (xdotool)."""

from __future__ import annotations

import json
import os
import queue
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

REQUIRED_TOOLS = ("Xvfb", "xdotool")
MISSING_TOOLS = [tool for tool in REQUIRED_TOOLS if shutil.which(tool) is None]

TIMEOUT = 180.0
"""Longest time to wait for an event or for the end of the game, s; for slow machines."""


@contextmanager
def virtual_desktop(size: str = "1280x900x24") -> Iterator[str]:
    """Yield the name of a new display."""
    read_end, write_end = os.pipe()
    command = ["Xvfb", "-displayfd", str(write_end), "-screen", "0", size, "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[write_end], stderr=subprocess.DEVNULL) as server:
        os.close(write_end)
        try:
            with os.fdopen(read_end) as answer:
                yield ":" + answer.readline().strip()
        finally:
            server.terminate()


class GameDriver:
    """A running game with synthetic mouse and keyboard events.

    Args:
        display: name of the X display.
        folder: current folder of the game; also holds its scores.
        arguments: arguments of ``minigolf play``.
        environment: additional environment variables.
    """

    def __init__(self, display: str, folder: Path, *arguments: str, **environment: str) -> None:
        self._display = display
        self._environment = {**os.environ, "DISPLAY": display, "XDG_DATA_HOME": str(folder / "data"), **environment}
        command = [sys.executable, "-m", "minigolf_env.cli", "play", "--log", *arguments]
        self._errors = (folder / "stderr").open("w+")
        root = str(Path(__file__).parents[3])
        self._environment["PYTHONPATH"] = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
        self.process = subprocess.Popen(
            command, cwd=folder, env=self._environment, stdout=subprocess.PIPE, stderr=self._errors, text=True
        )
        self._queue: queue.Queue[dict[str, Any]] = queue.Queue()
        self.events: list[dict[str, Any]] = []
        """Events received so far."""
        self._listener = threading.Thread(target=self._listen)
        self._listener.start()

    def __enter__(self) -> GameDriver:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._listener.join()
        self._errors.close()

    def wait(self, event: str, **fields: Any) -> dict[str, Any]:
        """Return the next event with a name and some fields; skip all others."""
        deadline = time.monotonic() + TIMEOUT
        while (time.monotonic() < deadline and self.process.poll() is None) or not self._queue.empty():
            try:
                received = self._queue.get(timeout=1.0)
            except queue.Empty:
                continue
            self.events.append(received)
            if received["event"] == event and all(received.get(name) == value for name, value in fields.items()):
                return received
        raise AssertionError(f"no {event} {fields} in {self.events[-20:]}; stderr: {self.errors()}")

    def xdotool(self, *arguments: object) -> str:
        """Run an xdotool command and return its output."""
        command = [str(shutil.which("xdotool")), *map(str, arguments)]
        return subprocess.run(command, env=self._environment, check=True, capture_output=True, text=True).stdout

    def press(self, *keys: str) -> None:
        """Press keys one after another."""
        self.xdotool("key", *keys)

    def move(self, x: float, y: float) -> None:
        """Move the mouse to a pixel of the screen; (0, 0) is the upper left corner of screen and window."""
        self.xdotool("mousemove", int(x), int(y))

    def window_id(self) -> str:
        """Return the X id of the window."""
        return self.xdotool("search", "--name", "minigolf").split()[0]

    def close(self) -> None:
        """Ask the window to close, as a window manager does."""
        from pyglet.libs.x11 import xlib

        connection = xlib.XOpenDisplay(self._display.encode())
        event = xlib.XEvent()
        event.xclient.type, event.xclient.window, event.xclient.format = xlib.ClientMessage, int(self.window_id()), 32
        event.xclient.message_type = xlib.XInternAtom(connection, b"WM_PROTOCOLS", False)
        event.xclient.data.l[0] = xlib.XInternAtom(connection, b"WM_DELETE_WINDOW", False)
        xlib.XSendEvent(connection, event.xclient.window, False, 0, event)
        xlib.XCloseDisplay(connection)

    def cpu_seconds(self) -> float:
        """Return the CPU time that the game has used, s."""
        user, system = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def exit_code(self) -> int:
        """Wait for the end of the game and return its exit code."""
        return self.process.wait(TIMEOUT)

    def errors(self) -> str:
        """Return the game's output on stderr."""
        return Path(self._errors.name).read_text()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self._queue.put(json.loads(line))
