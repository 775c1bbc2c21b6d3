"""Outlines in plan from what a course file says of them; shapely polygons, metres."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any

import shapely
from shapely.affinity import rotate

from minigolf_env.courses.course import CourseError, Point2
from minigolf_env.courses.shapes import Arc, Shape
from minigolf_env.courses.solids import Outline, disc

ARC = 5.0
"""Turn of an arc's pieces, degrees: what a solid of revolution with 72 sides has."""


MOST_CORNERS = 20_000
"""Of an outline, before and after its shapes are put together."""


def outline(shapes: Sequence[Shape], holes: Sequence[Shape] = ()) -> Outline:
    """Return the area that any of the shapes covers, less the holes.

    Raises:
        CourseError: the area is empty, in several pieces, or crosses itself.
    """
    area = union(shapes) - union(holes) if holes else union(shapes)
    if area.geom_type != "Polygon" or area.is_empty:
        raise CourseError(
            f"outline: expected one connected area, received {area.geom_type} of {area.area:g} m^2; "
            "let its shapes overlap, and leave something of it beside its holes."
        )
    return area


def union(shapes: Sequence[Shape]) -> Any:
    """Return the area that any of the shapes covers, in one piece or several; a single shape as it is."""
    polygons = [_polygon(shape) for shape in shapes]
    _check_corners(polygons)
    area = polygons[0] if len(polygons) == 1 else shapely.union_all(polygons)
    _check_corners([area])
    return area


def _check_corners(polygons: Sequence[Outline]) -> None:
    """Raise a CourseError if polygons have too many corners: what is made of them takes the square of that in time."""
    corners = int(shapely.get_num_coordinates(polygons).sum())
    if corners > MOST_CORNERS:
        raise CourseError(f"outline: expected at most {MOST_CORNERS} corners, received {corners}; simplify it.")


def _polygon(shape: Shape) -> Outline:
    if shape.polygon is not None:
        area = shapely.Polygon(_points(shape.polygon))
    elif shape.box is not None:
        area = shapely.box(*shape.box)
    elif shape.circle is not None:
        x, y, radius = shape.circle
        area = disc((x, y), radius)
    else:
        line = shapely.LineString(shape.line)
        if not line.is_simple:  # Each crossing would be two holes' corners: of 2,000 points there are a million.
            raise CourseError("outline: expected a line that does not cross itself; part it into several.")
        area = line.buffer(0.5 * shape.width, cap_style="flat", join_style="mitre")
    if shape.round:
        area = area.buffer(-shape.round).buffer(shape.round, quad_segs=18)
    if shape.turn:
        area = rotate(area, shape.turn)
    if not area.is_valid or area.is_empty:
        raise CourseError(
            f"outline: expected a simple shape with an area, received {shapely.is_valid_reason(area)}; "
            "list its corners in order around it."
        )
    return area


def _points(corners: Sequence[Point2 | Arc]) -> list[Point2]:
    points: list[Point2] = []
    for corner in corners:
        if isinstance(corner, Arc):
            points += _arc(points[-1], corner.via, corner.to)
        else:
            points.append(corner)
    return points


def _arc(start: Point2, via: Point2, end: Point2) -> list[Point2]:
    """Return points on the circle through three points, after the first and up to the last."""
    a, b, c = (complex(*point) for point in (start, via, end))
    slant = (c - a) / (b - a) if a != b else 0.0
    if abs(complex(slant).imag) < 1e-9:
        raise CourseError(f"arc: expected three points of a circle, received {start}, {via}, {end}; move `via` aside.")
    # The centre in coordinates where a is 0 and b is 1 (a known closed form of the circumcentre).
    w = complex(slant)
    centre = a + (b - a) * (w - abs(w) ** 2) / (2j * w.imag)
    # By Python's complex numbers: the last bits of numpy's angles and products depend on the processor.
    turn = cmath.phase((c - centre) / (a - centre))
    over = cmath.phase((b - centre) / (a - centre))
    if (turn > 0) != (over > 0) or abs(over) > abs(turn):
        turn -= math.copysign(2.0 * math.pi, turn)
    steps = max(2, math.ceil(abs(math.degrees(turn)) / ARC))
    points = [centre + (a - centre) * cmath.rect(1.0, turn * k / steps) for k in range(1, steps)]
    return [*((point.real, point.imag) for point in points), end]
