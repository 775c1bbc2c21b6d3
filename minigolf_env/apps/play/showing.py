"""A stroke on its way over the screen: which moment of it is to be seen now."""

from __future__ import annotations

import time
from collections.abc import Callable

from minigolf_env.rendering.replay import Replay

SLOW = 0.25
"""Pace of a replay."""


class Showing:
    """A stroke on its way over the screen.

    Args:
        replay: what to show.
        pace: how fast, as a share of real time.
        then: called at the end.
    """

    def __init__(self, replay: Replay, pace: float, then: Callable[[], None]) -> None:
        self.replay, self.pace, self.then = replay, pace, then
        self.start = time.perf_counter()
        self.time = 0.0
        """Of the replay, s."""
        self.pictures = 0
        self._skipped = False

    def advance(self, fps: int | None) -> bool:
        """Go on to the present moment, or by one picture of a film; return whether there is something new."""
        elapsed = time.perf_counter() - self.start
        if fps is not None and not self._skipped:
            if elapsed < self.pictures / fps:
                return False
            elapsed = self.pictures / fps
        self.time = self.replay.duration if self._skipped else min(elapsed * self.pace, self.replay.duration)
        self.pictures += 1
        return True

    @property
    def is_over(self) -> bool:
        """Whether its end has been shown."""
        return self.time >= self.replay.duration

    def skip(self) -> None:
        """Let the next moment be the end."""
        self._skipped = True
