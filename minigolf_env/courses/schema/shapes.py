"""Outlines in course files: areas in the xy-plane, each the union of simple shapes."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from minigolf_env.courses.schema.record import Degrees, Length, Number, PointXY, Record


class ArcCorner(Record):
    """Corner of a polygon that is reached along a circular arc from the corner before it."""

    via: PointXY
    """Point (x, y) on the arc between the two corners, m."""
    to: PointXY
    """Corner (x, y) at the end of the arc, m."""


def _corner_kind(value: Any) -> str:
    return "arc" if isinstance(value, (dict, ArcCorner)) else "point"


PolygonCorner: TypeAlias = Annotated[
    Annotated[PointXY, Tag("point")] | Annotated[ArcCorner, Tag("arc")], Discriminator(_corner_kind)
]


class OutlineShape(Record):
    """Area in the xy-plane: exactly one of ``polygon``, ``box``, ``circle`` and ``line``."""

    polygon: Annotated[tuple[PolygonCorner, ...], Field(min_length=3, max_length=2000, fail_fast=True)] | None = None
    """Corners (x, y) in order, m. A corner ``{via = [x, y], to = [x, y]}`` is reached along an arc."""
    box: tuple[Number, Number, Number, Number] | None = None
    """Axis-aligned rectangle: smallest x, smallest y, largest x, largest y, m."""
    circle: tuple[Number, Number, Length] | None = None
    """Centre x, centre y and radius, m."""
    line: Annotated[tuple[PointXY, ...], Field(min_length=2, max_length=2000, fail_fast=True)] | None = None
    """Points (x, y) of the centre line of a strip, m. The line must not cross itself."""
    width: Length = 1.0
    """Width of the strip along ``line``, m."""
    round: Annotated[float, Field(strict=True, ge=0.0, le=100.0)] = 0.0
    """Radius that outer corners are rounded to, m."""
    turn: Degrees = 0.0
    """Rotation about the centre of the shape's bounding box, degrees counter-clockwise."""

    @model_validator(mode="after")
    def _check_one_shape(self) -> OutlineShape:
        given = [key for key in ("polygon", "box", "circle", "line") if getattr(self, key) is not None]
        if len(given) != 1:
            raise PydanticCustomError(
                "shape", "expected exactly one of polygon, box, circle and line, received {given}", {"given": given}
            )
        if self.polygon is not None and isinstance(self.polygon[0], ArcCorner):
            raise PydanticCustomError(
                "shape", "expected a polygon that starts with a point, received an arc; put it last"
            )
        return self


OptionalShapes: TypeAlias = Annotated[tuple[OutlineShape, ...], Field(max_length=200, fail_fast=True)]
OutlineShapes: TypeAlias = Annotated[tuple[OutlineShape, ...], Field(min_length=1, max_length=200, fail_fast=True)]
