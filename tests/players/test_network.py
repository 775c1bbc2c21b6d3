"""A trained network and its files."""

from __future__ import annotations

import io
import itertools
import json
import os
import pickle
import random
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minigolf_env.players.network import LARGEST, Layer, Network, read_network

torch = pytest.importorskip("torch", reason="reading and writing .zip files needs torch")

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


def test_a_judge_is_what_it_says(tmp_path: Path) -> None:
    """The chance to miss times the strokes that are left then, at any outputs; its file says that it judges."""
    net = network(10, 16, 2, activation="relu", judges=True)
    net.save(tmp_path / "judge.npz")
    again = read_network(tmp_path / "judge.npz")
    assert again.judges and not network(10, 2).judges
    sights = 30.0 * OBSERVATIONS.reshape(5, 4, 5, 10)
    costs = again.cost(sights)
    assert costs.dtype == np.float32 and costs.shape == (5, 4, 5)
    (one, two), x = net.layers, sights.astype(np.float64)
    logit, after = np.moveaxis(np.maximum(x @ one.weights + one.bias, 0.0) @ two.weights + two.bias, -1, 0)
    expected = np.exp(-np.logaddexp(0.0, logit)) * np.logaddexp(0.0, after)
    assert np.abs(logit).max() > 100.0, "exp would overflow"
    np.testing.assert_allclose(costs, expected, rtol=1e-3, atol=1e-5)
    assert all(net.cost(sights[i : i + 1]).tobytes() == costs[i : i + 1].tobytes() for i in range(5))


def test_a_rounded_file_is_half_as_large(tmp_path: Path) -> None:
    """Weights of 16 bits are read as others are, each within a two-thousandth, and play as they are read."""
    net, file = network(68, 100, 100, 2, activation="relu", judges=True), tmp_path / "half.npz"
    net.save(tmp_path / "whole.npz")
    net.save(file, np.float16)
    assert file.stat().st_size < 0.55 * (tmp_path / "whole.npz").stat().st_size
    again = read_network(file)
    for layer, other in zip(net.layers, again.layers, strict=True):
        for one, two in zip(layer, other, strict=True):
            assert two.dtype == np.float32
            np.testing.assert_allclose(one, two, rtol=2.0**-11, atol=2.0**-24)
    again.save(tmp_path / "again.npz", np.float16)
    assert (tmp_path / "again.npz").read_bytes() == file.read_bytes()


@pytest.mark.parametrize("shape", [(10,), (3, 9), (3, 11), (2, 3, 10), ()])
def test_observations_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    """Too many numbers would otherwise play all the same."""
    with pytest.raises(ValueError, match=r"observations: expected shape \(N, 10\), received"):
        network(10, 4, 2)(np.zeros(shape))


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


def write_zip(path: Path, state: dict[str, Any] | None = None, data: str | None = None, policy: bytes = b"") -> None:
    """Write a file as stable-baselines3's PPO does: weights as torch saves them, and JSON."""
    if not policy:
        buffer = io.BytesIO()
        torch.save(state, buffer)
        policy = buffer.getvalue()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("data", json.dumps({"policy_kwargs": {}}) if data is None else data)
        file.writestr("policy.pth", policy)


def ppo(hidden: int = 4, layers: int = 1, make: Callable[..., Any] = torch.ones) -> dict[str, Any]:
    """Return the weights of a network as PPO names them."""
    sizes, state = [10, *[hidden] * layers, 2], {}
    for k, (m, n) in enumerate(itertools.pairwise(sizes)):
        name = "action_net" if k == layers else f"mlp_extractor.policy_net.{2 * k}"
        state |= {f"{name}.weight": make(n, m), f"{name}.bias": make(n)}
    return state


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
    write_zip(tmp_path / "c.zip", {"action_net.weight": Trap(trap)})
    write_zip(tmp_path / "d.zip", policy=pickle.dumps(Trap(trap), protocol=2))  # Torch would read this, too.
    for name in ("a.npz", "b.npz", "c.zip", "d.zip"):
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


def repeated(*shape: int) -> torch.Tensor:
    """Return a tensor of one number in memory, shown everywhere."""
    return torch.zeros(1).expand(*shape)


def header(shape: tuple[int, ...], dtype: str = "<f4") -> bytes:
    """Return a .npy file that claims a shape, with one number."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": dtype, "fortran_order": False, "shape": shape})
    return file.getvalue() + bytes(4)


def write_npz(path: Path, **entries: bytes) -> None:
    """Write an .npz file of these bytes, other entries those of a network."""
    known = {"activation": np.array("tanh"), "squash": np.array(False), "bias_0": np.zeros(2, np.float32)}
    np.savez(path, **{name: array for name, array in known.items() if name not in entries})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file:
        for name, content in entries.items():
            file.writestr(f"{name}.npy", content)


def letters(number: int) -> bytes:
    """Return a .npy file with so many texts of one letter."""
    return header((number,), "|S1")[:-4] + bytes(number)


def understated(path: Path, name: str) -> None:
    """Let an entry of a zip file say that it unpacks to 100 bytes."""
    with zipfile.ZipFile(path) as file:
        size = file.getinfo(name).file_size.to_bytes(4, "little")
    content = path.read_bytes()
    assert content.count(size) == 2  # Where the entry begins, and in the directory.
    path.write_bytes(content.replace(size, (100).to_bytes(4, "little")))


def nested(size: int) -> bytes:
    """Return a zip file with zeros, as torch's files are zip files."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", bytes(size))
    return file.getvalue()


def allocating(bare: bool) -> bytes:
    """Return what torch takes for weights, a pickle that asks for gigabytes: in a zip file, or before an empty one."""
    content = b"\x80\x02cbuiltins\nbytearray\nJ" + struct.pack("<i", 2**31 - 1) + b"\x85R."
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("archive/version", "3\n")
        archive.writestr("archive/byteorder", "little")
        archive.writestr("archive/data.pkl", b"" if bare else content)
    return content + file.getvalue() if bare else file.getvalue()


BOMBS: dict[str, Callable[[Path], None]] = {
    "zeros.npz": lambda path: write_npz(path, weights_0=bytes(2 * LARGEST)),
    "far.npz": lambda path: write_npz(path, weights_0=header((2**70, 2))),
    "wide.npz": lambda path: write_npz(path, weights_0=header((2**45, 2))),
    "claimed.npz": lambda path: write_npz(path, weights_0=header((2**27, 2))),
    "negative.npz": lambda path: write_npz(path, weights_0=header((-5, 2))),
    "bytes.npz": lambda path: write_npz(
        path, weights_0=header((LARGEST // 3, 2), "|i1")[:-4] + bytes(LARGEST * 2 // 3)
    ),
    "letters.npz": lambda path: write_npz(path, weights_0=header((1, 2)) + bytes(4), activation=letters(12_000_000)),
    "allocating.zip": lambda path: write_zip(path, policy=allocating(bare=False)),
    "bare.zip": lambda path: write_zip(path, policy=allocating(bare=True)),
    "spaces.zip": lambda path: write_zip(path, ppo(), " " * 2 * LARGEST),
    "lists.zip": lambda path: write_zip(path, ppo(), "[" + "[]," * 10_000_000 + "[]]"),
    "repeated.zip": lambda path: write_zip(path, {"action_net.weight": repeated(2, 150_000_000)}),
    "layers.zip": lambda path: write_zip(path, ppo(2000, 20, repeated)),
    "nested.zip": lambda path: write_zip(path, policy=nested(2 * LARGEST)),
}


@pytest.mark.parametrize("name", BOMBS)
def test_small_files_take_little_memory(tmp_path: Path, name: str) -> None:
    """Whatever they unpack to, claim or repeat."""
    path = tmp_path / name
    BOMBS[name](path)
    assert path.stat().st_size < 500_000
    assert peak_of_refusal(path) < 3 * LARGEST


def test_torch_gets_no_file_that_unpacks_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it would take is not Python's memory, which the test above counts."""
    monkeypatch.delattr(torch, "load")
    BOMBS["nested.zip"](tmp_path / "nested.zip")
    with pytest.raises(ValueError, match=f"expected at most {LARGEST} bytes, received {2 * LARGEST}, unpacked"):
        read_network(tmp_path / "nested.zip")


@pytest.mark.parametrize("name", ["lies.npz", "lies.zip"])
def test_what_a_zip_says_is_all_it_unpacks(tmp_path: Path, name: str) -> None:
    """A directory that says less than there is: no more than that is unpacked."""
    path = tmp_path / name
    if name == "lies.npz":
        write_npz(path, weights_0=bytes(2 * LARGEST))
        understated(path, "weights_0.npy")
    else:
        write_zip(path, ppo(), " " * 2 * LARGEST)
        understated(path, "data")
    assert peak_of_refusal(path) < 3e6


def peak_of_refusal(path: Path) -> int:
    """Return how many bytes Python and numpy took to refuse a file."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=f"model: .*{path.name} holds none that can be played"):
            read_network(path)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.filterwarnings("ignore")  # Of numpy, about the headers.
@pytest.mark.parametrize("part", ["file.npz", "entry.npz", "file.zip", "entry.zip"])
def test_mutated_files_are_read_or_refused(tmp_path: Path, part: str) -> None:
    """Nothing else happens; bytes of the file, or of what a zip file without a fault holds."""
    rng, refused = random.Random(0), 0  # noqa: S311 (not for secrets)
    whole, path = tmp_path / f"whole.{part[-3:]}", tmp_path / f"mutated.{part[-3:]}"
    if part.endswith("npz"):
        network(10, 4, 2).save(whole)
    else:
        write_zip(whole, ppo(), json.dumps({"policy_kwargs": {"activation_fn": "<class 'torch.nn.ReLU'>"}}))
    with zipfile.ZipFile(whole) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    for _ in range(300):
        if part.startswith("file"):
            path.write_bytes(mutated(whole.read_bytes(), rng))
        else:
            chosen = "data" if part == "entry.zip" else rng.choice(sorted(entries))
            with zipfile.ZipFile(path, "w") as archive:
                for name, content in entries.items():
                    archive.writestr(name, mutated(content, rng) if name == chosen else content)
        try:
            assert read_network(path)(np.zeros((1, 10))).shape == (1, 2)
        except ValueError as error:
            refused += 1
            assert str(error).startswith("model: ")
    assert refused > 0


def mutated(content: bytes, rng: random.Random) -> bytes:
    """Return bytes with some of them changed, and at times cut short; most changes at either end."""
    changed = bytearray(content[: rng.choice([len(content), len(content), rng.randrange(len(content))])])
    for _ in range(rng.randint(1, 4)):
        if changed:
            near = rng.randrange(min(len(changed), 120))
            changed[rng.choice([near, len(changed) - 1 - near, rng.randrange(len(changed))])] = rng.randrange(256)
    return bytes(changed)
