"""A value model of putts: an action-value function (Q-function) of putt features."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.players.mlp import MLP, Array, Layer


@dataclass(frozen=True)
class PuttValueModel:
    """A network that predicts from the features of a putt the expected number of strokes that remain after it.

    It is an action-value function (Q-function) in strokes; the putt itself does not count, as it costs one stroke
    wherever it goes. The best putt is the one with the least value. The features are those of
    ``putt_features.putt_features``.

    Args:
        mlp: the network. Its first output is the logit of the probability that the putt holes out. The softplus of its
            second output is the number of strokes that remain if the putt misses.
    """

    mlp: MLP

    def expected_strokes(self, features: NDArray[Any]) -> Array:
        """Return the expected number of strokes (N, ...) that remain after putts with features (N, ..., num_inputs).

        Each of the N is a matrix product of its own, so that a value has the same bits for every N.
        """
        x = np.asarray(features, dtype=np.float32)
        outputs = self.mlp.forward(x.reshape(len(x), -1, self.mlp.num_inputs), _apply_matmul)
        miss_probability = np.exp(-np.logaddexp(0.0, outputs[..., 0]))
        strokes_after_miss = np.logaddexp(0.0, outputs[..., 1])
        return np.asarray(miss_probability * strokes_after_miss, dtype=np.float32).reshape(x.shape[:-1])


def _apply_matmul(x: Array, layer: Layer) -> Array:
    return x @ layer.weights + layer.bias
