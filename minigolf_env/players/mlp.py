"""A multilayer perceptron in numpy: layers, checks and the forward pass."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import one_of, quote

Array = NDArray[np.float32]

ACTIVATION_NAMES = ("relu", "tanh")
"""Names of the activation functions of hidden layers."""


class Layer(NamedTuple):
    """A dense layer, which maps x to x @ weights + bias."""

    weights: Array
    """Weights, shape (inputs, outputs)."""
    bias: Array
    """Bias, shape (outputs,)."""


@dataclass(frozen=True)
class MLP:
    """A multilayer perceptron with two outputs.

    Args:
        layers: the layers in order; the last one has two outputs.
        activation: activation function after every layer but the last, one of ``ACTIVATION_NAMES``.

    Raises:
        ValueError: the layers do not fit together, a weight is not finite, or the activation is unknown.
    """

    layers: tuple[Layer, ...]
    activation: str = "tanh"

    def __post_init__(self) -> None:
        one_of(self.activation, ACTIVATION_NAMES, "activation")
        sizes = [(*layer.weights.shape, *layer.bias.shape) for layer in self.layers]
        is_chain = all(len(size) == 3 and size[1] == size[2] for size in sizes) and all(
            size[1] == next_size[0] for size, next_size in itertools.pairwise(sizes)
        )
        if not sizes or not is_chain or sizes[-1][1] != 2:
            raise ValueError(f"expected layers that fit together and end in 2 outputs, received sizes {quote(sizes)}.")
        if not all(np.isfinite(array).all() for layer in self.layers for array in layer):
            raise ValueError("expected finite weights, received others; the training has diverged.")

    @property
    def num_inputs(self) -> int:
        """Number of inputs."""
        return len(self.layers[0].weights)

    def forward(self, x: Array, apply_layer: Callable[[Array, Layer], Array]) -> Array:
        """Return the outputs (..., 2) for inputs (..., num_inputs).

        Args:
            x: the inputs.
            apply_layer: computes x @ weights + bias. Its order of summation decides the last bits of the result.
        """
        for i, layer in enumerate(self.layers):
            if i > 0:
                x = np.tanh(x) if self.activation == "tanh" else np.maximum(x, np.float32(0.0))
            x = apply_layer(x, layer)
        return x
