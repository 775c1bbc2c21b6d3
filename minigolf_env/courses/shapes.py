"""What descriptions of holes are made of: numbers, shapes in plan, heights and surfaces, checked field by field.

Metres and degrees; "turn" is counter-clockwise seen from above, 0 looks along x.
"""

from __future__ import annotations

import difflib
import itertools
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from minigolf_env.courses.course import Material

Number: TypeAlias = Annotated[float, Field(strict=True, ge=-1000.0, le=1000.0, allow_inf_nan=False)]
Length: TypeAlias = Annotated[float, Field(strict=True, gt=0.0, le=1000.0, allow_inf_nan=False)]
Share: TypeAlias = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
Point2: TypeAlias = tuple[Number, Number]
Point3: TypeAlias = tuple[Number, Number, Number]
Name: TypeAlias = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.-]{0,63}$")]
Colour: TypeAlias = Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$", description="Such as #c03020.")]
Sides: TypeAlias = Annotated[int, Field(strict=True, ge=3, le=512)]
Turn: TypeAlias = Annotated[float, Field(strict=True, ge=-360.0, le=360.0)]


class Record(BaseModel):
    """What all records share: unknown keys are errors that guess which was meant."""

    # Built when first used: of the parts of a description no checker is needed but the whole's.
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for key in data:
                if key not in cls.model_fields:
                    close = difflib.get_close_matches(str(key), cls.model_fields, n=1)
                    hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(cls.model_fields)}."
                    raise PydanticCustomError(
                        "unknown_key", "{message}", {"message": f"unknown key {key!r:.60}; {hint}"}
                    )
        return data


class Arc(Record):
    """A corner of a polygon reached along a circle."""

    via: Point2
    """A point on the way, m."""
    to: Point2
    """The corner, m."""


def _corner_kind(value: Any) -> str:
    return "arc" if isinstance(value, (dict, Arc)) else "point"


Corner: TypeAlias = Annotated[Annotated[Point2, Tag("point")] | Annotated[Arc, Tag("arc")], Discriminator(_corner_kind)]


class Shape(Record):
    """An area in plan: exactly one of polygon, box, circle and line."""

    polygon: Annotated[tuple[Corner, ...], Field(min_length=3, max_length=2000)] | None = None
    """Corners in order; {via, to} comes along an arc."""
    box: tuple[Number, Number, Number, Number] | None = None
    """Least x, least y, largest x, largest y."""
    circle: tuple[Number, Number, Length] | None = None
    """Middle and radius."""
    line: Annotated[tuple[Point2, ...], Field(min_length=2, max_length=2000)] | None = None
    """The middle of a strip; ``width`` says how wide."""
    width: Length = 1.0
    """Of a line."""
    round: Annotated[float, Field(strict=True, ge=0.0, le=100.0)] = 0.0
    """Radius that outer corners are rounded to."""
    turn: Turn = 0.0
    """About the shape's middle."""

    @model_validator(mode="after")
    def _one_kind(self) -> Shape:
        given = [key for key in ("polygon", "box", "circle", "line") if getattr(self, key) is not None]
        if len(given) != 1:
            raise PydanticCustomError(
                "shape", "expected exactly one of polygon, box, circle and line, received {given}", {"given": given}
            )
        if self.polygon is not None and isinstance(self.polygon[0], Arc):
            raise PydanticCustomError(
                "shape", "expected a polygon that starts with a point, received an arc; put it last"
            )
        return self


Shapes: TypeAlias = Annotated[tuple[Shape, ...], Field(max_length=200)]
Outline: TypeAlias = Annotated[tuple[Shape, ...], Field(min_length=1, max_length=200)]
Profile: TypeAlias = Annotated[tuple[Point2, ...], Field(min_length=2, max_length=500)]


def _in_order(profile: tuple[Point2, ...]) -> tuple[Point2, ...]:
    for (before, _), (after, _) in itertools.pairwise(profile):
        if after < before:
            raise PydanticCustomError(
                "order",
                "expected distances that grow, received {after} after {before}; sort the points",
                {"before": before, "after": after},
            )
    return profile


Heights: TypeAlias = Annotated[Profile, AfterValidator(_in_order)]


class Radial(Record):
    """Hills and hollows that are round in plan: a height for each distance from the middle."""

    kind: Literal["radial"] = "radial"
    at: Point2
    profile: Heights
    """(distance, height) from the middle outwards; beyond its ends the height stays."""
    rounding: Annotated[float, Field(strict=True, ge=0.0, le=10.0)] = 0.0
    """Corners of the profile are rounded so far to either side."""


class Along(Record):
    """Slopes, ridges and valleys: a height for each distance along a direction."""

    kind: Literal["along"] = "along"
    at: Point2 = (0.0, 0.0)
    turn: Turn = 0.0
    profile: Heights
    """(distance, height) in order; beyond its ends the height stays."""
    rounding: Annotated[float, Field(strict=True, ge=0.0, le=10.0)] = 0.0


class Waves(Record):
    """Undulation along a direction."""

    kind: Literal["waves"] = "waves"
    at: Point2 = (0.0, 0.0)
    turn: Turn = 0.0
    amplitude: Annotated[float, Field(strict=True, ge=-10.0, le=10.0)]
    length: Length
    level: Annotated[tuple[tuple[Number, Number, Number, Number], ...], Field(max_length=50)] = ()
    """Places without waves: x, y, radius that is level, larger radius from where the waves are whole."""

    @model_validator(mode="after")
    def _growing(self) -> Waves:
        if any(inner >= outer for _, _, inner, outer in self.level):
            raise PydanticCustomError("level", "level: expected an inner radius smaller than the outer")
        return self


Height: TypeAlias = Annotated[Radial | Along | Waves, Field(discriminator="kind")]


class SurfaceRecord(Record):
    """How something plays and what it looks like."""

    damping: Share = 0.7
    """Share of velocity that an impact keeps."""
    restitution: Share | None = None
    """Of the normal velocity alone; damping unless given."""
    tangential: Share | None = None
    """Of the tangential velocity alone; damping unless given."""
    rolling: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)] | None = None
    """Rolling resistance; or give ``stimp``."""
    stimp: Annotated[float, Field(strict=True, gt=0.0, le=1000.0)] | None = None
    """Speed of a green, feet on a stimpmeter: 8 slow, 12 fast."""
    material: Material = "wood"
    color: Colour | None = None
