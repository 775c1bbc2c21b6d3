"""Wrappers of the environment; those of the vector environment are in ``minigolf_env.wrappers.vector``."""

from minigolf_env.wrappers.record_video import RecordVideo

__all__ = ["RecordVideo"]
