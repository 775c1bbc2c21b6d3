"""The game: minigolf in a window, played with mouse and keyboard."""

from minigolf_env.apps.play.launcher import run

__all__ = ["run"]
