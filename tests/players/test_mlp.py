"""Networks: the policy network, the value model of putts, and the checks of their layers."""

from __future__ import annotations

import numpy as np
import pytest

from minigolf_env.players.mlp import MLP, Layer
from minigolf_env.players.mlp_policy import MLPPolicy
from minigolf_env.players.putt_value_model import PuttValueModel
from tests.players.samples import RANDOM_OBSERVATIONS, random_mlp


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("squash", [False, True])
def test_policy_matches_float64_forward_pass(activation: str, squash: bool) -> None:
    """Actions match a float64 computation to rounding, are in [-1, 1], and have the same bits in any batch."""
    policy = MLPPolicy(random_mlp(10, 16, 8, 2, activation=activation), squash)
    x = RANDOM_OBSERVATIONS.astype(np.float64)
    for i, (weights, bias) in enumerate(policy.mlp.layers):
        x = {"tanh": np.tanh, "relu": lambda z: np.maximum(z, 0.0)}[activation](x) if i else x
        x = x @ weights.astype(np.float64) + bias
    actions = policy.act_batch(RANDOM_OBSERVATIONS)
    assert actions.dtype == np.float32 and actions.shape == (100, 2) and np.abs(actions).max() <= 1.0
    assert np.abs(actions - (np.tanh(x) if squash else np.clip(x, -1.0, 1.0))).max() < 1e-5
    for rows in (slice(0, 1), slice(3, 4), slice(0, 37)):
        assert policy.act_batch(RANDOM_OBSERVATIONS[rows]).tobytes() == actions[rows].tobytes()


@pytest.mark.parametrize("shape", [(10,), (3, 9), (3, 11), (2, 3, 10), ()])
def test_policy_rejects_observations_of_wrong_shape(shape: tuple[int, ...]) -> None:
    """An observation of another size is refused, although one with too many numbers could be computed with."""
    with pytest.raises(ValueError, match=r"observations: expected shape \(N, 10\), received"):
        MLPPolicy(random_mlp(10, 4, 2)).act_batch(np.zeros(shape))


def test_expected_strokes_are_miss_probability_times_strokes_after_miss() -> None:
    """The formula holds for outputs of any size, and a value has the same bits in any batch."""
    model = PuttValueModel(random_mlp(10, 16, 2, activation="relu"))
    features = 30.0 * RANDOM_OBSERVATIONS.reshape(5, 4, 5, 10)
    strokes = model.expected_strokes(features)
    assert strokes.dtype == np.float32 and strokes.shape == (5, 4, 5)
    first, last = model.mlp.layers
    hidden = np.maximum(features.astype(np.float64) @ first.weights + first.bias, 0.0)
    logit, after = np.moveaxis(hidden @ last.weights + last.bias, -1, 0)
    expected = np.exp(-np.logaddexp(0.0, logit)) * np.logaddexp(0.0, after)
    assert np.abs(logit).max() > 100.0, "exp would overflow"
    np.testing.assert_allclose(strokes, expected, rtol=1e-3, atol=1e-5)
    assert all(model.expected_strokes(features[i : i + 1]).tobytes() == strokes[i : i + 1].tobytes() for i in range(5))


def test_rejects_invalid_layers() -> None:
    """Refused are sizes that do not fit, a wrong number of outputs, weights that are not finite, other activations."""
    first, second = random_mlp(10, 4, 2), random_mlp(10, 5, 2)
    with pytest.raises(ValueError, match="fit together"):
        MLP((first.layers[0], second.layers[1]))
    with pytest.raises(ValueError, match="2 outputs"):
        random_mlp(10, 3)
    with pytest.raises(ValueError, match="finite"):
        MLP((Layer(np.full((10, 2), np.nan, np.float32), np.zeros(2, np.float32)),))
    with pytest.raises(ValueError, match="did you mean 'tanh'"):
        random_mlp(10, 2, activation="tan")
