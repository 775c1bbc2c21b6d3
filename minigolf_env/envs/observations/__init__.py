"""What an agent sees, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from minigolf_env.envs.observations.bounce_rays import echo_space, observe_echoes
from minigolf_env.envs.observations.pixels import observe_pixels, pixel_space
from minigolf_env.envs.observations.rays import observe_rays, ray_space
from minigolf_env.envs.task import FloatArray, Game, observation_space


class Observer(NamedTuple):
    """One kind of observation."""

    space: Callable[[], Space[Any]]
    """Makes the space of one environment's observations."""
    observe: Callable[[Game, FloatArray, NDArray[np.int64]], NDArray[Any]]
    """From balls at positions (N, 3), m, after a number of strokes (N,) to N observations, in a new array."""


OBSERVERS = {
    "state": Observer(observation_space, Game.observe),
    "rays": Observer(ray_space, observe_rays),
    "echoes": Observer(echo_space, observe_echoes),
    "pixels": Observer(pixel_space, observe_pixels),
}
