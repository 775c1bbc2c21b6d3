"""A virtual desktop (Xvfb) with the game on it, played by synthetic input (xdotool)."""

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

TOOLS = ("Xvfb", "xdotool")
MISSING = [tool for tool in TOOLS if shutil.which(tool) is None]

PATIENCE = 180.0
"""The longest that a slow machine may take for anything, s."""


@contextmanager
def desktop(size: str = "1280x900x24") -> Iterator[str]:
    """Yield the name of a new display."""
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", size, "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL) as server:
        os.close(writing)
        try:
            with os.fdopen(reading) as answer:
                yield ":" + answer.readline().strip()
        finally:
            server.terminate()


class Player:
    """A running game, and a hand on its mouse and keys.

    Args:
        display: where it is shown.
        folder: its present folder, and where its scores are kept.
        arguments: of ``minigolf play``.
        environment: more environment variables.
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
        self._events: queue.Queue[dict[str, Any]] = queue.Queue()
        self.seen: list[dict[str, Any]] = []
        """Events so far."""
        self._listener = threading.Thread(target=self._listen)
        self._listener.start()

    def __enter__(self) -> Player:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._listener.join()
        self._errors.close()

    def wait(self, event: str, **facts: Any) -> dict[str, Any]:
        """Return the next event of a name and with some facts; others are passed over."""
        deadline = time.monotonic() + PATIENCE
        while (time.monotonic() < deadline and self.process.poll() is None) or not self._events.empty():
            try:
                got = self._events.get(timeout=1.0)
            except queue.Empty:
                continue
            self.seen.append(got)
            if got["event"] == event and all(got.get(name) == value for name, value in facts.items()):
                return got
        raise AssertionError(f"no {event} {facts} in {self.seen[-20:]}; the game says: {self.errors()}")

    def do(self, *words: object) -> None:
        """Run an xdotool command."""
        self._xdotool(*map(str, words))

    def key(self, *keys: str) -> None:
        """Press keys, one after the other."""
        self.do("key", *keys)

    def move(self, x: float, y: float) -> None:
        """Move the mouse to a place on the screen, from which the window's left upper corner is the origin."""
        self.do("mousemove", int(x), int(y))

    def window(self) -> str:
        """Return the window's number."""
        return self._xdotool("search", "--name", "minigolf").split()[0]

    def close(self) -> None:
        """Ask the window to close, as a window manager does."""
        from pyglet.libs.x11 import xlib

        server = xlib.XOpenDisplay(self._display.encode())
        event = xlib.XEvent()
        event.xclient.type, event.xclient.window, event.xclient.format = xlib.ClientMessage, int(self.window()), 32
        event.xclient.message_type = xlib.XInternAtom(server, b"WM_PROTOCOLS", False)
        event.xclient.data.l[0] = xlib.XInternAtom(server, b"WM_DELETE_WINDOW", False)
        xlib.XSendEvent(server, event.xclient.window, False, 0, event)
        xlib.XCloseDisplay(server)

    def cpu(self) -> float:
        """Return the processor time that the game has taken, s."""
        user, system = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def ended(self) -> int:
        """Wait for the end of the game and return its exit code."""
        return self.process.wait(PATIENCE)

    def errors(self) -> str:
        """Return what the game has said on stderr."""
        return Path(self._errors.name).read_text()

    def _xdotool(self, *words: str) -> str:
        command = [str(shutil.which("xdotool")), *words]
        return subprocess.run(command, env=self._environment, check=True, capture_output=True, text=True).stdout

    def _listen(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self._events.put(json.loads(line))
