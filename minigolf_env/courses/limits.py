"""How large a course file and what it describes may be: a hostile one is refused before it costs memory."""

from __future__ import annotations

import math
from dataclasses import dataclass

from minigolf_env.courses.course import CourseError


@dataclass(frozen=True)
class Limits:
    """Bounds on course files; larger ones are taken when asked for."""

    file_bytes: int = 64_000_000
    """Of one .glb or mesh file."""
    text_bytes: int = 16_000_000
    """Of one .toml, .obj, .ply or text .stl file, which take a hundred times their size while they are read, and of the
    JSON in a .glb file."""
    triangles: int = 500_000
    """Of a whole course."""
    cells: int = 200_000
    """Of the grid of one lane with heights; two triangles each."""

    def check_triangles(self, count: int) -> None:
        """Raise a CourseError if a course would have more triangles."""
        if count > self.triangles:
            raise CourseError(
                f"expected at most {self.triangles} triangles in a course, received {count}; "
                "simplify its meshes, or load it with limits=Limits(triangles=...)."
            )

    def check_bytes(self, what: str, size: int, text: bool = False) -> None:
        """Raise a CourseError if a file is larger."""
        limit = self.text_bytes if text else self.file_bytes
        if size > limit:
            raise CourseError(
                f"{what}: expected at most {limit} bytes, received {size}; "
                f"simplify it, or load it with limits=Limits({'text' if text else 'file'}_bytes=...)."
            )

    def check_cells(self, box: tuple[float, float, float, float], cell: tuple[float, float]) -> None:
        """Raise a CourseError if a grid of a cell's size (m) over a box (left, low, right, high) has more cells."""
        columns, rows = (
            math.ceil(side / size) for side, size in zip((box[2] - box[0], box[3] - box[1]), cell, strict=True)
        )
        seam = 2 * (columns + rows) * max(cell) / min(cell)
        if columns * rows + seam > self.cells:
            raise CourseError(
                f"cell: expected at most {self.cells} cells, received {columns} x {rows}; "
                "enlarge `cell`, or load it with limits=Limits(cells=...)."
            )
