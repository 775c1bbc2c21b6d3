"""Starts the game: checks what was asked for, opens the window, and plays."""

from __future__ import annotations

import json
import sys
from pathlib import PurePath
from typing import Any

from platformdirs import user_data_path

from minigolf_env._validation import one_of
from minigolf_env.apps.play.game import Game
from minigolf_env.apps.play.scores import BestScores
from minigolf_env.apps.play.throwing import Throwing
from minigolf_env.courses import NINE, ROUND, load_course
from minigolf_env.players.policies import load_policy
from minigolf_env.rendering import PROFILES, Settings

SMALLEST = 320, 200
"""Least size of the window, pixels: what is written in it would not fit into a smaller one."""


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
        course: a hole, "round" for the nine of a round, or "room" to throw a ball in three dimensions.
        opponent: plays each hole after you: "search", "random", "ppo", "generalist" or a model's file.
        size: of the window, pixels.
        profile: "high", "fast" or "auto".
        log: whether to print each event as a line of JSON.

    Raises:
        ValueError: an argument is not what it should be.
        FileNotFoundError, ImportError: as for ``policies.load_policy``.
        RenderingError: there is no display, or no OpenGL on it.
    """
    if size[0] < SMALLEST[0] or size[1] < SMALLEST[1]:
        least = "{} {}".format(*SMALLEST)
        raise ValueError(f"size: expected width and height of at least {least}, received {size}; give more pixels.")
    settings = Settings("human", size, profile=one_of(profile, PROFILES, "profile"))
    golf = load_course(NINE[0] if course == ROUND else course)
    if opponent is not None and golf.cup is None:
        raise ValueError(f"opponent: expected none on {golf.name!r}, which has no hole to play, received {opponent!r}.")
    policy = None if opponent is None else load_policy(opponent)
    from minigolf_env.rendering.window import Window

    # Without a display this fails at once, before the physics is compiled.
    window = Window(golf, settings, visible=False)
    window.window.set_minimum_size(*SMALLEST)
    play: Game | Throwing
    if golf.cup is None:
        play = Throwing(golf)
    else:
        best = BestScores(user_data_path("minigolf_env") / "scores.json")
        play = Game(course, best, policy, "" if opponent is None else PurePath(opponent).name)
    from minigolf_env.apps.play.app import App
    from minigolf_env.apps.play.controls import Controls

    app = App(window, play, _print if log else _ignore)
    _controls = Controls(app)  # Kept here, because pyglet holds what listens weakly.
    app.run()


def _print(event: str, **about: Any) -> None:
    print(json.dumps({"event": event, **about}), flush=True, file=sys.stdout)


def _ignore(event: str, **about: Any) -> None:
    pass
