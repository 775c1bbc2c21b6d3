"""Save and load model files. This module is a security boundary: no file it reads can run code or exhaust the memory.

``.npz`` files are the package's own format: arrays without pickles. ``.zip`` files are written by stable-baselines3's
``model.save`` and contain pickled code next to the weights. Of these, only the weights are read, by torch's
``weights_only`` mode, and the JSON text that names the activation. The unpacked size that a file declares is limited
before anything is read, and no more than the declared size is ever unpacked.
"""

from __future__ import annotations

import io
import json
import math
import os
import pickle
import pickletools
import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import quote, quote_error, quote_unless_plain
from minigolf_env.players.mlp import MLP, Layer
from minigolf_env.players.mlp_policy import MLPPolicy
from minigolf_env.players.putt_value_model import PuttValueModel

Model = MLPPolicy | PuttValueModel

MAX_MODEL_BYTES = 64_000_000
"""Largest unpacked size of a model, bytes: 15 layers of 1024 by 1024 numbers."""

MAX_JSON_BYTES = MAX_MODEL_BYTES // 16
"""Largest JSON text in a model file, bytes; as Python objects it takes 30 times the memory."""

ZIP_SIGNATURE = b"PK\x03\x04"
"""First bytes of a zip file. Torch reads a file that begins otherwise as a bare pickle, whatever follows."""

NAMING_OPCODES = ("GLOBAL", "STACK_GLOBAL", "INST", "EXT1", "EXT2", "EXT4")
"""Pickle opcodes that name what is called, or hide its name."""

ALLOWED_GLOBALS = re.compile(r"collections OrderedDict|torch\._utils _rebuild_tensor_v2|torch \w+Storage")
"""Names that the pickle of a weight file may refer to."""

READ_ERRORS = (
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
"""Exceptions that numpy, json, zipfile and torch raise on damaged files and on files of other programs."""


def save_model(model: Model, path: str | Path, dtype: type[np.floating[Any]] = np.float32) -> None:
    """Write a model to an .npz file, with weights of the given type; the same model gives the same bytes."""
    arrays: dict[str, Any] = {"activation": np.array(model.mlp.activation)}
    if isinstance(model, PuttValueModel):
        arrays |= {"squash": np.array(False), "putt_value": np.array(True)}
    else:
        arrays["squash"] = np.array(model.squash)
    for i, (weights, bias) in enumerate(model.mlp.layers):
        arrays |= {f"weights_{i}": weights.astype(dtype), f"bias_{i}": bias.astype(dtype)}
    with Path(path).open("wb") as file:
        np.savez_compressed(file, **arrays)


def load_model(path: str | Path) -> Model:
    """Return the model in an .npz file, or the policy in a .zip file of stable-baselines3's PPO or SAC.

    Raises:
        FileNotFoundError: there is no such file.
        PermissionError: the file may not be read.
        ValueError: the file contains something else, a network that is not fully connected (not "MlpPolicy"), or a
            network that is too large.
        ImportError: torch is not installed, which a .zip file needs.
    """
    file = Path(path)
    read = _load_npz if file.suffix == ".npz" else _load_sb3_zip
    if not os.path.isfile(file):  # noqa: PTH113 - Path.is_file raises an OSError for a name that is too long.
        place = quote_unless_plain(str(path))
        raise FileNotFoundError(f"model: expected a .zip or .npz file, there is none at {place}.")
    try:
        return read(file)
    except (FileNotFoundError, PermissionError):
        raise
    except READ_ERRORS as error:
        raise ValueError(f"model: {path} contains no model that can be played: {quote_error(error)}") from error


def _load_npz(path: Path) -> Model:
    # Read all arrays, after the declared sizes have been checked.
    with zipfile.ZipFile(path) as archive:
        entries = _check_entries(archive)
        arrays = {name: _parse_npy(_read_entry(archive, name)) for name in entries}
    # Convert the layers.
    num_layers = sum(name.startswith("bias_") for name in arrays)
    layers = _to_layers([(arrays[f"weights_{i}.npy"], arrays[f"bias_{i}.npy"]) for i in range(num_layers)])
    # Convert the settings.
    names = ("activation", "squash", "putt_value")
    settings = {name: arrays[f"{name}.npy"] for name in names if f"{name}.npy" in arrays}
    if any(array.shape != () for array in settings.values()):
        raise ValueError(f"expected {', '.join(settings)} without axes, received arrays.")
    # Decode the text from bytes: a numpy text in a file may contain invalid code points, which break Python's str.
    activation = settings["activation"].astype("S80").item().decode("ascii")
    mlp = MLP(layers, activation)
    squash = bool(settings["squash"])
    return PuttValueModel(mlp) if bool(settings.get("putt_value", False)) else MLPPolicy(mlp, squash)


def _parse_npy(content: bytes) -> NDArray[Any]:
    """Return the array in a .npy file as a view of the file's bytes, so that a false header cannot allocate memory."""
    file = io.BytesIO(content)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("expected arrays as numpy.savez writes them, received another version.")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
    array = np.frombuffer(content, dtype, math.prod(shape), file.tell())
    return array.reshape(shape, order="F" if fortran else "C")


class _AlgorithmLayout(NamedTuple):
    """Names and defaults of the policy network of a stable-baselines3 algorithm."""

    hidden_layers: str
    """Name of the module with the hidden layers."""
    last_layer: str
    """Name of the last layer."""
    activation: str
    """Default activation function."""
    squash: bool
    """True if tanh brings the outputs to [-1, 1]."""


ALGORITHM_LAYOUTS = {
    "PPO": _AlgorithmLayout("mlp_extractor.policy_net", "action_net", "tanh", False),
    "SAC": _AlgorithmLayout("actor.latent_pi", "actor.mu", "relu", True),
}
"""Layouts of the policy networks of stable-baselines3, by algorithm."""


def _load_sb3_zip(path: Path) -> MLPPolicy:
    try:
        import torch
    except ImportError as error:
        raise ImportError("A model's .zip file needs torch: pip install 'minigolf-env[agents]'.") from error
    # Read the settings and the weights, after the file has been checked.
    check_sb3_file(path)
    with zipfile.ZipFile(path) as archive:
        settings: dict[str, Any] = json.loads(_read_entry(archive, "data"))
        weights = io.BytesIO(_read_entry(archive, "policy.pth"))
    state: dict[str, Any] = torch.load(weights, map_location="cpu", weights_only=True)
    # Find the algorithm by the name of its last layer.
    layout = next((layout for layout in ALGORITHM_LAYOUTS.values() if f"{layout.last_layer}.weight" in state), None)
    if layout is None or any("features_extractor." in name for name in state):
        raise ValueError(
            f"expected an MlpPolicy of {' or '.join(ALGORITHM_LAYOUTS)}, received another; if you trust the file, load "
            "it with stable-baselines3 and play it as a policies.SB3Policy."
        )
    # Collect the layers in order.
    hidden = (
        name.rpartition(".")[0] for name in state if name.startswith(layout.hidden_layers) and name.endswith(".weight")
    )
    names = sorted(hidden, key=lambda name: int(name.rpartition(".")[2]))
    layers = _to_layers([(state[f"{name}.weight"].T, state[f"{name}.bias"]) for name in (*names, layout.last_layer)])
    # The activation is written as the text of its class: "<class 'torch.nn.modules.activation.Tanh'>".
    text = str(settings["policy_kwargs"].get("activation_fn", layout.activation))[-80:]
    activation = text.rpartition(".")[2].strip("'>").lower()
    return MLPPolicy(MLP(layers, activation), layout.squash)


def check_sb3_file(path: Path) -> None:
    """Raise ValueError if reading a stable-baselines3 model file could take far more memory than its weights have.

    ``torch.load`` with ``weights_only`` runs no code of the file, but allocates arrays of any size that its pickle
    declares.
    """
    with zipfile.ZipFile(path) as archive:
        entries = _check_entries(archive)
        json_size = entries["data"].file_size
        if json_size > MAX_JSON_BYTES:
            raise ValueError(f"expected at most {MAX_JSON_BYTES} bytes of JSON, received {json_size}.")
        size = sum(check_torch_file(_read_entry(archive, name)) for name in entries if name.endswith(".pth"))
    if size > MAX_MODEL_BYTES:
        raise ValueError(f"expected at most {MAX_MODEL_BYTES} bytes of weights, received {size}.")


def check_torch_file(content: bytes) -> int:
    """Return the unpacked size in bytes of a file of ``torch.save``; raise ValueError if it has more than tensors."""
    if not content.startswith(ZIP_SIGNATURE):
        raise ValueError("expected weights as torch saves them, a zip file, received something else.")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = _check_entries(archive)
        for name in entries:
            if name.endswith(".pkl"):
                _check_pickle(_read_entry(archive, name))
    return sum(entry.file_size for entry in entries.values())


def _check_pickle(content: bytes) -> None:
    """Raise ValueError if a pickle calls anything that weights do not need. The pickle is scanned, never loaded."""
    for opcode, argument, _ in pickletools.genops(content):
        is_allowed = isinstance(argument, str) and ALLOWED_GLOBALS.fullmatch(argument)
        if opcode.name in NAMING_OPCODES and not is_allowed:
            raise ValueError(f"expected tensors alone, received {quote(str(argument))}.")


def _check_entries(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Return the entries of a zip file by name; raise ValueError if their declared sizes add up to too much."""
    entries = archive.infolist()
    total = sum(entry.file_size for entry in entries)
    if total > MAX_MODEL_BYTES:
        raise ValueError(f"expected at most {MAX_MODEL_BYTES} bytes, received {total}, unpacked.")
    # Other compression methods unpack all the data at once, whatever size is declared.
    if any(entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for entry in entries):
        raise ValueError("expected entries stored or deflated, received others.")
    return {entry.filename: entry for entry in entries}


def _read_entry(archive: zipfile.ZipFile, name: str) -> bytes:
    """Return an entry of a zip file, at most its declared size: a read without a size would unpack all the data."""
    file: IO[bytes]
    with archive.open(name) as file:
        return file.read(archive.getinfo(name).file_size)


def _to_layers(arrays: Iterable[tuple[Any, Any]]) -> tuple[Layer, ...]:
    """Return layers from weights and biases of any type, with a limit on their size.

    An array may be a view that repeats a few numbers, and take far more memory as an array of its own.
    """
    pairs = list(arrays)
    total = 4 * sum(math.prod(array.shape) for pair in pairs for array in pair)
    if total > MAX_MODEL_BYTES:
        raise ValueError(f"expected layers of at most {MAX_MODEL_BYTES} bytes, received {total}.")
    return tuple(Layer(*(np.ascontiguousarray(array, dtype=np.float32) for array in pair)) for pair in pairs)
