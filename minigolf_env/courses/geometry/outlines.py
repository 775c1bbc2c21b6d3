"""Shapely polygons, in metres in the xy-plane, from the outlines of a course file."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any

import shapely
from shapely.affinity import rotate

from minigolf_env.courses.course import CourseError, Point2
from minigolf_env.courses.geometry.solids import ShapelyPolygon, circle_polygon
from minigolf_env.courses.schema.shapes import ArcCorner, OutlineShape

MAX_ARC_STEP = 5.0
"""Largest angle of the segments of an arc, degrees: that of a solid of revolution with 72 sides."""

MAX_OUTLINE_CORNERS = 20_000
"""Largest number of corners of an outline, before and after its shapes are joined."""


def build_outline(shapes: Sequence[OutlineShape], holes: Sequence[OutlineShape] = ()) -> ShapelyPolygon:
    """Return the union of the shapes, without the holes.

    Raises:
        CourseError: the area is empty, in several pieces, or crosses itself.
    """
    area = join_shapes(shapes) - join_shapes(holes) if holes else join_shapes(shapes)
    if area.geom_type != "Polygon" or area.is_empty:
        raise CourseError(
            f"outline: expected one connected area, received {area.geom_type} of {area.area:g} m^2; "
            "let its shapes overlap, and leave something of it next to its holes."
        )
    return area


def join_shapes(shapes: Sequence[OutlineShape]) -> Any:
    """Return the union of shapes, in one piece or several; a single shape is returned unchanged."""
    polygons = [_build_polygon(shape) for shape in shapes]
    _check_corners(polygons)
    area = polygons[0] if len(polygons) == 1 else shapely.union_all(polygons)
    _check_corners([area])
    return area


def _check_corners(polygons: Sequence[ShapelyPolygon]) -> None:
    """Raise a CourseError if polygons have too many corners: later steps take time quadratic in their number."""
    corners = int(shapely.get_num_coordinates(polygons).sum())
    if corners > MAX_OUTLINE_CORNERS:
        raise CourseError(f"outline: expected at most {MAX_OUTLINE_CORNERS} corners, received {corners}; simplify it.")


def _build_polygon(shape: OutlineShape) -> ShapelyPolygon:
    if shape.polygon is not None:
        area = shapely.Polygon(_corner_points(shape.polygon))
    elif shape.box is not None:
        area = shapely.box(*shape.box)
    elif shape.circle is not None:
        x, y, radius = shape.circle
        area = circle_polygon((x, y), radius)
    else:
        line = shapely.LineString(shape.line)
        # Each crossing adds corners to the outline, and a line of 2,000 points can cross itself a million times.
        if not line.is_simple:
            raise CourseError("outline: expected a line that does not cross itself; divide it into several.")
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


def _corner_points(corners: Sequence[Point2 | ArcCorner]) -> list[Point2]:
    points: list[Point2] = []
    for corner in corners:
        if isinstance(corner, ArcCorner):
            points += _arc_points(points[-1], corner.via, corner.to)
        else:
            points.append(corner)
    return points


def _arc_points(start: Point2, via: Point2, end: Point2) -> list[Point2]:
    """Return points on the circle through three points, after the first and up to the last.

    The arithmetic is that of Python's complex numbers, because the last bits of numpy's angles and products depend on
    the processor.
    """
    a, b, c = (complex(*point) for point in (start, via, end))
    slant = (c - a) / (b - a) if a != b else 0.0
    if abs(complex(slant).imag) < 1e-9:
        raise CourseError(f"arc: expected three points of a circle, received {start}, {via}, {end}; move `via` aside.")
    # Find the centre p in coordinates where a is 0, b is 1 and c is w. |p| = |p - 1| gives p + conj(p) = 1, and
    # |p| = |p - w| gives p conj(w) + conj(p) w = |w|^2. Together p (w - conj(w)) = w - |w|^2.
    w = complex(slant)
    center = a + (b - a) * (w - abs(w) ** 2) / (2j * w.imag)
    # Find the signed angle of the arc: the one that passes the point `via`.
    angle = cmath.phase((c - center) / (a - center))
    angle_via = cmath.phase((b - center) / (a - center))
    if (angle > 0) != (angle_via > 0) or abs(angle_via) > abs(angle):
        angle -= math.copysign(2.0 * math.pi, angle)
    steps = max(2, math.ceil(abs(math.degrees(angle)) / MAX_ARC_STEP))
    points = [center + (a - center) * cmath.rect(1.0, angle * k / steps) for k in range(1, steps)]
    return [*((point.real, point.imag) for point in points), end]
