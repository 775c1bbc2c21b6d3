"""Random networks and observations, for tests."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs.observations.bounce_rays import FEATURES_PER_SEGMENT, NUM_BOUNCE_RAYS, NUM_SEGMENTS
from minigolf_env.players.mlp import MLP, Layer
from minigolf_env.players.putt_features import FIRST_RAY_INDEX

RANDOM_OBSERVATIONS = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 10)).astype(np.float32)
"""Random observations of 10 numbers."""


def random_mlp(*sizes: int, activation: str = "tanh", seed: int = 0) -> MLP:
    """Return a network with random weights and layers of given sizes."""
    rng = np.random.default_rng(seed)
    layers = (
        Layer(rng.normal(size=(m, n)).astype(np.float32), rng.normal(size=n).astype(np.float32))
        for m, n in itertools.pairwise(sizes)
    )
    return MLP(tuple(layers), activation)


def random_observations(n: int) -> NDArray[np.float32]:
    """Return n random observations of bounce rays."""
    rng = np.random.default_rng(0)
    rays = rng.uniform(-0.2, 0.2, (n, NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT))
    normal_angle = rng.uniform(0.0, 2.0 * np.pi, (n, NUM_BOUNCE_RAYS, NUM_SEGMENTS))
    rays[..., 2] = np.cos(normal_angle)
    rays[..., 3] = np.sin(normal_angle)
    other = rng.uniform(-0.5, 0.5, (n, FIRST_RAY_INDEX))
    return np.concatenate([other, rays.reshape(n, -1)], axis=1).astype(np.float32)
