"""Minigolf to play by hand, in a window."""

from minigolf_env.apps.play.start import run

__all__ = ["run"]
