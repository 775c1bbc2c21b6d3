"""Rendering of one environment: its putts as an image, as a list of frames, or as an animation in a window.

The environment reports each placement of the ball and each putt. Paths are simulated and images drawn only when a
method that returns or shows images is called.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.image import Image
from minigolf_env.rendering.replay import Replay, static_view
from minigolf_env.rendering.scene_state import SceneState
from minigolf_env.rendering.settings import RENDER_FPS, RenderSettings

if TYPE_CHECKING:
    from minigolf_env.rendering.window import Window

FloatArray = NDArray[np.float64]
PathSimulator = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Function from a ball's position and velocity (3,) to its path (T, 3) and times (T,)."""

NUM_PATH_POINTS = 400
"""Number of points of the line that shows the last putt in a single image."""


class PuttScene(NamedTuple):
    """The course on which putts are played, and its physics."""

    course: Course
    """The course."""
    simulate_path: PathSimulator
    """Simulation of a putt that records the path."""


class _Placement(NamedTuple):
    """A placement of the ball at rest."""

    scene: PuttScene
    """The course and its physics."""
    next_position: FloatArray
    """Position (3,) of the ball for the next putt, m."""


class _Putt(NamedTuple):
    """A putt."""

    scene: PuttScene
    """The course and its physics."""
    next_position: FloatArray
    """Position (3,) of the ball for the next putt, m."""
    start: FloatArray
    """Position (3,) from which the ball was struck, m."""
    velocity: FloatArray
    """Launch velocity (3,), m/s."""


_Event = _Placement | _Putt


class EpisodeRenderer:
    """Renders the putts of one environment; simulates and draws only on request.

    Args:
        scene: the course of the first putts and its physics.
        settings: render mode, image size, camera and profile.
    """

    def __init__(self, scene: PuttScene, settings: RenderSettings) -> None:
        self._settings = settings
        self._scene = scene
        """Scene of the last rendered event."""
        self._next_scene = scene
        """Scene of the next reported event."""
        self._pending: list[_Event] = []
        """Reported events that have not been rendered."""
        self._subscribers: list[EpisodeRenderer] = []
        self._ball = np.zeros(3)
        self._rotation = np.eye(3)
        self._time = 0.0
        """Seconds of play since the ball was placed."""
        self._last_replay: Replay | None = None
        self._window: Window | None = None

    def place_ball(self, ball: FloatArray, scene: PuttScene | None = None, keep_last: bool = False) -> None:
        """Report that the ball was placed at rest, as at a reset.

        Args:
            ball: centre (3,) of the ball, m.
            scene: the course of the ball and of the next putts; None: the same as before.
            keep_last: the last event has not been rendered and still will be; False: pending events are dropped.
        """
        self._next_scene = scene or self._next_scene
        self._add(_Placement(self._next_scene, ball), self._pending[-1:] if keep_last else [])
        for subscriber in self._subscribers:
            subscriber.place_ball(ball, scene, keep_last)

    def add_putt(self, start: FloatArray, velocity: FloatArray, next_position: FloatArray) -> None:
        """Report a putt: where it started (3,), its velocity (3,), and where the ball is for the next one (3,)."""
        self._add(_Putt(self._next_scene, next_position, start, velocity), self._pending)
        for subscriber in self._subscribers:
            subscriber.add_putt(start, velocity, next_position)

    def subscribe(self) -> EpisodeRenderer:
        """Return another renderer that receives all later events, for ``iter_frames``.

        Each renderer has its own list of pending events: neither takes frames from the other.
        """
        subscriber = EpisodeRenderer(self._next_scene, replace(self._settings, mode="rgb_array_list"))
        subscriber._ball = self._pending[-1].next_position if self._pending else self._ball
        self._subscribers.append(subscriber)
        return subscriber

    def render(self) -> Image | list[Image] | None:
        """Return the result of the render mode; each frame is in one list only."""
        if self._settings.mode == "rgb_array":
            return self.frame()
        if self._settings.mode == "rgb_array_list":
            return list(self.iter_frames())
        return None

    def frame(self) -> Image:
        """Return an image of the present state, with the path of the last putt."""
        for event in self._take_pending():
            self._apply(event)
        camera, state = self._static_view()
        if self._last_replay is not None:
            state = state._replace(rotation=self._rotation, lines=(self._last_replay.path_line(NUM_PATH_POINTS),))
        return self._draw(camera, state)

    def iter_frames(self, fps: int = RENDER_FPS) -> Iterator[Image]:
        """Yield the frames of all pending events: one of each placed ball, ``fps`` per second of each putt."""
        for event in self._take_pending():
            replay = self._apply(event)
            if replay is None:
                yield self._draw(*self._static_view())
            else:
                for time in replay.frame_times(fps):
                    yield self._draw(*replay.view(time))

    def skip(self) -> None:
        """Drop the pending events without rendering them."""
        for event in self._take_pending():
            self._start_episode(event)

    def close(self) -> None:
        """Close the window, if there is one, and remove all subscribers."""
        self._subscribers = []
        if self._window is not None:
            self._window.close()

    def _add(self, event: _Event, pending: list[_Event]) -> None:
        """Append an event to the pending ones; a window shows it at once."""
        if self._settings.mode is None:
            return
        self._pending = [*pending, event]
        if self._settings.mode == "human":
            self._show_pending()

    def _show_pending(self) -> None:
        """Show all pending events in the window; drop them if its user has closed it."""
        if self._window is not None and not self._window.is_open:
            self.skip()
        for event in self._take_pending():
            replay = self._apply(event)
            if replay is None:
                self._open_window().draw_and_handle_events(*self._static_view())
            else:
                self._open_window().play(replay)

    def _take_pending(self) -> Iterator[_Event]:
        """Yield the pending events in order and remove each."""
        while self._pending:
            yield self._pending.pop(0)

    def _start_episode(self, event: _Event) -> None:
        """Take over the scene and the ball of an event, without a history of putts."""
        self._scene = event.scene
        self._ball = event.next_position
        self._rotation = np.eye(3)
        self._time = 0.0
        self._last_replay = None

    def _apply(self, event: _Event) -> Replay | None:
        """Advance to after an event; return the replay of a putt, or None for a placed ball.

        A putt's replay continues the previous one: camera, rotation of the ball and time.
        """
        if isinstance(event, _Placement):
            self._start_episode(event)
            return None
        if event.scene is not self._scene:  # The ball was placed there, and that event was dropped.
            self._start_episode(event)
        self._ball = event.next_position
        path, times = self._scene.simulate_path(event.start, event.velocity)
        previous = None if self._settings.mode == "rgb_array" else self._last_replay
        replay = Replay(
            self._scene.course,
            path,
            times,
            self._settings.camera,
            self._settings.aspect,
            rotation=self._rotation,
            start_time=self._time,
            next_position=event.next_position,
            previous_camera=None if previous is None else previous.final_camera,
        )
        self._rotation = replay.final_rotation
        self._time += replay.shot_time
        self._last_replay = replay
        return replay

    def _static_view(self) -> tuple[Camera, SceneState]:
        """Return camera and scene state of the ball at rest."""
        settings = self._settings
        return static_view(self._scene.course, settings.camera, settings.aspect, self._ball, self._time)

    def _draw(self, camera: Camera, state: SceneState) -> Image:
        """Return an image in the settings' size and profile."""
        from minigolf_env.rendering.gl.offscreen import draw

        profile = "fast" if self._settings.profile == "fast" else "high"
        return draw(self._scene.course, camera, state, self._settings.size, profile)

    def _open_window(self) -> Window:
        """Return the window on the present course; it is opened at the first call."""
        if self._window is None:
            from minigolf_env.rendering.window import Window

            self._window = Window(self._scene.course, self._settings)
        self._window.set_course(self._scene.course)
        return self._window

    def __getstate__(self) -> dict[str, Any]:
        """Return the state of a copy: everything but the window."""
        return {**self.__dict__, "_window": None}
