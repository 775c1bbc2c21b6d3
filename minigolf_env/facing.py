"""The observation "rays" as it is seen looking at the cup: a hole that is moved or turned looks the same.

Only numbers stay that mean the same on every hole: no place in its bounds, no share of its size. A policy that learns
from this view plays putts in the same frame; ``turn`` brings them back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs.rays import GROUND, RAYS
from minigolf_env.envs.task import OBSERVATION

Array = NDArray[np.float32]

VIEW = 7 + RAYS
"""Numbers of the view."""

STROKES = OBSERVATION.index("strokes left")
FIRST_RAY = len(OBSERVATION)
DEPTH = FIRST_RAY + RAYS
SLOPE = DEPTH + 1
STRAIGHT = DEPTH + GROUND
HEIGHT = STRAIGHT + 2


def face_cup(observations: NDArray[Any]) -> tuple[Array, Array]:
    """Return the views (N, VIEW) of "rays" observations (N, 48), and the unit vectors (N, 2) towards the cup.

    A view has the root of the distance to the cup (1 is 8 m), the distance, the height to the cup, the strokes left,
    the ground's depth, its slope ahead and to the left, and the rays, the first ahead, counter-clockwise; a ray between
    two is taken as between theirs.
    """
    seen = np.asarray(observations, dtype=np.float32)
    straight = seen[:, STRAIGHT : STRAIGHT + 2]
    root = np.hypot(straight[:, 0], straight[:, 1])
    ahead = np.where(root[:, None] > 0.0, straight / np.maximum(root, 1e-9)[:, None], np.array([1.0, 0.0]))
    x, y = ahead[:, 0], ahead[:, 1]
    turned = np.arctan2(y, x) * (RAYS / (2.0 * np.pi))
    whole = np.floor(turned).astype(np.int64)
    part = (turned - whole)[:, None]
    first = (whole[:, None] + np.arange(RAYS)) % RAYS
    rays = seen[:, FIRST_RAY:DEPTH]
    between = (1.0 - part) * np.take_along_axis(rays, first, 1) + part * np.take_along_axis(rays, (first + 1) % RAYS, 1)
    along, across = seen[:, SLOPE], seen[:, SLOPE + 1]
    slope = (x * along + y * across, x * across - y * along)
    numbers = (root, root * root, seen[:, HEIGHT], seen[:, STROKES], seen[:, DEPTH], *slope)
    return np.column_stack([*numbers, between]).astype(np.float32), ahead.astype(np.float32)


def turn(putts: NDArray[Any], ahead: Array) -> Array:
    """Return putts (N, 2) that are relative to unit vectors (N, 2) in the hole's frame."""
    x, y = putts[:, 0], putts[:, 1]
    turned = np.column_stack([x * ahead[:, 0] - y * ahead[:, 1], x * ahead[:, 1] + y * ahead[:, 0]])
    return np.asarray(turned, dtype=np.float32)
