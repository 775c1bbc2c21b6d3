"""The texts of the head-up display."""

from __future__ import annotations

from minigolf_env.apps.play.aim import Aim
from minigolf_env.apps.play.golf_round import GolfRound
from minigolf_env.apps.play.hud import HudState
from minigolf_env.apps.play.scores import hole_title
from minigolf_env.apps.play.throw_mode import ThrowMode

FAILED_STROKE_MESSAGES = {
    "out_of_bounds": "Out of bounds: play again from the same place",
    "time_limit": "The ball did not come to rest: play again from the same place",
}
"""Message by the status of a stroke that counts, but after which the ball is back at its former place."""

GOLF_HELP_LINES = (
    "Drag back and release: putt  ·  Arrows (Shift: fine), Enter: without a mouse  ·  Right-drag, wheel or A, D: look",
    "H hint  ·  P path  ·  R replay  ·  Z undo  ·  N next hole  ·  Tab card  ·  V video  ·  C camera  ·  F full screen"
    "  ·  Esc quit",
)
"""Lines of help in a round."""

THROW_HELP_LINES = (
    "Drag back and release: throw  ·  W and S, or Shift and wheel: elevation  ·  Arrows (Shift: fine) and Enter:"
    " without a mouse",
    "Right-drag, wheel or A, D: look  ·  P path  ·  R replay  ·  V video  ·  C camera  ·  F full screen  ·  Esc quit",
)
"""Lines of help in a room."""


def hud_state(
    mode: GolfRound | ThrowMode, aim: Aim | None, message: str, *, card_shown: bool, is_recording: bool
) -> HudState:
    """Return the content of the head-up display.

    Args:
        mode: the round, or the room to throw in.
        aim: the present aim; None hides the power meter.
        message: the message at the top.
        card_shown: True to show the score card, in a round.
        is_recording: True to show the recording light.
    """
    if isinstance(mode, GolfRound):
        state = _golf_state(mode, card_shown)
    else:
        state = HudState("Room", (f"Throws {mode.strokes}",), help=THROW_HELP_LINES)
    if aim is not None:
        meter = f"{100.0 * aim.power:.0f} %   {mode.top_speed * aim.power:.2f} m/s"
        if isinstance(mode, ThrowMode):
            meter += f"   {aim.elevation:.0f}°"
        state = state._replace(power=aim.power, meter=meter)
    return state._replace(message=message, recording=is_recording)


def _golf_state(golf: GolfRound, card_shown: bool) -> HudState:
    """Return the title, lines, help and score card of a round."""
    best_strokes = golf.best_scores.strokes_by_hole
    hole = f"Hole {golf.holes.index(golf.hole) + 1} of {len(golf.holes)}  ·  Par {golf.card.pars[golf.hole]}"
    strokes = f"Strokes {golf.strokes}" if golf.is_over else f"Stroke {golf.strokes + 1}"
    if golf.hole in best_strokes:
        strokes += f"  ·  Best {best_strokes[golf.hole]}"
    lines = (hole, strokes, "Practice") if golf.is_practice else (hole, strokes)
    state = HudState(hole_title(golf.hole), lines, help=GOLF_HELP_LINES)
    if not card_shown:
        return state
    rows = tuple(tuple(row) for row in golf.card.rows(best_strokes))
    footer = "N or Enter: next hole  ·  R: replay  ·  Z: undo" if golf.is_over else "Tab: back to the game"
    return state._replace(card=rows, footer=footer)
