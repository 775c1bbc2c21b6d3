"""Plays a stroke in real time, in slow motion, or frame by frame for a video."""

from __future__ import annotations

import time
from collections.abc import Callable

from minigolf_env.rendering.replay import Replay

SLOW_MOTION_RATE = 0.25
"""Playback rate of a replay, as a share of real time."""


class ReplayPlayer:
    """The playback of one stroke.

    Args:
        replay: the stroke.
        rate: playback rate, as a share of real time.
        on_end: called after the last frame.
    """

    def __init__(self, replay: Replay, rate: float, on_end: Callable[[], None]) -> None:
        self.replay = replay
        self.rate = rate
        self.on_end = on_end
        self.start = time.perf_counter()
        """Clock when the playback started, s."""
        self.time = 0.0
        """Time of the replay that is displayed, s."""
        self.frame_count = 0
        """Number of frames so far."""
        self._skipped = False

    def advance(self, fps: int | None) -> bool:
        """Advance to the present moment, or by one video frame; return whether there is a new frame.

        Args:
            fps: frame rate of a video that is being recorded; None if there is none.
        """
        elapsed = time.perf_counter() - self.start
        if fps is not None and not self._skipped:
            if elapsed < self.frame_count / fps:
                return False
            elapsed = self.frame_count / fps
        self.time = self.replay.duration if self._skipped else min(elapsed * self.rate, self.replay.duration)
        self.frame_count += 1
        return True

    @property
    def is_over(self) -> bool:
        """True if the last frame has been displayed."""
        return self.time >= self.replay.duration

    def skip(self) -> None:
        """Make the next frame the last one."""
        self._skipped = True
