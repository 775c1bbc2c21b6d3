"""What an agent sees, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from minigolf_env.envs.observations.bounce_rays import bounce_ray_space, observe_bounce_rays
from minigolf_env.envs.observations.pixels import observe_pixels, pixel_space
from minigolf_env.envs.observations.rays import observe_rays, ray_space
from minigolf_env.envs.task import FloatArray, TaskBatch, observation_space


class ObservationType(NamedTuple):
    """One kind of observation."""

    space: Callable[[], Space[Any]]
    """Makes the space of one environment's observations."""
    observe: Callable[[TaskBatch, FloatArray, NDArray[np.int64]], NDArray[Any]]
    """From balls at positions (N, 3), m, after a number of strokes (N,) to N observations, in a new array."""


OBSERVATIONS = {
    "state": ObservationType(observation_space, TaskBatch.observe),
    "rays": ObservationType(ray_space, observe_rays),
    "bounce_rays": ObservationType(bounce_ray_space, observe_bounce_rays),
    "pixels": ObservationType(pixel_space, observe_pixels),
}
