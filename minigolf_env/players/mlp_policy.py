"""A policy network: it maps an observation to a putt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.players.mlp import MLP, Array, Layer


@dataclass(frozen=True)
class MLPPolicy:
    """A multilayer perceptron that maps observations to actions, without exploration noise.

    Args:
        mlp: the network; its outputs are the mean of the policy's distribution.
        squash: bring the outputs to [-1, 1] by tanh, as SAC learns it, instead of clipping them, as PPO does.
    """

    mlp: MLP
    squash: bool = False

    def act_batch(self, observations: NDArray[Any]) -> Array:
        """Return the actions (N, 2), float32 in [-1, 1], for observations (N, num_inputs).

        An action has the same bits for every N.

        Raises:
            ValueError: the observations have another shape.
        """
        x = np.asarray(observations, dtype=np.float32)
        if x.ndim != 2 or x.shape[1] != self.mlp.num_inputs:
            raise ValueError(f"observations: expected shape (N, {self.mlp.num_inputs}), received {x.shape}.")
        outputs = self.mlp.forward(x, _apply_input_by_input)
        return np.tanh(outputs) if self.squash else np.clip(outputs, np.float32(-1.0), np.float32(1.0))


def _apply_input_by_input(x: Array, layer: Layer) -> Array:
    """Return x @ weights + bias, (N, outputs), summed input by input: each row has the same bits for every N."""
    total = np.tile(layer.bias, (len(x), 1))
    for k, row in enumerate(layer.weights):
        total += x[:, k, None] * row
    return total
