"""Model files: saving and loading, and the refusal of files that would run code or exhaust the memory."""

from __future__ import annotations

import io
import itertools
import json
import os
import pickle
import random
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minigolf_env.players.mlp_policy import MLPPolicy
from minigolf_env.players.model_files import MAX_MODEL_BYTES, load_model, save_model
from minigolf_env.players.putt_value_model import PuttValueModel
from tests.cost import measure_memory
from tests.players.samples import RANDOM_OBSERVATIONS, random_mlp

torch = pytest.importorskip("torch", reason="reading and writing .zip files needs torch")


def test_loaded_policy_equals_saved_policy(tmp_path: Path) -> None:
    """Every bit is the same, and saving the same policy twice gives the same file."""
    policy = MLPPolicy(random_mlp(10, 16, 2, activation="relu"), squash=True)
    for name in ("first.npz", "second.npz"):
        save_model(policy, tmp_path / name)
    assert (tmp_path / "first.npz").read_bytes() == (tmp_path / "second.npz").read_bytes()
    loaded = load_model(tmp_path / "first.npz")
    assert isinstance(loaded, MLPPolicy)
    assert loaded.act_batch(RANDOM_OBSERVATIONS).tobytes() == policy.act_batch(RANDOM_OBSERVATIONS).tobytes()
    assert (loaded.mlp.activation, loaded.squash, loaded.mlp.num_inputs) == ("relu", True, 10)


def test_loaded_value_model_equals_saved_value_model(tmp_path: Path) -> None:
    """The file says that it holds a value model; the values have the same bits."""
    model = PuttValueModel(random_mlp(10, 16, 2, activation="relu"))
    save_model(model, tmp_path / "value.npz")
    loaded = load_model(tmp_path / "value.npz")
    assert isinstance(loaded, PuttValueModel)
    assert (
        loaded.expected_strokes(RANDOM_OBSERVATIONS).tobytes() == model.expected_strokes(RANDOM_OBSERVATIONS).tobytes()
    )


def test_float16_file_is_half_as_large(tmp_path: Path) -> None:
    """Weights of 16 bits are loaded as float32, each within its rounding, and saving them again gives the same file."""
    model = PuttValueModel(random_mlp(68, 100, 100, 2, activation="relu"))
    file = tmp_path / "float16.npz"
    save_model(model, tmp_path / "float32.npz")
    save_model(model, file, np.float16)
    assert file.stat().st_size < 0.55 * (tmp_path / "float32.npz").stat().st_size
    loaded = load_model(file)
    for saved_layer, loaded_layer in zip(model.mlp.layers, loaded.mlp.layers, strict=True):
        for saved_array, loaded_array in zip(saved_layer, loaded_layer, strict=True):
            assert loaded_array.dtype == np.float32
            np.testing.assert_allclose(saved_array, loaded_array, rtol=2.0**-11, atol=2.0**-24)
    save_model(loaded, tmp_path / "again.npz", np.float16)
    assert (tmp_path / "again.npz").read_bytes() == file.read_bytes()


def write_zip(path: Path, state: dict[str, Any] | None = None, data: str | None = None, policy: bytes = b"") -> None:
    """Write a file as stable-baselines3's PPO does: weights as torch saves them, and JSON."""
    if not policy:
        buffer = io.BytesIO()
        torch.save(state, buffer)
        policy = buffer.getvalue()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("data", json.dumps({"policy_kwargs": {}}) if data is None else data)
        file.writestr("policy.pth", policy)


def ppo_weights(hidden: int = 4, layers: int = 1, make: Callable[..., Any] = torch.ones) -> dict[str, Any]:
    """Return the weights of a network as PPO names them."""
    sizes, state = [10, *[hidden] * layers, 2], {}
    for k, (m, n) in enumerate(itertools.pairwise(sizes)):
        name = "action_net" if k == layers else f"mlp_extractor.policy_net.{2 * k}"
        state |= {f"{name}.weight": make(n, m), f"{name}.bias": make(n)}
    return state


class Trap:
    """An object whose unpickling makes a folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        """Return the call that unpickling makes."""
        return os.mkdir, (str(self.path),)


def test_no_file_runs_code(tmp_path: Path) -> None:
    """A pickle anywhere in a file is refused with a one-line error and never loaded."""
    trap = tmp_path / "sprung"
    np.savez(tmp_path / "a.npz", activation="tanh", squash=False, weights_0=np.array([Trap(trap)]), bias_0=np.zeros(2))
    (tmp_path / "b.npz").write_bytes(pickle.dumps(Trap(trap)))
    write_zip(tmp_path / "c.zip", {"action_net.weight": Trap(trap)})
    write_zip(tmp_path / "d.zip", policy=pickle.dumps(Trap(trap), protocol=2))  # Torch would load this one too.
    for name in ("a.npz", "b.npz", "c.zip", "d.zip"):
        with pytest.raises(ValueError, match=rf"model: .*{name}"):
            load_model(tmp_path / name)
    assert not trap.exists()


@pytest.mark.parametrize("name", ["empty.npz", "text.npz", "text.zip", "other.zip", "array.npz"])
def test_rejects_damaged_and_foreign_files(tmp_path: Path, name: str) -> None:
    """Refused are an empty file, a text, a zip file without a model, and a single array."""
    path = tmp_path / name
    path.write_bytes(b"" if name == "empty.npz" else b"no model")
    if name == "other.zip":
        with zipfile.ZipFile(path, "w") as file:
            file.writestr("data", "{}")
    if name == "array.npz":
        with path.open("wb") as raw:
            np.save(raw, np.zeros(3))
    with pytest.raises(ValueError, match=rf"model: .*{name}"):
        load_model(path)


def expanded(*shape: int) -> torch.Tensor:
    """Return a tensor that repeats one number in memory."""
    return torch.zeros(1).expand(*shape)


def npy_header(shape: tuple[int, ...], dtype: str = "<f4") -> bytes:
    """Return a .npy file that declares a shape but contains one number."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": dtype, "fortran_order": False, "shape": shape})
    return file.getvalue() + bytes(4)


def write_npz(path: Path, **entries: bytes) -> None:
    """Write an .npz file with the given entries; the other entries are those of a valid model."""
    defaults = {"activation": np.array("tanh"), "squash": np.array(False), "bias_0": np.zeros(2, np.float32)}
    np.savez(path, **{name: array for name, array in defaults.items() if name not in entries})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file:
        for name, content in entries.items():
            file.writestr(f"{name}.npy", content)


def letters(count: int) -> bytes:
    """Return a .npy file with an array of one-letter texts."""
    return npy_header((count,), "|S1")[:-4] + bytes(count)


def understate_size(path: Path, name: str) -> None:
    """Make an entry of a zip file declare an unpacked size of 100 bytes."""
    with zipfile.ZipFile(path) as file:
        size = file.getinfo(name).file_size.to_bytes(4, "little")
    content = path.read_bytes()
    assert content.count(size) == 2  # In the entry's header and in the directory.
    path.write_bytes(content.replace(size, (100).to_bytes(4, "little")))


def nested_zip(size: int) -> bytes:
    """Return a zip file of zeros in the layout of torch's files."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", bytes(size))
    return file.getvalue()


def allocating_pickle(bare: bool) -> bytes:
    """Return a weight file whose pickle allocates gigabytes: inside a zip file, or in front of an empty one."""
    content = b"\x80\x02cbuiltins\nbytearray\nJ" + struct.pack("<i", 2**31 - 1) + b"\x85R."
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("archive/version", "3\n")
        archive.writestr("archive/byteorder", "little")
        archive.writestr("archive/data.pkl", b"" if bare else content)
    return content + file.getvalue() if bare else file.getvalue()


MEMORY_BOMBS: dict[str, Callable[[Path], None]] = {
    "zeros.npz": lambda path: write_npz(path, weights_0=bytes(2 * MAX_MODEL_BYTES)),
    "far.npz": lambda path: write_npz(path, weights_0=npy_header((2**70, 2))),
    "wide.npz": lambda path: write_npz(path, weights_0=npy_header((2**45, 2))),
    "claimed.npz": lambda path: write_npz(path, weights_0=npy_header((2**27, 2))),
    "negative.npz": lambda path: write_npz(path, weights_0=npy_header((-5, 2))),
    "bytes.npz": lambda path: write_npz(
        path, weights_0=npy_header((MAX_MODEL_BYTES // 3, 2), "|i1")[:-4] + bytes(MAX_MODEL_BYTES * 2 // 3)
    ),
    "letters.npz": lambda path: write_npz(
        path, weights_0=npy_header((1, 2)) + bytes(4), activation=letters(12_000_000)
    ),
    "allocating.zip": lambda path: write_zip(path, policy=allocating_pickle(bare=False)),
    "bare.zip": lambda path: write_zip(path, policy=allocating_pickle(bare=True)),
    "spaces.zip": lambda path: write_zip(path, ppo_weights(), " " * 2 * MAX_MODEL_BYTES),
    "lists.zip": lambda path: write_zip(path, ppo_weights(), "[" + "[]," * 10_000_000 + "[]]"),
    "expanded.zip": lambda path: write_zip(path, {"action_net.weight": expanded(2, 150_000_000)}),
    "layers.zip": lambda path: write_zip(path, ppo_weights(2000, 20, expanded)),
    "nested.zip": lambda path: write_zip(path, policy=nested_zip(2 * MAX_MODEL_BYTES)),
}


@pytest.mark.parametrize("name", MEMORY_BOMBS)
def test_small_files_take_little_memory(tmp_path: Path, name: str) -> None:
    """The memory is bounded, whatever a small file unpacks to, declares or repeats."""
    path = tmp_path / name
    MEMORY_BOMBS[name](path)
    assert path.stat().st_size < 500_000
    assert peak_memory_of_refusal(path) < 3 * MAX_MODEL_BYTES


def test_torch_never_reads_file_with_too_large_declared_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Torch's memory is not Python's, which the test above measures; here torch.load is absent."""
    monkeypatch.delattr(torch, "load")
    MEMORY_BOMBS["nested.zip"](tmp_path / "nested.zip")
    message = f"expected at most {MAX_MODEL_BYTES} bytes, received {2 * MAX_MODEL_BYTES}, unpacked"
    with pytest.raises(ValueError, match=message):
        load_model(tmp_path / "nested.zip")


@pytest.mark.parametrize("name", ["understated.npz", "understated.zip"])
def test_unpacks_no_more_than_declared_size(tmp_path: Path, name: str) -> None:
    """If a zip file declares less data than it contains, only the declared size is unpacked."""
    path = tmp_path / name
    if name == "understated.npz":
        write_npz(path, weights_0=bytes(2 * MAX_MODEL_BYTES))
        understate_size(path, "weights_0.npy")
    else:
        write_zip(path, ppo_weights(), " " * 2 * MAX_MODEL_BYTES)
        understate_size(path, "data")
    assert peak_memory_of_refusal(path) < 3e6


def peak_memory_of_refusal(path: Path) -> int:
    """Return the peak memory in bytes that Python and numpy take to refuse a file."""
    message = f"model: .*{path.name} contains no model that can be played"
    with measure_memory() as memory, pytest.raises(ValueError, match=message):
        load_model(path)
    return memory.peak


@pytest.mark.filterwarnings("ignore")  # numpy warns about the headers.
@pytest.mark.parametrize("part", ["file.npz", "entry.npz", "file.zip", "entry.zip"])
def test_mutated_files_are_loaded_or_refused(tmp_path: Path, part: str) -> None:
    """No other exception occurs, whether bytes of the file change or bytes of the entries of a valid zip file."""
    rng = random.Random(0)  # noqa: S311 (not for secrets)
    num_refused = 0
    valid = tmp_path / f"valid.{part[-3:]}"
    path = tmp_path / f"mutated.{part[-3:]}"
    if part.endswith("npz"):
        save_model(MLPPolicy(random_mlp(10, 4, 2)), valid)
    else:
        write_zip(valid, ppo_weights(), json.dumps({"policy_kwargs": {"activation_fn": "<class 'torch.nn.ReLU'>"}}))
    with zipfile.ZipFile(valid) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    for _ in range(300):
        if part.startswith("file"):
            path.write_bytes(mutate(valid.read_bytes(), rng))
        else:
            chosen = "data" if part == "entry.zip" else rng.choice(sorted(entries))
            with zipfile.ZipFile(path, "w") as archive:
                for name, content in entries.items():
                    archive.writestr(name, mutate(content, rng) if name == chosen else content)
        try:
            model = load_model(path)
            assert isinstance(model, MLPPolicy) and model.act_batch(np.zeros((1, 10))).shape == (1, 2)
        except ValueError as error:
            num_refused += 1
            assert str(error).startswith("model: ")
    assert num_refused > 0


def mutate(content: bytes, rng: random.Random) -> bytes:
    """Return bytes with a few of them changed, sometimes truncated; most changes are near either end."""
    changed = bytearray(content[: rng.choice([len(content), len(content), rng.randrange(len(content))])])
    for _ in range(rng.randint(1, 4)):
        if changed:
            offset = rng.randrange(min(len(changed), 120))
            changed[rng.choice([offset, len(changed) - 1 - offset, rng.randrange(len(changed))])] = rng.randrange(256)
    return bytes(changed)
