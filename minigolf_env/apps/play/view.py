"""Where the player looks from: a camera that follows the play, turned and brought closer by hand. Numpy only."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from minigolf_env.rendering import Camera
from minigolf_env.rendering.camera import blend

LAG = 0.18
"""Time constant with which the camera turns to another lie, s."""

THERE = 1e-3
"""Nearer than this the camera is where it should be, m."""

TURN = 0.3
"""Degrees for a pixel of a drag, in a window 600 pixels high."""

CLOSER = 0.88
"""Distance left after a click of the wheel."""

ZOOM = 0.3, 4.0
"""Least and greatest distance, as shares of the following camera's."""

LOWEST, HIGHEST = 6.0, 86.0
"""Degrees above the horizon between which the player looks down."""


class View:
    """A camera that follows the play, and how the player has turned it and come closer."""

    def __init__(self) -> None:
        self.base: Camera | None = None
        """The following camera, before the player's wishes."""
        self._yaw = self._pitch = 0.0
        self._zoom = 1.0

    def chase(self, wanted: Camera, elapsed: float) -> bool:
        """Let the base turn smoothly to where it should be; return whether it is still on its way."""
        if self.base is None or _apart(self.base, wanted) < THERE:
            self.base = wanted
            return False
        self.base = blend(self.base, wanted, 1.0 - math.exp(-elapsed / LAG))
        return True

    def orbit(self, right: float, up: float, height: int) -> None:
        """Turn around what is looked at, by a drag in pixels of a window of a height."""
        self._yaw -= TURN * right * 600.0 / height
        self._pitch -= TURN * up * 600.0 / height

    def closer(self, clicks: float) -> None:
        """Come closer by clicks of the wheel, or go back."""
        self._zoom = min(ZOOM[1], max(ZOOM[0], self._zoom * CLOSER**clicks))

    def reset(self) -> None:
        """Forget the player's wishes."""
        self._yaw, self._pitch, self._zoom = 0.0, 0.0, 1.0

    @property
    def camera(self) -> Camera:
        """The camera to look through."""
        if self.base is None:
            raise ValueError("view: expected a base camera first; call chase().")
        base = self.base
        way = np.subtract(base.eye, base.target)
        level, far = math.hypot(way[0], way[1]), float(np.linalg.norm(way)) * self._zoom
        pitch = math.degrees(math.atan2(way[2], level))
        wanted = min(HIGHEST, max(LOWEST, pitch + self._pitch))
        self._pitch = wanted - pitch  # A drag beyond the limits is not owed back.
        turn, lift = math.atan2(way[1], way[0]) + math.radians(self._yaw), math.radians(wanted)
        flat = far * math.cos(lift)
        x, y, z = base.target
        return replace(base, eye=(x + flat * math.cos(turn), y + flat * math.sin(turn), z + far * math.sin(lift)))


def _apart(a: Camera, b: Camera) -> float:
    return max(math.dist(a.eye, b.eye), math.dist(a.target, b.target))
