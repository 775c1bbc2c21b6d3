"""What one environment shows: its last putts as pictures, a list of pictures, or a film in a window."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.replay import Replay, still
from minigolf_env.rendering.scene_state import Frame

if TYPE_CHECKING:
    from minigolf_env.rendering.window import Window

FloatArray = NDArray[np.float64]
Picture = NDArray[np.uint8]
Trace = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""From a ball's position and velocity (3,) to its path (T, 3) and times (T,)."""

RENDER_MODES = ("rgb_array", "rgb_array_list", "human")
PROFILES = ("auto", "high", "fast")
FPS = 30
"""Pictures a second in lists and videos: a putt of 5 s is 138 MB at 640 x 480."""

TRACE_POINTS = 400
"""Of the last putt's way in a still picture."""


@dataclass(frozen=True)
class Settings:
    """How an environment shows itself; checked by envs/options.py."""

    mode: str | None = None
    """One of RENDER_MODES, or None: nothing is shown."""
    size: tuple[int, int] = (640, 480)
    """Width and height, pixels."""
    camera: str = "follow"
    """One of camera.CAMERAS."""
    profile: str = "auto"
    """One of PROFILES; "auto" is "high", and "fast" in a window that is drawn without a GPU."""

    speed: float = 1.0
    """How much faster than real time a window shows putts."""

    @property
    def aspect(self) -> float:
        """Width / height."""
        return self.size[0] / self.size[1]


def check_size(size: tuple[int, int], name: str) -> tuple[int, int]:
    """Return the width and height of a picture, pixels, or raise a ValueError; ``name`` is what it calls them."""
    try:
        width, height = (operator.index(side) for side in size)
    except (TypeError, ValueError):
        width = height = 0
    if width < 1 or height < 1:
        raise ValueError(f"{name}: expected width and height in pixels, at least 1, received {size!r}.")
    return width, height


class Stage(NamedTuple):
    """Where putts are played."""

    course: Course
    trace: Trace
    """The physics."""


class _Event(NamedTuple):
    """A ball that is put somewhere, or a putt."""

    stage: Stage
    lies: FloatArray
    """(3,) where the ball lies then, m."""
    before: FloatArray | None = None
    """(3,) where it was struck, m; None: it was put there."""
    velocity: FloatArray | None = None
    """(3,) how it was struck, m/s."""


class Screen:
    """Shows the putts of one environment; where nothing is asked for, nothing is computed.

    Args:
        stage: where the first putts are played.
        settings: what to show.
    """

    def __init__(self, stage: Stage, settings: Settings) -> None:
        self._settings = settings
        self._stage = self._entered = stage
        self._unseen: list[_Event] = []
        self._mirrors: list[Screen] = []
        self._ball, self._turn, self._clock = np.zeros(3), np.eye(3), 0.0
        self._last: Replay | None = None
        self._window: Window | None = None

    def put(self, ball: FloatArray, stage: Stage | None = None, keep_last: bool = False) -> None:
        """Begin anew with the ball at rest at (3,).

        Args:
            ball: its centre, m.
            stage: where it lies and the next putts are played; None: where the last ones were.
            keep_last: the last putt is still to be seen.
        """
        self._entered = stage or self._entered
        self._add(_Event(self._entered, ball), self._unseen[-1:] if keep_last else [])
        for mirror in self._mirrors:
            mirror.put(ball, stage, keep_last)

    def putt(self, before: FloatArray, velocity: FloatArray, lies: FloatArray) -> None:
        """Take in a putt: where it was struck (3,), how (3,), and where the ball lies now (3,)."""
        self._add(_Event(self._entered, lies, before, velocity), self._unseen)
        for mirror in self._mirrors:
            mirror.putt(before, velocity, lies)

    def mirror(self) -> Screen:
        """Return a screen that from now on takes in what this one does, for ``film``: neither sees it for the other."""
        mirror = Screen(self._entered, replace(self._settings, mode="rgb_array_list"))
        mirror._ball = self._unseen[-1].lies if self._unseen else self._ball
        self._mirrors.append(mirror)
        return mirror

    def render(self) -> Picture | list[Picture] | None:
        """Return what the render mode promises; a list is given once."""
        if self._settings.mode == "rgb_array":
            return self.picture()
        if self._settings.mode == "rgb_array_list":
            return list(self.film())
        return None

    def picture(self) -> Picture:
        """Return the present state, with the way of the last putt."""
        for event in self._take():
            self._replay(event)
        camera, frame = self._still()
        if self._last is not None:
            frame = frame._replace(turn=self._turn, lines=(self._last.way(TRACE_POINTS),))
        return self._draw(camera, frame)

    def film(self, fps: int = FPS, until_put: bool = False) -> Iterator[Picture]:
        """Yield the pictures of what has not been seen yet: one of a ball put on the tee, ``fps`` a second of putts.

        ``until_put``: a ball that is put somewhere, and what follows, is left for the next call.
        """
        for event in self._take(until_put):
            replay = self._replay(event)
            if replay is None:
                yield self._draw(*self._still())
            else:
                for time in replay.moments(fps):
                    yield self._draw(*replay.at(time))

    def forget(self, until_put: bool = False) -> None:
        """Let pass what ``film`` would show."""
        for event in self._take(until_put):
            self._begin(event)

    def close(self) -> None:
        """Close the window, if there is one, and tell mirrors nothing more."""
        self._mirrors = []
        if self._window is not None:
            self._window.close()

    def _add(self, event: _Event, before: list[_Event]) -> None:
        if self._settings.mode is None:
            return
        self._unseen = [*before, event]
        if self._settings.mode == "human":
            if self._window is not None and not self._window.is_open:
                self.forget()
            for shown in self._take():
                replay = self._replay(shown)
                if replay is None:
                    self._open().show(*self._still())
                else:
                    self._open().play(replay)

    def _take(self, until_put: bool = False) -> Iterator[_Event]:
        """Yield what has not been seen, and forget it."""
        while self._unseen and not (until_put and self._unseen[0].velocity is None):
            yield self._unseen.pop(0)

    def _begin(self, event: _Event) -> None:
        self._stage = event.stage
        self._ball, self._turn, self._clock, self._last = event.lies, np.eye(3), 0.0, None

    def _replay(self, event: _Event) -> Replay | None:
        """Let an event happen; return the putt, which goes on from the one before, or None for a ball that was put."""
        if event.before is None or event.velocity is None:
            self._begin(event)
            return None
        if event.stage is not self._stage:  # The ball was put there unseen.
            self._begin(event)
        self._ball = event.lies
        path, times = self._stage.trace(event.before, event.velocity)
        replay = Replay(
            self._stage.course,
            path,
            times,
            self._settings.camera,
            self._settings.aspect,
            turn=self._turn,
            clock=self._clock,
            lies=event.lies,
            before=None if self._last is None or self._settings.mode == "rgb_array" else self._last.last_camera,
        )
        self._turn, self._clock, self._last = replay.last_turn, self._clock + replay.time, replay
        return replay

    def _still(self) -> tuple[Camera, Frame]:
        return still(self._stage.course, self._settings.camera, self._settings.aspect, self._ball, self._clock)

    def _draw(self, camera: Camera, frame: Frame) -> Picture:
        from minigolf_env.rendering.offscreen import draw

        profile = "fast" if self._settings.profile == "fast" else "high"
        return draw(self._stage.course, camera, frame, self._settings.size, profile)

    def _open(self) -> Window:
        if self._window is None:
            from minigolf_env.rendering.window import Window

            self._window = Window(self._stage.course, self._settings)
        self._window.enter(self._stage.course)
        return self._window

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy starts with: everything but the window."""
        return {**self.__dict__, "_window": None}
