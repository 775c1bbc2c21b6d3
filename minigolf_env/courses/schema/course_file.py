"""Top level of a course file: tee, cup, surfaces and parts.

The same records describe a hole in Python: ``CourseFile(name=..., parts=[LanePart(...), ...])``.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from minigolf_env.courses.course import EARTH_GRAVITY, GOLF_BALL_RADIUS
from minigolf_env.courses.schema.parts import AnyPart
from minigolf_env.courses.schema.record import Length, NameField, Number, PointXY, PointXYZ, Record
from minigolf_env.courses.schema.surfaces import SurfaceRecord


class TeeRecord(Record):
    """Start of the ball: a point (``at``), or a random point of a box (``lower`` and ``upper``)."""

    at: PointXY | None = None
    """Start (x, y) of the ball, m."""
    lower: PointXY | None = None
    """Corner (x, y) of the tee box with the smallest x and y, m."""
    upper: PointXY | None = None
    """Corner (x, y) of the tee box with the largest x and y, m."""
    height: Number = 0.0
    """Level z of the floor below the tee, m."""

    @model_validator(mode="after")
    def _check_one_place(self) -> TeeRecord:
        if (self.at is None) == (self.lower is None) or (self.lower is None) != (self.upper is None):
            raise PydanticCustomError("tee", "expected either at, or both lower and upper")
        return self


class CupRecord(Record):
    """Cup that the ball is played into."""

    position: PointXYZ
    """Centre (x, y, z) of the rim, on the level of the floor, m."""
    radius: Length = 0.054
    """Radius, m. The default is that of the rules of golf."""
    depth: Length = 0.10
    """Depth from the rim to the bottom, m."""
    surface: NameField = "lining"
    """Surface of the cup's wall and bottom."""
    cut: bool = False
    """True if the parts contain the cup already, so that none is cut."""


class CourseFile(Record):
    """Content of a course file: one hole."""

    name: NameField
    """Name of the course."""
    par: Annotated[int, Field(strict=True, ge=1, le=100)] | None = None
    """Rounded mean number of strokes of a good player. A TOML file with a cup must give it; in .glb files and
    CourseBuilder it is then 2 by default."""
    about: Annotated[str, Field(max_length=500)] = ""
    """Description of the hole in one sentence, for lists of courses."""
    top_speed: Annotated[float, Field(strict=True, gt=0.0, le=1000.0)] = 6.0
    """Launch speed of a full putt, m/s."""
    ball_radius: Length = GOLF_BALL_RADIUS
    """Radius of the ball, m."""
    gravity: PointXYZ = EARTH_GRAVITY
    """Gravitational acceleration (x, y, z), m/s^2."""
    bounds: tuple[PointXYZ, PointXYZ] | None = None
    """Lower and upper corner (x, y, z) of the box outside which the ball is out of bounds, m. Default: the lanes and
    their borders, from 0.3 m below the lowest ``level`` to 2 m above the highest, and at least all parts."""
    route: Annotated[tuple[PointXY, ...], Field(max_length=200, fail_fast=True)] = ()
    """Corners (x, y) of the route from the tee to the cup, m."""
    tee: TeeRecord
    """Start of the ball."""
    cup: CupRecord | None = None
    """Cup. In a course without one the ball is only thrown (free-throw mode)."""
    surfaces: Annotated[dict[NameField, SurfaceRecord], Field(max_length=100, default_factory=dict)]
    """Surfaces by name, in addition to the built-in ones or in their place."""
    parts: Annotated[tuple[AnyPart, ...], Field(min_length=1, max_length=500)]
    """Solids that the course is made of."""
    hole_in_one: tuple[Number, Number] | None = None
    """Action that holes out from the middle of the tee: the putt's x and y components, as fractions of the top
    speed."""
