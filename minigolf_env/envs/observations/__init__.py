"""Observations: the table of the registered ones.

To add an observation, write a module here with a function that makes its space and a function that observes, and add
both to ``OBSERVATIONS``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.observations.bounce_rays import bounce_ray_space, observe_bounce_rays
from minigolf_env.envs.observations.pixels import observe_pixels, pixel_space
from minigolf_env.envs.observations.rays import observe_rays, ray_space
from minigolf_env.envs.observations.state import observe_state, state_space
from minigolf_env.envs.task import TaskBatch


class ObservationType(NamedTuple):
    """One kind of observation."""

    space: Callable[[], Space[Any]]
    """Make the space of one environment's observations."""
    observe: Callable[[TaskBatch, FloatArray, NDArray[np.int64], NDArray[np.float32]], NDArray[Any]]
    """Return N observations, in a new array: ``observe(task, positions, strokes, state)``.

    The balls are at positions (N, 3), m, after a number of strokes (N,); ``state`` (N, 10) are their features "state",
    which the rules compute with each stroke."""


OBSERVATIONS = {
    "state": ObservationType(state_space, observe_state),
    "rays": ObservationType(ray_space, observe_rays),
    "bounce_rays": ObservationType(bounce_ray_space, observe_bounce_rays),
    "pixels": ObservationType(pixel_space, observe_pixels),
}
"""The registered observations by name."""
