"""What the display, and the log, say at a moment of the game."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from minigolf_env.apps.play.game import Game
from minigolf_env.apps.play.hud import Facts
from minigolf_env.apps.play.scores import title

if TYPE_CHECKING:
    from minigolf_env.apps.play.app import App

NEWS = {
    "out_of_bounds": "Out of bounds: again from the same place",
    "time_limit": "It would not come to rest: again from the same place",
}
"""What is said of strokes that went wrong."""

GOLF_HELP = (
    "Drag back and release: putt  ·  Arrows (Shift: fine), Enter: without a mouse  ·  Right-drag, wheel or A, D: look",
    "H hint  ·  P path  ·  R replay  ·  Z undo  ·  N next hole  ·  Tab card  ·  V film  ·  C camera  ·  F full screen"
    "  ·  Esc quit",
)
THROW_HELP = (
    "Drag back and release: throw  ·  W and S, or Shift and wheel: elevation  ·  Arrows (Shift: fine) and Enter:"
    " without a mouse",
    "Right-drag, wheel or A, D: look  ·  P path  ·  R replay  ·  V film  ·  C camera  ·  F full screen  ·  Esc quit",
)


def facts(app: App) -> Facts:
    """Return what to write over the picture."""
    play, aim = app.play, app.aim
    meter = ""
    if aim is not None:
        meter = f"{100.0 * aim.power:.0f} %   {play.top_speed * aim.power:.2f} m/s"
        meter += "" if app.golf else f"   {aim.elevation:.0f}°"
    shown = _golf(app, app.golf) if app.golf else Facts("Room", (f"Throws {play.strokes}",), help=THROW_HELP)
    return shown._replace(
        power=None if aim is None else aim.power,
        meter=meter,
        message=app.message,
        recording=app.recorder.is_on,
    )


def report(app: App) -> dict[str, Any]:
    """Return what the log says of a window in which nothing moves: "ball" is where the mouse finds it, pixels."""
    width, height = app.window.window.get_size()
    x, y, _, w = app.view.camera.clip_from_world(width / height) @ np.append(app.play.shown, 1.0)
    at = [round((x / w + 1.0) * width / 2.0), round((1.0 - y / w) * height / 2.0)]
    return {"size": [width, height], "ball": at, "ready": app.is_ready, "strokes": app.play.strokes}


def _golf(app: App, game: Game) -> Facts:
    number = f"Hole {game.holes.index(game.hole) + 1} of {len(game.holes)}  ·  Par {game.card.pars[game.hole]}"
    strokes = f"Strokes {game.strokes}" if game.is_over else f"Stroke {game.strokes + 1}"
    if game.hole in game.best.best:
        strokes += f"  ·  Best {game.best.best[game.hole]}"
    lines = [number, strokes, *(["Practice"] if game.practice else [])]
    if not app.card_shown:
        return Facts(title(game.hole), tuple(lines), help=GOLF_HELP)
    rows = tuple(tuple(row) for row in game.card.rows(game.best.best))
    footer = "N or Enter: next hole  ·  R: replay  ·  Z: undo" if game.is_over else "Tab: back to the game"
    return Facts(title(game.hole), tuple(lines), help=GOLF_HELP, card=rows, footer=footer)
