"""Readers of .obj, .ply and .stl files: vertices and polygons, and nothing else that these files may hold.

The readers of trimesh make fans of concave polygons, count relative indices from the end of the file, and refuse binary
.ply files of triangles and quads; these read what 3D programs write. All sizes that a file claims are checked against
its length before memory is taken.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import quote, quote_error
from minigolf_env.courses.course import CourseError
from minigolf_env.courses.geometry.polygons import triangulate_polygons
from minigolf_env.courses.schema.limits import Limits

Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices (V, 3), m, and faces (F, 3)."""

PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
"""Types of .ply files with their numpy types."""

PLY_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
"""Formats of .ply files with the byte order of their numbers; "" for text."""

MAX_PLY_PROPERTIES = 256
"""Largest number of elements and properties that a .ply file declares."""

STL_HEADER_BYTES = 84
"""Length of a binary .stl file's header and count of triangles, bytes."""

STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""A triangle of a binary .stl file."""


def read_obj(content: bytes, limits: Limits) -> Triangles:
    """Return the faces of a Wavefront .obj file, triangulated; groups, materials, curves and lines are left out.

    An index counts from 1, or, if negative, back from the vertex before the face's line.

    Raises:
        CourseError: a line has a fault; the message names it.
    """
    vertices: list[tuple[float, ...]] = []
    polygons: list[list[int]] = []
    lines: list[int] = []
    num_corners = 0
    text = re.sub("\r\n?", "\n", content.decode("utf-8-sig", "replace"))
    for number, line in enumerate(_continued_lines(text), 1):
        words = line.split("#", 1)[0].split()
        if not words or words[0] not in ("v", "f"):
            continue
        try:
            if words[0] == "v":
                x, y, z = map(float, words[1:4])
                vertices.append((x, y, z))
                continue
            indices = [int(word.split("/", 1)[0]) for word in words[1:]]
        except ValueError as error:
            raise CourseError(
                f"line {number}: expected x, y, z or the numbers of vertices, received {quote(line)}."
            ) from error
        if len(indices) < 3 or 0 in indices:
            raise CourseError(
                f"line {number}: expected three or more vertices, counted from 1, received {quote(line)}."
            )
        num_corners += len(indices) - 2
        limits.check_triangles(num_corners)
        polygons.append([index - 1 if index > 0 else len(vertices) + index for index in indices])
        lines.append(number)
    for polygon, number in zip(polygons, lines, strict=True):
        if min(polygon) < 0 or max(polygon) >= len(vertices):
            raise CourseError(
                f"line {number}: expected one of {len(vertices)} vertices, received a number beyond them."
            )
    corners = np.array(vertices, np.float64).reshape(-1, 3)
    return corners, triangulate_polygons(_finite(corners), polygons, lines)


def _continued_lines(text: str) -> list[str]:
    """Return the lines of a text; one that ends with a backslash has the next appended, which then is empty.

    Comments are not continued: they may end with the path of a folder.
    """
    if "\\\n" not in text:
        return text.split("\n")
    lines: list[str] = []
    parts: list[str] = []
    for line in text.split("\n"):
        is_continued = line.endswith("\\") and "#" not in line
        parts.append(line[:-1] if is_continued else line)
        if not is_continued:
            lines += ["".join(parts), *[""] * (len(parts) - 1)]
            parts = []
    return [*lines, "".join(parts)]


def read_stl(content: bytes, limits: Limits) -> Triangles:
    """Return the triangles of an .stl file: binary if its length is as its header counts, text if it has vertices.

    Raises:
        CourseError: the count of a binary file disagrees with its length, or a text has an incomplete triangle.
    """
    claimed = int.from_bytes(content[80:STL_HEADER_BYTES], "little")
    num_bytes = len(content) - STL_HEADER_BYTES
    is_text = re.search(rb"\bvertex[ \t]+[-+.\d]", content, re.IGNORECASE) is not None
    if num_bytes == claimed * STL_RECORD.itemsize or not is_text:
        if num_bytes < 0:
            raise CourseError(
                f"expected an .stl file of {STL_HEADER_BYTES} bytes or more, or a text with vertices, received "
                f"{len(content)} bytes; export it again."
            )
        if num_bytes < claimed * STL_RECORD.itemsize or (claimed == 0 and num_bytes > 0):
            raise CourseError(
                f"expected the {claimed} triangles that the header counts in a binary .stl file, received "
                f"{num_bytes} bytes, enough for {num_bytes // STL_RECORD.itemsize}; export it again."
            )
        limits.check_triangles(claimed)  # Bytes after the last triangle are of no concern.
        corners = np.frombuffer(content, STL_RECORD, claimed, STL_HEADER_BYTES)["corners"].reshape(-1, 3)
    else:
        limits.check_bytes("text", len(content), text=True)
        rows = re.findall(rb"\bvertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", content, re.IGNORECASE)
        limits.check_triangles(len(rows) // 3)
        if len(rows) % 3:
            raise CourseError(f"expected three vertices for each triangle in a text .stl file, received {len(rows)}.")
        try:
            corners = np.array([[float(word) for word in row] for row in rows]).reshape(-1, 3)
        except ValueError as error:
            raise CourseError(
                f"expected numbers after 'vertex' in a text .stl file, received others: {quote_error(error)}."
            ) from error
    vertices = _finite(corners.astype(np.float64))
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def read_ply(content: bytes, limits: Limits) -> Triangles:
    """Return the faces of a .ply file, text or binary, triangulated; colours and other properties are left out.

    Raises:
        CourseError: the header has a fault, or the file is shorter than the header says.
    """
    order, elements, start = _read_ply_header(content)
    reader = _PlyReader(content, start, order)
    vertices = np.empty((0, 3))
    polygons: list[list[int]] = []
    for name, count, properties in elements:
        wanted = {"vertex": ("x", "y", "z"), "face": ("vertex_indices", "vertex_index")}.get(name, ())
        found = [prop for prop in properties if prop[0] in wanted]
        if name == "face":
            limits.check_triangles(count)
        if (name == "vertex" and len(found) != 3) or (name == "face" and (len(found) != 1 or not found[0][2])):
            raise CourseError(f"expected {' or '.join(wanted)} of each {name} in a .ply file, received none.")
        if not properties:  # Its rows hold nothing.
            continue
        rows = reader.read_rows(count, properties, [prop[0] for prop in found], limits)
        if name == "vertex":
            vertices = np.array(rows, np.float64).reshape(-1, 3)
        elif name == "face":
            polygons = [row[0] for row in rows]
    for number, polygon in enumerate(polygons):
        are_whole = all(index % 1 == 0 for index in polygon)
        if len(polygon) < 3 or not are_whole or min(polygon) < 0 or max(polygon) >= len(vertices):
            raise CourseError(
                f"face {number}: expected three or more of {len(vertices)} vertices, received {quote(polygon)}."
            )
    return vertices, triangulate_polygons(_finite(vertices), polygons)


Property = tuple[str, str, str]
"""Name and type of a property of a .ply file, and the type of its length if it is a list, else ""."""


def _read_ply_header(content: bytes) -> tuple[str, list[tuple[str, int, list[Property]]], int]:
    """Return the byte order, the elements with count and properties, and where the data begin, of a .ply file."""
    match = re.match(rb"(?:\xef\xbb\xbf)?ply[ \t]*\r?[\n\r](.*?)\bend_header[ \t]*(\r\n|\n|\r)", content, re.DOTALL)
    if match is None:
        raise CourseError("expected a .ply file with a complete header, received another.")
    order: str | None = None
    elements: list[tuple[str, int, list[Property]]] = []
    lines = match[1].decode("ascii", "replace").splitlines()
    if sum(not line.startswith(("comment", "obj_info")) for line in lines) > MAX_PLY_PROPERTIES:
        raise CourseError(f"expected a .ply file with at most {MAX_PLY_PROPERTIES} properties, received more.")
    for line in lines:
        words = line.split()
        try:
            if words[:1] == ["format"]:
                order = PLY_BYTE_ORDERS[words[1]]
            elif words[:1] == ["element"]:
                elements.append((words[1], int(words[2]), []))
            elif words[:2] == ["property", "list"]:
                elements[-1][2].append((words[4], PLY_TYPES[words[3]], PLY_TYPES[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1][2].append((words[2], PLY_TYPES[words[1]], ""))
        except (LookupError, ValueError) as error:
            raise CourseError(f"expected a line of a .ply header, received {quote(line)}.") from error
    if order is None or any(count < 0 for _, count, _ in elements):
        raise CourseError("expected a .ply header with a format and counts, received another.")
    return order, elements, match.end()


class _PlyReader:
    """Reader of the rows of a .ply file's elements, one element after the other."""

    def __init__(self, content: bytes, start: int, order: str) -> None:
        self._content = content
        self._position = start
        self._order = order
        self._words = None if order else iter(content[start:].split())

    def read_rows(self, count: int, properties: list[Property], wanted: list[str], limits: Limits) -> list[list[Any]]:
        """Return the wanted properties of ``count`` rows: numbers, and arrays for lists."""
        rows = []
        num_corners = 0
        try:
            if self._order and not any(list_type for _, _, list_type in properties):
                return self._read_records(count, properties, wanted)
            for _ in range(count):
                row = {name: self._read_value(number_type, list_type) for name, number_type, list_type in properties}
                rows.append([row[name] for name in wanted])
                num_corners += sum(len(value) for value in rows[-1] if isinstance(value, list))
                limits.check_triangles(num_corners // 3)
        except (OverflowError, StopIteration, ValueError) as error:
            if isinstance(error, CourseError):
                raise
            raise CourseError(
                f"expected {count} rows of an element of a .ply file, received fewer or others."
            ) from error
        return rows

    def _read_records(self, count: int, properties: list[Property], wanted: list[str]) -> list[list[Any]]:
        """Return rows of a fixed size."""
        record = np.dtype([(f"{k} {name}", self._order + kind) for k, (name, kind, _) in enumerate(properties)])
        end = self._position + count * record.itemsize
        if end > len(self._content):
            raise ValueError("the file is too short")
        table = np.frombuffer(self._content, record, count, self._position)
        self._position = end
        columns = [table[f"{k} {name}"] for k, (name, _, _) in enumerate(properties) if name in wanted]
        return np.stack(columns, axis=1).tolist() if columns else []

    def _read_value(self, number_type: str, list_type: str) -> Any:
        """Return the next value: a number, or a list of them."""
        if not list_type:
            return self._read_numbers(1, number_type)[0]
        length = int(self._read_numbers(1, list_type)[0])
        return self._read_numbers(length, number_type)

    def _read_numbers(self, count: int, number_type: str) -> list[Any]:
        if self._words is not None:
            if count > len(self._content):
                raise ValueError("a list is longer than the file")
            return [float(next(self._words)) for _ in range(count)]
        dtype = np.dtype(self._order + number_type)
        end = self._position + count * dtype.itemsize
        if count < 0 or end > len(self._content):
            raise ValueError("the file is too short")
        numbers: list[Any] = np.frombuffer(self._content, dtype, count, self._position).tolist()
        self._position = end
        return numbers


def _finite(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vertices, or raise a CourseError if one is not finite."""
    if not np.isfinite(vertices).all():
        row = int((~np.isfinite(vertices)).any(axis=1).argmax())
        raise CourseError(f"expected finite vertices, received {vertices[row].tolist()} for vertex {row}.")
    return vertices
