"""Wrappers of the environment."""

from minigolf_env.wrappers.record_video import RecordVideo

__all__ = ["RecordVideo"]
