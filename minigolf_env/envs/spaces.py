"""Spaces of a batch of environments."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box, Space
from gymnasium.vector.utils import batch_space

BOX_ARRAYS = ("low", "high", "bounded_below", "bounded_above")
"""Arrays of a Box that have its shape."""


def batch_box(space: Space[Any], n: int) -> Space[Any]:
    """Return the space of N elements of a space, as Gymnasium's ``batch_space``.

    The bounds of a Box are not repeated in memory: those of 8,192 images would take 0.7 GB.
    """
    if type(space) is not Box:
        return batch_space(space, n)
    batched = batch_space(space, 1)
    batched._shape = (n, *space.shape)
    for name in BOX_ARRAYS:
        setattr(batched, name, np.broadcast_to(getattr(space, name), batched._shape))
    return batched
