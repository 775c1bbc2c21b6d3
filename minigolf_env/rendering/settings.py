"""Render settings of an environment: mode, image size, camera and quality profile."""

from __future__ import annotations

from dataclasses import dataclass

RENDER_MODES = ("rgb_array", "rgb_array_list", "human")
"""Render modes of a single environment; a batch has the first two."""

RENDER_PROFILES = ("auto", "high", "fast")
"""Quality profiles; "auto" is "high", and "fast" in a window that is drawn without a GPU."""

RENDER_FPS = 30
"""Frames per second in lists and videos; a putt of 5 s takes 138 MB at 640 x 480."""


@dataclass(frozen=True)
class RenderSettings:
    """Render settings of an environment, validated by envs/config.py."""

    mode: str | None = None
    """One of RENDER_MODES, or None: nothing is rendered."""
    size: tuple[int, int] = (640, 480)
    """Width and height in pixels."""
    camera: str = "follow"
    """One of camera.CAMERA_NAMES."""
    profile: str = "auto"
    """One of RENDER_PROFILES."""
    speed: float = 1.0
    """Playback speed of a window, as a multiple of real time."""

    @property
    def aspect(self) -> float:
        """Return width / height."""
        return self.size[0] / self.size[1]
