"""The game in its window: input events change the state, and a timer draws what has changed.

Nothing is drawn, and no timer runs, while nothing changes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import pyglet

from minigolf_env.apps.play.aim import Aim, aim_along_view, aim_from_drag
from minigolf_env.apps.play.capture import VIDEO_FPS, WindowRecorder, save_screenshot
from minigolf_env.apps.play.golf_round import GolfRound
from minigolf_env.apps.play.guides import Guides
from minigolf_env.apps.play.hud import Hud
from minigolf_env.apps.play.hud_text import FAILED_STROKE_MESSAGES, hud_state
from minigolf_env.apps.play.orbit_camera import OrbitCamera
from minigolf_env.apps.play.replay_player import SLOW_MOTION_RATE, ReplayPlayer
from minigolf_env.apps.play.stroke import HUMAN_NAME, PlayedStroke
from minigolf_env.apps.play.throw_mode import ThrowMode
from minigolf_env.rendering import Camera, Line, SceneState
from minigolf_env.rendering.camera import follow_camera
from minigolf_env.rendering.replay import Replay, flag_position
from minigolf_env.rendering.window import Window

TICK_INTERVAL = 1.0 / 60.0
"""Time between two calls of the timer, s."""

MAX_CAMERA_INTERVAL = 0.1
"""Longest time that the camera moves in one frame, s."""

MAX_ELEVATION = 85.0
"""Largest elevation of a throw, degrees above the horizon."""

Log = Callable[..., None]
"""A function that takes an event's name and its fields."""


class App:
    """One window on a round of golf, or on a room to throw in.

    Args:
        window: the window, not yet visible.
        mode: the round, or the room.
        log: called for each event.
    """

    def __init__(self, window: Window, mode: GolfRound | ThrowMode, log: Log) -> None:
        self.window = window
        self.mode = mode
        self.log = log
        self.golf = mode if isinstance(mode, GolfRound) else None
        """The round; None in a room."""
        self.view = OrbitCamera()
        self.aim: Aim | None = None
        self.message = "Drag back anywhere and release" if self.golf else "Drag back and release to throw"
        self.card_shown = False
        self.path_shown = True
        self.elevation = mode.default_elevation
        self.recorder = WindowRecorder()
        self.last_stroke: PlayedStroke | None = None
        self._hud = Hud(window.window)
        self._executor = ThreadPoolExecutor(1)
        self._pending: tuple[Future[Any], Callable[[Any], None]] | None = None
        self._player: ReplayPlayer | None = None
        self._hint_path: tuple[Line, ...] = ()
        self._rotation = np.eye(3)
        self._needs_redraw = True
        self._is_ticking = False
        self._last_tick = 0.0
        self._wants_screenshot = False
        window.overlay = self._draw_overlay

    def run(self) -> None:
        """Play until the window is closed."""
        # Compile the physics before the window appears.
        self.mode.predict_path(aim_along_view(self._target_camera(), elevation=self.elevation))
        self.window.window.set_visible(True)
        self.wake()
        try:
            pyglet.app.run(None)
        finally:
            self.log("closed")
            self._executor.shutdown(cancel_futures=True)
            self.recorder.close()
            self.window.close()

    @property
    def is_ready(self) -> bool:
        """True if the player may strike."""
        return self._player is None and not (self.golf and self.golf.is_over)

    @property
    def is_busy(self) -> bool:
        """True while a stroke is displayed or the opponent plays."""
        return self._player is not None or bool(self.golf and self.golf.is_opponents_turn)

    def wake(self) -> None:
        """Redraw the window soon, and keep drawing while something moves."""
        self._needs_redraw = True
        if not self._is_ticking:
            self._is_ticking = True
            self._last_tick = time.perf_counter() - TICK_INTERVAL
            pyglet.clock.schedule_interval(self._tick, TICK_INTERVAL)

    def drag_aim(self, drag: tuple[float, float]) -> None:
        """Set the aim from a mouse drag, pixels of the window."""
        if self.is_ready:
            size = self.window.window.get_size()
            self.aim = aim_from_drag(self.view.camera, self.mode.ball, drag, size, self.elevation)
            self.wake()

    def nudge_aim(self, degrees: float = 0.0, power: float = 0.0, elevation: float = 0.0) -> None:
        """Change the aim by keys; start one if there is none.

        Args:
            degrees: turn to the left.
            power: change of power, as a share of the top speed.
            elevation: change of elevation, degrees.
        """
        if not self.is_ready:
            return
        self.elevation = min(MAX_ELEVATION, max(0.0, self.elevation + elevation))
        aim = self.aim or aim_along_view(self.view.camera, elevation=self.elevation)
        if degrees or power:
            aim = aim.turned(degrees).stronger(power)
        self.set_aim(Aim(aim.x, aim.y, self.elevation))

    def set_aim(self, aim: Aim | None) -> None:
        """Set the aim; None cancels it."""
        self.aim = aim
        if aim is not None:
            self.log("aim", x=aim.x, y=aim.y, power=aim.power, elevation=aim.elevation)
        self.wake()

    def strike(self) -> None:
        """Strike the ball with the present aim."""
        if self.aim is None or not self.is_ready:
            return
        aim = self.aim
        self._pending = None
        stroke = self.mode.strike(aim)
        self.log("putt", player=stroke.player, x=aim.x, y=aim.y, power=aim.power)
        self.message = ""
        self._play_back(stroke, 1.0, lambda: self._on_rest(stroke))

    def replay_last_stroke(self) -> None:
        """Show the last stroke again, in slow motion."""
        if self.last_stroke is None or self.is_busy:
            return
        message = self.message
        card_shown = self.card_shown
        self.message = "Replay"
        self.view.base = None
        self._play_back(self.last_stroke, SLOW_MOTION_RATE, lambda: self._on_replayed(message, card_shown))

    def skip(self) -> None:
        """Skip to the end of the stroke that is displayed."""
        if self._player is not None:
            self._player.skip()

    def undo(self) -> None:
        """Undo the last stroke."""
        if self.golf and not self.is_busy and self.golf.undo():
            self._clear_stroke_state()
            self.show_message("Practice: this score will not be kept as your best")
            self.log("undo", strokes=self.golf.strokes)

    def next_hole(self) -> None:
        """Go to the next hole."""
        if self.golf and not self.is_busy:
            self.golf.next_hole()
            self.window.course = self.golf.course
            self.view.base = None
            self._clear_stroke_state()
            self.show_message("")
            self.log("hole", name=self.golf.hole)

    def hint(self) -> None:
        """Search for a putt in the background."""
        if self.golf and self.is_ready and self._pending is None:
            self.show_message("Searching ...")
            golf = self.golf
            self._run_in_background(
                golf.hint, lambda aim: self._on_hint(aim, self._guides().hint_path(golf.full_path(aim)))
            )

    def toggle_recording(self) -> None:
        """Start a video, or finish it."""
        size = self.window.window.get_framebuffer_size()
        self.show_message(self.recorder.toggle(self.mode.course.name, size))
        self.log("recording", on=self.recorder.is_on)

    def screenshot(self) -> None:
        """Save the next frame of the window."""
        self._wants_screenshot = True
        self.wake()

    def show_message(self, message: str) -> None:
        """Show a message above the scene."""
        self.message = message
        self.wake()

    def _guides(self) -> Guides:
        return Guides(self.mode.course.ball_radius, flying=self.golf is None)

    def _clear_stroke_state(self) -> None:
        """Clear everything that belongs to the ball's former position."""
        self.aim = None
        self.last_stroke = None
        self.card_shown = False
        self._hint_path = ()
        self._pending = None
        self._rotation = np.eye(3)

    def _run_in_background(self, work: Callable[[], Any], on_result: Callable[[Any], None]) -> None:
        """Run a function in the worker thread; pass its result to ``on_result`` in the main thread."""
        self._pending = self._executor.submit(work), on_result
        self.wake()

    def _on_hint(self, aim: Aim, hint_path: tuple[Line, ...]) -> None:
        self._hint_path = hint_path
        self.show_message("Hint: Enter plays it")
        self.log("hint", x=aim.x, y=aim.y)
        self.set_aim(aim)

    def _on_replayed(self, message: str, card_shown: bool) -> None:
        self.card_shown = card_shown
        self.show_message(message)
        self.log("replayed")

    def _on_rest(self, stroke: PlayedStroke) -> None:
        """Announce the result of a stroke and continue with the opponent's turn or the score card."""
        position = stroke.next_position.tolist()
        self.log("rest", player=stroke.player, status=stroke.status, position=position, strokes=self.mode.strokes)
        self.message = FAILED_STROKE_MESSAGES.get(stroke.status, self.message)
        golf = self.golf
        if golf is None:
            return
        score_message = golf.score_message(stroke.player)
        if score_message:
            self.message = score_message if stroke.player == HUMAN_NAME else f"{stroke.player}: {score_message}"
        if golf.is_opponents_turn:
            self._run_in_background(golf.opponent_putt, lambda putt: self._on_opponent(golf.opponent_strike(putt)))
        elif golf.is_over:
            self.card_shown = True
            self.log("hole_over", rows=golf.card.rows(golf.best_scores.strokes_by_hole))

    def _on_opponent(self, stroke: PlayedStroke) -> None:
        self.message = f"{stroke.player} plays"
        self._play_back(stroke, 1.0, lambda: self._on_rest(stroke))

    def _play_back(self, stroke: PlayedStroke, rate: float, on_end: Callable[[], None]) -> None:
        """Start to display a stroke."""
        replay = Replay(
            self.mode.course,
            stroke.path,
            stroke.times,
            "follow",
            self._aspect,
            rotation=self._rotation,
            next_position=stroke.next_position,
            previous_camera=self.view.base,
        )
        self.aim = None
        self.last_stroke = stroke
        self.card_shown = False
        self._hint_path = ()
        self._player = ReplayPlayer(replay, rate, on_end)
        self.wake()

    def _tick(self, _: float) -> None:
        """Advance by one frame, draw it if it is new, and stop the timer when nothing moves."""
        now = time.perf_counter()
        elapsed = min(now - self._last_tick, MAX_CAMERA_INTERVAL)
        self._last_tick = now
        moves = self._advance(elapsed)
        if moves or self._needs_redraw:
            self._draw()
        if not moves and not self._needs_redraw and self._pending is None and self._player is None:
            pyglet.clock.unschedule(self._tick)
            self._is_ticking = False
            self._log_idle()

    def _advance(self, elapsed: float) -> bool:
        """Advance the time by ``elapsed`` seconds; return whether the view changes."""
        if self._player is not None:
            return self._advance_stroke(self._player)
        if self._pending is not None and self._pending[0].done():
            future, on_result = self._pending
            self._pending = None
            on_result(future.result())
        return self.view.chase(self._target_camera(), elapsed)

    def _advance_stroke(self, player: ReplayPlayer) -> bool:
        """Advance the stroke that is displayed; return whether the view changes."""
        if not player.advance(VIDEO_FPS if self.recorder.is_on else None):
            return False
        self.view.base = player.replay.camera(player.time)
        if player.is_over:
            self.log("shown", frames=player.frame_count, seconds=time.perf_counter() - player.start)
            self._rotation = player.replay.final_rotation
            self._player = None
            player.on_end()
        return True

    @property
    def _aspect(self) -> float:
        width, height = self.window.window.get_size()
        return float(max(width, 1) / max(height, 1))  # A minimised window has the size 0.

    def _target_camera(self) -> Camera:
        return follow_camera(self.mode.course, self.mode.displayed_ball, self._aspect)

    def _draw(self) -> None:
        self._needs_redraw = False
        player = self._player
        state = self._static_scene() if player is None else player.replay.scene_state(player.time)
        self.window.draw(self.view.camera, state)
        if player is not None and self.recorder.is_on:
            self.message = self.recorder.add(self.window) or self.message

    def _draw_overlay(self) -> None:
        """Draw the head-up display over a frame that is not displayed yet."""
        state = hud_state(
            self.mode, self.aim, self.message, card_shown=self.card_shown, is_recording=self.recorder.is_on
        )
        self._hud.draw(state)
        if self._wants_screenshot:
            self._wants_screenshot = False
            self.show_message(save_screenshot())
            self.log("screenshot", message=self.message)

    def _static_scene(self) -> SceneState:
        """Return the scene with the ball at rest and the aiming guides."""
        course = self.mode.course
        ball = self.mode.displayed_ball
        lines = self._hint_path
        if self.aim is not None:
            guides = self._guides()
            if self.path_shown:
                lines += guides.dashes(self.mode.predict_path(self.aim), self.aim)
            lines += guides.arrow(ball, self.aim)
        return SceneState(ball, self._rotation, flag_position(course, ball), lines)

    def _log_idle(self) -> None:
        """Log that nothing moves, with the pixel of the ball for programs that move the mouse to it."""
        width, height = self.window.window.get_size()
        ball = np.append(self.mode.displayed_ball, 1.0)
        x, y, _, w = self.view.camera.clip_from_world(width / height) @ ball
        pixel = [round((x / w + 1.0) * width / 2.0), round((1.0 - y / w) * height / 2.0)]
        self.log("idle", size=[width, height], ball=pixel, ready=self.is_ready, strokes=self.mode.strokes)
