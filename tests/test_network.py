"""A trained network and its files."""

from __future__ import annotations

import itertools
import json
import os
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minigolf_env.network import Layer, Network, read_network

OBSERVATIONS = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 10)).astype(np.float32)


def network(*sizes: int, seed: int = 0, **options: Any) -> Network:
    """Return a network with random weights."""
    rng = np.random.default_rng(seed)
    layers = (
        Layer(rng.normal(size=(m, n)).astype(np.float32), rng.normal(size=n).astype(np.float32))
        for m, n in itertools.pairwise(sizes)
    )
    return Network(tuple(layers), **options)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("squash", [False, True])
def test_a_network_is_what_it_says(activation: str, squash: bool) -> None:
    """Layers in turn, to rounding; every putt is an action, and it has the same bits alone and in any batch."""
    net = network(10, 16, 8, 2, activation=activation, squash=squash)
    x = OBSERVATIONS.astype(np.float64)
    for i, (weights, bias) in enumerate(net.layers):
        x = {"tanh": np.tanh, "relu": lambda z: np.maximum(z, 0.0)}[activation](x) if i else x
        x = x @ weights.astype(np.float64) + bias
    putts = net(OBSERVATIONS)
    assert putts.dtype == np.float32 and putts.shape == (100, 2) and np.abs(putts).max() <= 1.0
    assert np.abs(putts - (np.tanh(x) if squash else np.clip(x, -1.0, 1.0))).max() < 1e-5
    for rows in (slice(0, 1), slice(3, 4), slice(0, 37)):
        assert net(OBSERVATIONS[rows]).tobytes() == putts[rows].tobytes()


def test_a_file_gives_the_network_back(tmp_path: Path) -> None:
    """Every bit of it, and the same network makes the same file."""
    net = network(10, 16, 2, activation="relu", squash=True)
    for name in ("one.npz", "other.npz"):
        net.save(tmp_path / name)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "other.npz").read_bytes()
    again = read_network(tmp_path / "one.npz")
    assert again(OBSERVATIONS).tobytes() == net(OBSERVATIONS).tobytes()
    assert (again.activation, again.squash, again.inputs) == ("relu", True, 10)


def test_networks_that_do_not_fit_are_refused() -> None:
    """Sizes, numbers and names."""
    one, two = network(10, 4, 2), network(10, 5, 2)
    with pytest.raises(ValueError, match="fit together"):
        Network((one.layers[0], two.layers[1]))
    with pytest.raises(ValueError, match="2 outputs"):
        network(10, 3)
    with pytest.raises(ValueError, match="finite"):
        Network((Layer(np.full((10, 2), np.nan, np.float32), np.zeros(2, np.float32)),))
    with pytest.raises(ValueError, match="did you mean 'tanh'"):
        network(10, 2, activation="tan")


class Trap:
    """Whoever unpickles this makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        """Return the call that unpickling makes."""
        return os.mkdir, (str(self.path),)


def test_no_file_runs_code(tmp_path: Path) -> None:
    """A pickle in any place of a file is refused with one line, and never loaded."""
    trap = tmp_path / "sprung"
    np.savez(tmp_path / "a.npz", activation="tanh", squash=False, weights_0=np.array([Trap(trap)]), bias_0=np.zeros(2))
    (tmp_path / "b.npz").write_bytes(pickle.dumps(Trap(trap)))
    with zipfile.ZipFile(tmp_path / "c.zip", "w") as file:
        file.writestr("data", json.dumps({"policy_kwargs": {}}))
        file.writestr("policy.pth", pickle.dumps(Trap(trap), protocol=2))  # The one that torch reads.
    for name in ("a.npz", "b.npz", "c.zip"):
        with pytest.raises(ValueError, match=rf"model: .*{name}"):
            read_network(tmp_path / name)
    assert not trap.exists()


@pytest.mark.parametrize("name", ["empty.npz", "text.npz", "text.zip", "other.zip", "array.npz"])
def test_other_files_are_refused(tmp_path: Path, name: str) -> None:
    """Damaged ones, and those of something else."""
    path = tmp_path / name
    path.write_bytes(b"" if name == "empty.npz" else b"no model")
    if name == "other.zip":
        with zipfile.ZipFile(path, "w") as file:
            file.writestr("data", "{}")
    if name == "array.npz":
        with path.open("wb") as raw:
            np.save(raw, np.zeros(3))
    with pytest.raises(ValueError, match=rf"model: .*{name}"):
        read_network(path)
