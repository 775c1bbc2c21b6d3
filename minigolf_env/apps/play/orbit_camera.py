"""The player's camera: it follows the play, and the player turns it and zooms. Numpy only."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from minigolf_env.rendering import Camera
from minigolf_env.rendering.camera import interpolate_cameras

TURN_TIME_CONSTANT = 0.18
"""Time constant with which the camera turns to another position of the ball, s."""

ARRIVAL_TOLERANCE = 1e-3
"""Distance below which the camera has arrived, m."""

DEGREES_PER_PIXEL = 0.3
"""Turn for a pixel of a drag, in a window REFERENCE_HEIGHT pixels high, degrees."""

REFERENCE_HEIGHT = 600.0
"""Height of the window for which DEGREES_PER_PIXEL is given, pixels."""

ZOOM_PER_CLICK = 0.88
"""Factor of the distance for a click of the mouse wheel."""

MIN_ZOOM = 0.3
"""Smallest distance, as a share of the following camera's."""

MAX_ZOOM = 4.0
"""Largest distance, as a share of the following camera's."""

MIN_PITCH = 6.0
"""Smallest angle at which the player looks down, degrees."""

MAX_PITCH = 86.0
"""Largest angle at which the player looks down, degrees."""


class OrbitCamera:
    """A following camera with the player's yaw, pitch and zoom on top."""

    def __init__(self) -> None:
        self.base: Camera | None = None
        """The following camera, without yaw, pitch and zoom."""
        self._yaw = 0.0
        self._pitch = 0.0
        self._zoom = 1.0

    def chase(self, target: Camera, elapsed: float) -> bool:
        """Move the base smoothly towards a camera; return True until it arrives.

        Args:
            target: the camera to move to.
            elapsed: time since the last call, s.
        """
        if self.base is None or _distance(self.base, target) < ARRIVAL_TOLERANCE:
            self.base = target
            return False
        self.base = interpolate_cameras(self.base, target, 1.0 - math.exp(-elapsed / TURN_TIME_CONSTANT))
        return True

    def orbit(self, right: float, up: float, height: int) -> None:
        """Turn around the camera's target by a mouse drag.

        Args:
            right: the drag to the right, pixels.
            up: the drag upwards, pixels.
            height: height of the window, pixels.
        """
        self._yaw -= DEGREES_PER_PIXEL * right * REFERENCE_HEIGHT / height
        self._pitch -= DEGREES_PER_PIXEL * up * REFERENCE_HEIGHT / height

    def zoom_in(self, clicks: float) -> None:
        """Zoom in by clicks of the mouse wheel; out by negative ones."""
        self._zoom = min(MAX_ZOOM, max(MIN_ZOOM, self._zoom * ZOOM_PER_CLICK**clicks))

    def reset(self) -> None:
        """Reset yaw, pitch and zoom."""
        self._yaw = 0.0
        self._pitch = 0.0
        self._zoom = 1.0

    @property
    def camera(self) -> Camera:
        """The camera to draw with.

        Raises:
            ValueError: ``chase`` has not been called yet.
        """
        if self.base is None:
            raise ValueError("OrbitCamera: expected a base camera first; call chase().")
        base = self.base
        offset = np.subtract(base.eye, base.target)
        base_pitch = math.degrees(math.atan2(offset[2], math.hypot(offset[0], offset[1])))
        pitch_degrees = min(MAX_PITCH, max(MIN_PITCH, base_pitch + self._pitch))
        self._pitch = pitch_degrees - base_pitch  # A drag beyond the limits must not be undone first.
        distance = float(np.linalg.norm(offset)) * self._zoom
        yaw = math.atan2(offset[1], offset[0]) + math.radians(self._yaw)
        pitch = math.radians(pitch_degrees)
        horizontal = distance * math.cos(pitch)
        x, y, z = base.target
        eye = (x + horizontal * math.cos(yaw), y + horizontal * math.sin(yaw), z + distance * math.sin(pitch))
        return replace(base, eye=eye)


def _distance(a: Camera, b: Camera) -> float:
    return max(math.dist(a.eye, b.eye), math.dist(a.target, b.target))
