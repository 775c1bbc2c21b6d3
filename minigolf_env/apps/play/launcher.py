"""Starts the game: checks the arguments, opens the window and runs the application."""

from __future__ import annotations

import json
import sys
from pathlib import PurePath
from typing import Any

from platformdirs import user_data_path

from minigolf_env._validation import one_of, quote
from minigolf_env.apps.play.golf_round import GolfRound
from minigolf_env.apps.play.scores import BestScores
from minigolf_env.apps.play.throw_mode import ThrowMode
from minigolf_env.courses import ROUND_COURSE, ROUND_HOLES, load_course
from minigolf_env.players.policies import load_policy
from minigolf_env.rendering import RENDER_PROFILES, RenderSettings

MIN_WINDOW_SIZE = 320, 200
"""Smallest width and height of the window, pixels; the texts do not fit into a smaller one."""


def run(
    course: str = "dogleg",
    *,
    opponent: str | None = None,
    size: tuple[int, int] = (960, 600),
    profile: str = "auto",
    log: bool = False,
) -> None:
    """Play until the window is closed.

    Args:
        course: a hole, "round" for a round of nine holes, or "room" to throw a ball in three dimensions.
        opponent: plays each hole after you: "search", "random", "ppo", "generalist" or a model's file.
        size: width and height of the window, pixels.
        profile: "high", "fast" or "auto".
        log: True prints each event as a line of JSON.

    Raises:
        ValueError: an argument is invalid.
        FileNotFoundError, ImportError: as for ``policies.load_policy``.
        RenderingError: there is no display, or no OpenGL on it.
    """
    if size[0] < MIN_WINDOW_SIZE[0] or size[1] < MIN_WINDOW_SIZE[1]:
        minimum = "{} {}".format(*MIN_WINDOW_SIZE)
        raise ValueError(f"size: expected width and height of at least {minimum}, received {size}; give more pixels.")
    settings = RenderSettings("human", size, profile=one_of(profile, RENDER_PROFILES, "profile"))
    first = load_course(ROUND_HOLES[0] if course == ROUND_COURSE else course)
    if opponent is not None and first.cup is None:
        raise ValueError(
            f"opponent: expected none on {quote(first.name)}, which has no cup, received {quote(opponent)}."
        )
    policy = None if opponent is None else load_policy(opponent)
    from minigolf_env.rendering.window import Window

    # The window is opened before the physics is compiled, so that a missing display is reported at once.
    window = Window(first, settings, visible=False)
    window.window.set_minimum_size(*MIN_WINDOW_SIZE)
    mode: GolfRound | ThrowMode
    if first.cup is None:
        mode = ThrowMode(first)
    else:
        best = BestScores(user_data_path("minigolf_env") / "scores.json")
        mode = GolfRound(course, best, policy, "" if opponent is None else PurePath(opponent).name)
    from minigolf_env.apps.play.app import App
    from minigolf_env.apps.play.controls import Controls

    app = App(window, mode, _print_event if log else _discard_event)
    _controls = Controls(app)  # Keep a reference: pyglet holds event handlers weakly.
    app.run()


def _print_event(event: str, **fields: Any) -> None:
    print(json.dumps({"event": event, **fields}), flush=True, file=sys.stdout)


def _discard_event(event: str, **fields: Any) -> None:
    pass
