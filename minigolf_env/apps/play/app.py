"""The game in its window: what is shown when, and what happens next. Nothing is drawn while nothing changes."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import pyglet

from minigolf_env.apps.play.aim import Aim, from_drag, towards
from minigolf_env.apps.play.game import YOU, Game, Stroke
from minigolf_env.apps.play.guides import Guides
from minigolf_env.apps.play.hud import Hud
from minigolf_env.apps.play.record import FPS, Recorder, save_picture
from minigolf_env.apps.play.showing import SLOW, Showing
from minigolf_env.apps.play.throwing import Throwing
from minigolf_env.apps.play.view import View
from minigolf_env.apps.play.words import NEWS, facts, report
from minigolf_env.rendering import Camera, Frame, Line
from minigolf_env.rendering.camera import follow_view
from minigolf_env.rendering.replay import Replay, flag_foot
from minigolf_env.rendering.window import Window

TICK = 1.0 / 60.0
"""Pictures are at least this far apart, s."""

Log = Callable[..., None]


class App:
    """One window on one round of golf, or on a room to throw in.

    Args:
        window: the window, not yet visible.
        play: the round.
        log: called with an event's name and its facts.
    """

    def __init__(self, window: Window, play: Game | Throwing, log: Log) -> None:
        self.window, self.play, self.log = window, play, log
        self.golf = play if isinstance(play, Game) else None
        """The round, if there is one."""
        self.view = View()
        self.aim: Aim | None = None
        self.message = "Drag back anywhere and release" if self.golf else "Drag back and release to throw"
        self.card_shown, self.path_shown = False, True
        self.elevation = play.elevation
        self.recorder = Recorder()
        self.last: Stroke | None = None
        self._hud = Hud(window.window)
        self._pool = ThreadPoolExecutor(1)
        self._thought: tuple[Future[Any], Callable[[Any], None]] | None = None
        self._showing: Showing | None = None
        self._ghost: tuple[Line, ...] = ()
        self._turn = np.eye(3)
        self._changed, self._ticking, self._ticked = True, False, 0.0
        self._wants_picture = False
        window.overlay = self._write

    def run(self) -> None:
        """Play until the window is closed."""
        self.play.foresee(towards(self._wanted(), elevation=self.elevation))  # Compiles what is not yet.
        self.window.window.set_visible(True)
        self.wake()
        try:
            pyglet.app.run(None)
        finally:
            self.log("closed")
            self._pool.shutdown(cancel_futures=True)
            self.recorder.close()
            self.window.close()

    @property
    def is_ready(self) -> bool:
        """Whether the player may strike."""
        return self._showing is None and not (self.golf and self.golf.is_over)

    @property
    def is_busy(self) -> bool:
        """Whether a stroke is on its way, or the opponent's turn."""
        return self._showing is not None or bool(self.golf and self.golf.awaits_rival)

    @property
    def _guides(self) -> Guides:
        return Guides(self.play.course.ball_radius, flying=self.golf is None)

    def wake(self) -> None:
        """Have the window drawn again soon, and go on as long as something moves."""
        self._changed = True
        if not self._ticking:
            self._ticking, self._ticked = True, time.perf_counter() - TICK
            pyglet.clock.schedule_interval(self._tick, TICK)

    def pull(self, drag: tuple[float, float]) -> None:
        """Aim by a drag, pixels of the window."""
        if self.is_ready:
            size = self.window.window.get_size()
            self.aim = from_drag(self.view.camera, self.play.ball, drag, size, self.elevation)
            self.wake()

    def nudge(self, degrees: float = 0.0, power: float = 0.0, elevation: float = 0.0) -> None:
        """Aim by keys."""
        if not self.is_ready:
            return
        self.elevation = min(85.0, max(0.0, self.elevation + elevation))
        aim = self.aim or towards(self.view.camera, elevation=self.elevation)
        aim = aim.turned(degrees).stronger(power) if degrees or power else aim
        self.take(Aim(aim.x, aim.y, self.elevation))

    def take(self, aim: Aim | None) -> None:
        """Aim so, or not at all."""
        self.aim = aim
        if aim is not None:
            self.log("aim", x=aim.x, y=aim.y, power=aim.power, elevation=aim.elevation)
        self.wake()

    def strike(self) -> None:
        """Strike the ball as it is aimed at."""
        if self.aim is None or not self.is_ready:
            return
        aim, self._thought = self.aim, None
        stroke = self.play.strike(aim)
        self.log("putt", who=stroke.who, x=aim.x, y=aim.y, power=aim.power)
        self.message = ""
        self._show(stroke, 1.0, lambda: self._rested(stroke))

    def replay(self) -> None:
        """Show the last stroke again, slowly."""
        if self.last is not None and not self.is_busy:
            before = self.message, self.card_shown
            self.message, self.view.base = "Replay", None
            self._show(self.last, SLOW, lambda: self._replayed(*before))

    def skip(self) -> None:
        """Go to the end of what is shown."""
        if self._showing is not None:
            self._showing.skip()

    def undo(self) -> None:
        """Take the last stroke back."""
        if self.golf and not self.is_busy and self.golf.undo():
            self._forget()
            self.say("Practice: this score will not be kept as your best")
            self.log("undo", strokes=self.golf.strokes)

    def next_hole(self) -> None:
        """Go to the next hole."""
        if self.golf and not self.is_busy:
            self.golf.next_hole()
            self.window.course = self.golf.course
            self.view.base = None
            self._forget()
            self.say("")
            self.log("hole", name=self.golf.hole)

    def hint(self) -> None:
        """Ask search for a putt."""
        if self.golf and self.is_ready and self._thought is None:
            self.say("Thinking ...")
            golf = self.golf
            self._think(golf.hint, lambda aim: self._hinted(aim, self._guides.ghost(golf.way(aim))))

    def record(self) -> None:
        """Begin a film, or end it."""
        self.say(self.recorder.switch(self.play.course.name, self.window.window.get_framebuffer_size()))
        self.log("film", on=self.recorder.is_on)

    def picture(self) -> None:
        """Save what the window shows."""
        self._wants_picture = True
        self.wake()

    def say(self, message: str) -> None:
        """Write a message over the picture."""
        self.message = message
        self.wake()

    def _replayed(self, message: str, card_shown: bool) -> None:
        self.card_shown = card_shown
        self.say(message)
        self.log("replayed")

    def _forget(self) -> None:
        """Forget what belongs to a ball that is no more where it was."""
        self.aim, self._ghost, self.last, self._thought, self.card_shown = None, (), None, None, False
        self._turn = np.eye(3)

    def _think(self, work: Callable[[], Any], then: Callable[[Any], None]) -> None:
        self._thought = self._pool.submit(work), then
        self.wake()

    def _hinted(self, aim: Aim, ghost: tuple[Line, ...]) -> None:
        self._ghost = ghost
        self.say("Hint: Enter plays it")
        self.log("hint", x=aim.x, y=aim.y)
        self.take(aim)

    def _show(self, stroke: Stroke, pace: float, then: Callable[[], None]) -> None:
        replay = Replay(
            self.play.course,
            stroke.path,
            stroke.times,
            "follow",
            self._aspect,
            turn=self._turn,
            lies=stroke.lies,
            before=self.view.base,
        )
        self.aim, self._ghost, self.last, self.card_shown = None, (), stroke, False
        self._showing = Showing(replay, pace, then)
        self.wake()

    def _rested(self, stroke: Stroke) -> None:
        """Go on after a stroke."""
        self.log("rest", who=stroke.who, status=stroke.status, lies=stroke.lies.tolist(), strokes=self.play.strokes)
        self.message = NEWS.get(stroke.status, self.message)
        golf = self.golf
        if golf is None:
            return
        verdict = golf.verdict(stroke.who)
        if verdict:
            self.message = verdict if stroke.who == YOU else f"{stroke.who}: {verdict}"
        if golf.awaits_rival:
            self._think(golf.rival_choice, lambda putt: self._rival_chose(golf.rival_strike(putt)))
        elif golf.is_over:
            self.card_shown = True
            self.log("over", rows=golf.card.rows(golf.best.best))

    def _rival_chose(self, stroke: Stroke) -> None:
        self.message = f"{stroke.who} plays"
        self._show(stroke, 1.0, lambda: self._rested(stroke))

    def _tick(self, _: float) -> None:
        """Go on by one picture, if there is something new to see."""
        now = time.perf_counter()
        elapsed, self._ticked = min(now - self._ticked, 0.1), now
        moves = self._advance(elapsed)
        if moves or self._changed:
            self._draw()
        if not moves and not self._changed and self._thought is None and self._showing is None:
            pyglet.clock.unschedule(self._tick)
            self._ticking = False
            self.log("idle", **report(self))

    def _advance(self, elapsed: float) -> bool:
        """Let time pass, s; return whether what is seen moves."""
        if self._showing is not None:
            return self._advance_stroke(self._showing)
        if self._thought is not None and self._thought[0].done():
            (future, then), self._thought = self._thought, None
            then(future.result())
        return self.view.chase(self._wanted(), elapsed)

    def _advance_stroke(self, showing: Showing) -> bool:
        if not showing.advance(FPS if self.recorder.is_on else None):
            return False
        self.view.base = showing.replay.camera(showing.time)
        if showing.is_over:
            self.log("shown", pictures=showing.pictures, seconds=time.perf_counter() - showing.start)
            self._turn, self._showing = showing.replay.last_turn, None
            showing.then()
        return True

    @property
    def _aspect(self) -> float:
        width, height = self.window.window.get_size()
        return float(max(width, 1) / max(height, 1))  # A window put away has no size.

    def _wanted(self) -> Camera:
        return follow_view(self.play.course, self.play.shown, self._aspect)

    def _draw(self) -> None:
        self._changed = False
        showing = self._showing
        frame = self._still() if showing is None else showing.replay.frame(showing.time)
        self.window.draw(self.view.camera, frame)
        if showing is not None and self.recorder.is_on:
            self.message = self.recorder.add(self.window) or self.message

    def _write(self) -> None:
        """Write over a picture that is not yet seen."""
        self._hud.draw(facts(self))
        if self._wants_picture:
            self._wants_picture = False
            self.say(save_picture())
            self.log("picture", said=self.message)

    def _still(self) -> Frame:
        """Return the ball where it lies, with what helps to aim."""
        course, ball = self.play.course, self.play.shown
        lines, guides = self._ghost, self._guides
        if self.aim is not None:
            if self.path_shown:
                lines += guides.dashes(self.play.foresee(self.aim), self.aim)
            lines += guides.arrow(ball, self.aim)
        return Frame(ball, self._turn, flag_foot(course, ball), lines)
