"""Limits on the size of course files, so that a hostile file is rejected before it costs memory or time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from minigolf_env.courses.course import CourseError

MAX_COURSE_COORDINATE = 1000.0
"""Largest coordinate in a course file or a mesh file, m."""


@dataclass(frozen=True)
class Limits:
    """Limits on course files; pass larger ones to ``load_course`` to load larger files."""

    file_bytes: int = 64_000_000
    """Largest size of a .glb file or a mesh file, bytes."""
    text_bytes: int = 16_000_000
    """Largest size of a .toml, .obj, .ply or text .stl file and of the JSON in a .glb file, bytes.

    Parsing text takes about a hundred times the size of the file in memory.
    """
    triangles: int = 500_000
    """Largest number of triangles in a course."""
    cells: int = 200_000
    """Largest number of cells in the grid of a lane with heights; each cell is two triangles."""

    def check_triangles(self, count: int) -> None:
        """Raise a CourseError if a course would have more triangles than the limit."""
        if count > self.triangles:
            raise CourseError(
                f"expected at most {self.triangles} triangles in a course, received {count}; "
                "simplify its meshes, or load it with limits=Limits(triangles=...)."
            )

    def check_bytes(self, what: str, size: int, text: bool = False) -> None:
        """Raise a CourseError if a file is larger than the limit."""
        limit = self.text_bytes if text else self.file_bytes
        if size > limit:
            raise CourseError(
                f"{what}: expected at most {limit} bytes, received {size}; "
                f"simplify it, or load it with limits=Limits({'text' if text else 'file'}_bytes=...)."
            )

    def check_cells(self, box: tuple[float, float, float, float], cell: tuple[float, float]) -> None:
        """Raise a CourseError if a grid has more cells than the limit.

        Args:
            box: the grid's bounding box (min x, min y, max x, max y), m.
            cell: the size of a cell along x and y, m.
        """
        columns = float(np.ceil((box[2] - box[0]) / cell[0]))  # Infinite for the smallest numbers.
        rows = float(np.ceil((box[3] - box[1]) / cell[1]))
        # The triangles between the cells and the outline are as narrow as the cells.
        seam = 2 * (columns + rows) * max(cell) / min(cell)
        if columns * rows + seam > self.cells:
            raise CourseError(
                f"cell: expected at most {self.cells} cells, received {columns:.0f} x {rows:.0f}; "
                "enlarge `cell`, or load it with limits=Limits(cells=...)."
            )
