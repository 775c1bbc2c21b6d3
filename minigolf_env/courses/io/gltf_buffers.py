"""Chunks of a binary glTF 2.0 file and the arrays in them (glTF 2.0, sections 3.6 and 4.4).

Every array is a slice of the file, so that the counts in an untrusted file allocate nothing.
"""

from __future__ import annotations

import json
import struct
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import quote
from minigolf_env.courses.schema.limits import Limits

JsonObject: TypeAlias = dict[str, Any]

REPAIR_HINT = "export it again"
"""Remedy in messages about values that no 3D program writes."""

INDEX_DTYPES: dict[int, np.dtype[Any]] = {5121: np.dtype("u1"), 5123: np.dtype("<u2"), 5125: np.dtype("<u4")}
"""Types of indices by their glTF component type."""

QUANTIZED_DTYPES: dict[int, np.dtype[Any]] = {
    5120: np.dtype("i1"),
    5121: np.dtype("u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
}
"""Types of positions of the extension KHR_mesh_quantization by their glTF component type."""

FLOAT_COMPONENT = 5126
"""Component type of float32 in glTF."""


def split_chunks(content: bytes, limits: Limits) -> tuple[JsonObject, bytes]:
    """Return the JSON and the binary chunk of a .glb file."""
    magic, version, length = struct.unpack_from("<4sII", content)
    if magic != b"glTF" or version != 2 or length > len(content):
        raise ValueError("the header is not that of a complete glTF 2.0 file")
    size, kind = struct.unpack_from("<I4s", content, 12)
    if kind != b"JSON" or 20 + size > len(content):
        raise ValueError("the JSON chunk is missing or incomplete")
    limits.check_bytes("JSON in it", size, text=True)
    data = json.loads(content[20 : 20 + size])
    if not isinstance(data, dict):
        raise ValueError("the JSON chunk is not an object")
    rest = content[20 + size :]
    binary = b""
    if len(rest) >= 8:
        size, kind = struct.unpack_from("<I4s", rest)
        binary = rest[8 : 8 + size] if kind == b"BIN\0" else b""
    return data, binary


def element_of(data: JsonObject, kind: str, number: Any) -> JsonObject:
    """Return an element of one of the file's lists, such as ``kind`` "nodes"; Python's negative indices are none."""
    elements = data.get(kind, ())
    if type(number) is not int or not 0 <= number < len(elements):
        raise ValueError(f"{kind}[{quote(number)}] does not exist; the file has {len(elements)} {kind}")
    element = elements[number]
    if not isinstance(element, dict):
        raise ValueError(f"{kind}[{number}] is not a JSON object")
    return element


def read_positions(data: JsonObject, binary: bytes, number: int) -> NDArray[Any]:
    """Return a copy of an accessor's positions (N, 3), as float32 or as integers if they are quantized."""
    accessor = element_of(data, "accessors", number)
    is_float = accessor["componentType"] == FLOAT_COMPONENT
    dtype = np.dtype("<f4") if is_float else QUANTIZED_DTYPES.get(accessor["componentType"])
    array = _read_rows(data, binary, number, "VEC3", 3, dtype)
    if not is_float and accessor.get("normalized", False):
        array = np.maximum(array / np.iinfo(array.dtype).max, -1.0)
    if not np.isfinite(array).all():
        raise ValueError(f"accessor {number} has positions that are not finite")
    return array


def read_indices(data: JsonObject, binary: bytes, number: int) -> NDArray[np.int64]:
    """Return a copy of an accessor's indices (N,)."""
    dtype = INDEX_DTYPES.get(element_of(data, "accessors", number)["componentType"])
    return _read_rows(data, binary, number, "SCALAR", 1, dtype).reshape(-1).astype(np.int64)


def _read_rows(
    data: JsonObject, binary: bytes, number: int, expected_type: str, width: int, dtype: np.dtype[Any] | None
) -> NDArray[Any]:
    """Return a copy of an accessor's rows (N, width)."""
    # Check that the accessor is of the type, and in this file.
    accessor = element_of(data, "accessors", number)
    if "sparse" in accessor or accessor["type"] != expected_type:
        raise ValueError(f"accessor {number} is sparse or not of type {expected_type}")
    if "bufferView" not in accessor:
        raise ValueError(f"accessor {number} has no data, as in a compressed mesh; export it without compression")
    view = element_of(data, "bufferViews", accessor["bufferView"])
    buffer = data.get("buffers", [{}])[0]
    if view.get("buffer", 0) != 0 or "uri" in buffer or buffer.get("extensions"):
        raise ValueError(
            f"accessor {number} refers to another file or to compressed data; export one .glb without compression"
        )
    if dtype is None:
        raise ValueError(f"accessor {number} has a wrong component type, {quote(accessor['componentType'])}")
    # Check that the array lies within its view, and the view within the file.
    start = view.get("byteOffset", 0)
    length = view["byteLength"]
    offset = accessor.get("byteOffset", 0)
    count = accessor["count"]
    row = dtype.itemsize * width
    stride = view.get("byteStride", row)
    numbers = (start, length, offset, count, stride)
    if not all(type(value) is int and 0 <= value <= len(binary) for value in numbers):
        raise ValueError(f"accessor {number} has a size or an offset beyond the file")
    end_in_view = offset + (count - 1) * stride + row
    if not count or stride < row or end_in_view > length or start + length > len(binary):
        raise ValueError(f"accessor {number} is empty, or extends beyond its view or the file")
    # Copy the rows.
    raw = np.frombuffer(binary, np.uint8, (count - 1) * stride + row, start + offset)
    rows = np.lib.stride_tricks.as_strided(raw, (count, row), (stride, 1))
    array: NDArray[Any] = np.ascontiguousarray(rows).view(dtype)
    return array
