"""A trained network and its files: numpy plays it, and no file it is read from can run code.

``.npz`` is its own format, plain arrays. The ``.zip`` that stable-baselines3's ``model.save`` writes holds pickled code
beside the weights; of it only the weights are read, by torch's ``weights_only``, and the JSON text that names the
activation, so that a stranger's model is as harmless as a picture. Nor does a small file take much memory: what it says
it unpacks to is limited before anything is read, and no more than it says is ever unpacked.
"""

from __future__ import annotations

import io
import itertools
import json
import math
import pickle
import pickletools
import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import one_of

Array = NDArray[np.float32]

ACTIVATIONS = ("relu", "tanh")


class Layer(NamedTuple):
    """One layer: x becomes x @ weights + bias."""

    weights: Array
    """(inputs, outputs)."""
    bias: Array
    """(outputs,)."""


@dataclass(frozen=True)
class Network:
    """A fully connected network from observations to putts, or one that judges putts.

    Args:
        layers: one after the other; the last has two outputs.
        activation: after every layer but the last, one of ``ACTIVATIONS``.
        squash: whether tanh brings the outputs to [-1, 1], as SAC learns it, or clipping does, as PPO does.
        judges: whether it judges putts by their sight (sight.py). Its outputs are then the logit of the probability
            that the putt holes out, and what softplus makes the strokes that are left if it does not.

    Raises:
        ValueError: the layers do not fit together, a number is not finite, or there is no such activation.
    """

    layers: tuple[Layer, ...]
    activation: str = "tanh"
    squash: bool = False
    judges: bool = False

    def __post_init__(self) -> None:
        one_of(self.activation, ACTIVATIONS, "activation")
        sizes = [(*layer.weights.shape, *layer.bias.shape) for layer in self.layers]
        chained = all(len(size) == 3 and size[1] == size[2] for size in sizes) and all(
            one[1] == next_[0] for one, next_ in itertools.pairwise(sizes)
        )
        if not sizes or not chained or sizes[-1][1] != 2:
            raise ValueError(f"expected layers that fit together and end in 2 outputs, received sizes {sizes}.")
        if not all(np.isfinite(array).all() for layer in self.layers for array in layer):
            raise ValueError("expected finite weights, received others; the training has diverged.")

    @property
    def inputs(self) -> int:
        """How many numbers an observation has."""
        return len(self.layers[0].weights)

    def __call__(self, observations: NDArray[Any]) -> Array:
        """Return putts (N, 2), float32 in [-1, 1], of observations (N, inputs).

        Sums are taken input by input, so that a putt has the same bits whatever the N.

        Raises:
            ValueError: the observations are of another shape.
        """
        x = np.asarray(observations, dtype=np.float32)
        if x.ndim != 2 or x.shape[1] != self.inputs:
            raise ValueError(f"observations: expected shape (N, {self.inputs}), received {x.shape}.")
        x = self._outputs(x, _row_by_row)
        return np.tanh(x) if self.squash else np.clip(x, np.float32(-1.0), np.float32(1.0))

    def cost(self, sights: NDArray[Any]) -> Array:
        """Return the strokes (N, ...) that are expected to be left after putts of sights (N, ..., inputs).

        Each of the N is a product of matrices of its own: a cost has the same bits whatever the N.
        """
        x = np.asarray(sights, dtype=np.float32)
        outputs = self._outputs(x.reshape(len(x), -1, self.inputs), lambda x, layer: x @ layer.weights + layer.bias)
        missed, after = np.exp(-np.logaddexp(0.0, outputs[..., 0])), np.logaddexp(0.0, outputs[..., 1])
        return np.asarray(missed * after, dtype=np.float32).reshape(x.shape[:-1])

    def _outputs(self, x: Array, through: Callable[[Array, Layer], Array]) -> Array:
        for i, layer in enumerate(self.layers):
            if i > 0:
                x = np.tanh(x) if self.activation == "tanh" else np.maximum(x, np.float32(0.0))
            x = through(x, layer)
        return x

    def save(self, path: str | Path, dtype: type[np.floating[Any]] = np.float32) -> None:
        """Write the network to an .npz file, its weights as a type; the same network gives the same bytes."""
        arrays: dict[str, Any] = {"activation": np.array(self.activation), "squash": np.array(self.squash)}
        if self.judges:
            arrays["judges"] = np.array(True)
        for i, (weights, bias) in enumerate(self.layers):
            arrays |= {f"weights_{i}": weights.astype(dtype), f"bias_{i}": bias.astype(dtype)}
        with Path(path).open("wb") as file:
            np.savez_compressed(file, **arrays)


def _row_by_row(x: Array, layer: Layer) -> Array:
    """Return x @ weights + bias, (N, outputs), each row with the same bits whatever the N."""
    total = np.tile(layer.bias, (len(x), 1))
    for k, row in enumerate(layer.weights):
        total += x[:, k, None] * row
    return total


LARGEST = 64_000_000
"""Largest model taken, unpacked, bytes: 15 layers of 1024 by 1024 numbers."""

LARGEST_TEXT = LARGEST // 16
"""Largest JSON text taken, bytes: as Python's objects it takes 30 times the memory."""

ZIP = b"PK\x03\x04"
"""How a zip file begins. Torch takes what begins otherwise for a bare pickle, whatever follows."""

NAMING = ("GLOBAL", "STACK_GLOBAL", "INST", "EXT1", "EXT2", "EXT4")
"""The pickle's operations that name what is called, or hide its name."""

TENSORS = re.compile(r"collections OrderedDict|torch\._utils _rebuild_tensor_v2|torch \w+Storage")
"""What they may name."""

UNREADABLE = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    pickle.UnpicklingError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What numpy, json, zipfile and torch raise on files that they did not write, or that are damaged."""


def read_network(path: str | Path) -> Network:
    """Return the network in an .npz file, or in the .zip file of a model trained by stable-baselines3's PPO or SAC.

    Raises:
        FileNotFoundError: there is no such file.
        PermissionError: it may not be read.
        ValueError: it holds something else, a network that is not fully connected (no "MlpPolicy"), or one too large.
        ImportError: torch is not installed, which a .zip file needs.
    """
    file = Path(path)
    read = _read_npz if file.suffix == ".npz" else _read_zip
    if not file.is_file():
        raise FileNotFoundError(f"model: expected a .zip or .npz file, there is none at {path}.")
    try:
        return read(file)
    except (FileNotFoundError, PermissionError):
        raise
    except UNREADABLE as error:
        raise ValueError(f"model: {path} holds none that can be played: {error}") from error


def _read_npz(path: Path) -> Network:
    with zipfile.ZipFile(path) as archive:
        entries = _check_size(archive)
        arrays = {name: _npy(_read(archive, name)) for name in entries}
    count = sum(name.startswith("bias_") for name in arrays)
    layers = _layers([(arrays[f"weights_{i}.npy"], arrays[f"bias_{i}.npy"]) for i in range(count)])
    named = {name: arrays[f"{name}.npy"] for name in ("activation", "squash", "judges") if f"{name}.npy" in arrays}
    if any(array.shape != () for array in named.values()):
        raise ValueError(f"expected {', '.join(named)} without axes, received arrays.")
    # As bytes: numpy's texts in a file may have characters that are none, with which Python's own do not work.
    activation = named["activation"].astype("S80").item().decode("ascii")
    return Network(layers, activation, bool(named["squash"]), bool(named.get("judges", False)))


def _npy(content: bytes) -> NDArray[Any]:
    """Return the array in a .npy file, a view of its bytes, so that no claim of its header takes memory."""
    file = io.BytesIO(content)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("expected arrays as numpy.savez writes them, received another version.")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
    array = np.frombuffer(content, dtype, math.prod(shape), file.tell())
    return array.reshape(shape, order="F" if fortran else "C")


class _Kind(NamedTuple):
    """Where an algorithm of stable-baselines3 keeps the network that plays."""

    hidden: str
    last: str
    activation: str
    squash: bool


KINDS = {
    "PPO": _Kind("mlp_extractor.policy_net", "action_net", "tanh", False),
    "SAC": _Kind("actor.latent_pi", "actor.mu", "relu", True),
}


def _read_zip(path: Path) -> Network:
    try:
        import torch
    except ImportError as error:
        raise ImportError("A model's .zip file needs torch: pip install 'minigolf-env[agents]'.") from error
    check_model(path)
    with zipfile.ZipFile(path) as archive:
        about: dict[str, Any] = json.loads(_read(archive, "data"))
        weights = io.BytesIO(_read(archive, "policy.pth"))
    state: dict[str, Any] = torch.load(weights, map_location="cpu", weights_only=True)
    kind = next((kind for kind in KINDS.values() if f"{kind.last}.weight" in state), None)
    if kind is None or any("features_extractor." in name for name in state):
        raise ValueError(
            f"expected an MlpPolicy of {' or '.join(KINDS)}, received another; if you trust the file, load it "
            "with stable-baselines3 and play it as a policies.SB3Policy."
        )
    found = (name.rpartition(".")[0] for name in state if name.startswith(kind.hidden) and name.endswith(".weight"))
    names = sorted(found, key=lambda name: int(name.rpartition(".")[2]))
    layers = _layers([(state[f"{name}.weight"].T, state[f"{name}.bias"]) for name in (*names, kind.last)])
    # Written as a class's text beside its pickle: "<class 'torch.nn.modules.activation.Tanh'>".
    activation = str(about["policy_kwargs"].get("activation_fn", kind.activation))[-80:].rpartition(".")[2].strip("'>")
    return Network(layers, activation.lower(), kind.squash)


def check_model(path: Path) -> None:
    """Raise a ValueError if reading a model's .zip file could take far more memory than it has weights.

    ``torch.load`` with ``weights_only`` runs no code of the file, but makes arrays of any size that its pickle names.
    """
    with zipfile.ZipFile(path) as archive:
        entries = _check_size(archive)
        if entries["data"].file_size > LARGEST_TEXT:
            raise ValueError(f"expected at most {LARGEST_TEXT} bytes of JSON, received {entries['data'].file_size}.")
        size = sum(check_weights(_read(archive, name)) for name in entries if name.endswith(".pth"))
    if size > LARGEST:
        raise ValueError(f"expected at most {LARGEST} bytes of weights, received {size}.")


def check_weights(content: bytes) -> int:
    """Return how many bytes what ``torch.save`` wrote unpacks to; raise a ValueError if it holds more than tensors."""
    if not content.startswith(ZIP):
        raise ValueError("expected weights as torch saves them, a zip file, received something else.")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = _check_size(archive)
        for name in entries:
            if name.endswith(".pkl"):
                _check_pickle(_read(archive, name))
    return sum(entry.file_size for entry in entries.values())


def _check_pickle(content: bytes) -> None:
    """Raise a ValueError if a pickle calls anything that weights do not need. It is only looked at, not loaded."""
    for opcode, argument, _ in pickletools.genops(content):
        if opcode.name in NAMING and not (isinstance(argument, str) and TENSORS.fullmatch(argument)):
            raise ValueError(f"expected tensors alone, received {str(argument)!r:.80}.")


def _check_size(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Return a zip file's entries by name, or raise a ValueError if they say that they unpack to too much."""
    entries = archive.infolist()
    total = sum(entry.file_size for entry in entries)
    if total > LARGEST:
        raise ValueError(f"expected at most {LARGEST} bytes, received {total}, unpacked.")
    if any(entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for entry in entries):
        raise ValueError("expected entries stored or deflated, received others.")  # Others unpack whole what lies.
    return {entry.filename: entry for entry in entries}


def _read(archive: zipfile.ZipFile, name: str) -> bytes:
    """Return an entry of a zip file, no more than it says: to read without a number unpacks all there is at once."""
    file: IO[bytes]
    with archive.open(name) as file:
        return file.read(archive.getinfo(name).file_size)


def _layers(arrays: Iterable[tuple[Any, Any]]) -> tuple[Layer, ...]:
    """Return layers from weights and biases of any type, whose views may show few numbers many times."""
    pairs = list(arrays)
    total = 4 * sum(math.prod(array.shape) for pair in pairs for array in pair)
    if total > LARGEST:
        raise ValueError(f"expected layers of at most {LARGEST} bytes, received {total}.")
    return tuple(Layer(*(np.ascontiguousarray(array, dtype=np.float32) for array in pair)) for pair in pairs)
