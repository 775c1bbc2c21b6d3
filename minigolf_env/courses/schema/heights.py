"""Heights of lanes that are not level: hills, slopes and waves that are added up."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from minigolf_env.courses.schema.record import Degrees, Length, Number, PointXY, Record

ProfilePoints: TypeAlias = Annotated[tuple[PointXY, ...], Field(min_length=2, max_length=500, fail_fast=True)]


def _check_order(profile: tuple[PointXY, ...]) -> tuple[PointXY, ...]:
    for (before, _), (after, _) in itertools.pairwise(profile):
        if after < before:
            raise PydanticCustomError(
                "order",
                "expected distances that grow, received {after} after {before}; sort the points",
                {"before": before, "after": after},
            )
    return profile


HeightProfile: TypeAlias = Annotated[ProfilePoints, AfterValidator(_check_order)]


class RadialHeight(Record):
    """Round hill or hollow: a height for each distance from a centre."""

    kind: Literal["radial"] = "radial"
    """Selects this kind of height."""
    at: PointXY
    """Centre (x, y), m."""
    profile: HeightProfile
    """Points (distance from the centre, height) in order of distance, m. Beyond both ends the height is constant."""
    rounding: Annotated[float, Field(strict=True, ge=0.0, le=10.0)] = 0.0
    """Length before and after each corner of the profile over which the corner is rounded, m."""


class DirectionalHeight(Record):
    """Slope, ridge or valley: a height for each distance along a direction."""

    kind: Literal["along"] = "along"
    """Selects this kind of height."""
    at: PointXY = (0.0, 0.0)
    """Point (x, y) from which distance is measured, m."""
    turn: Degrees = 0.0
    """Direction in which distance is measured, degrees counter-clockwise from x."""
    profile: HeightProfile
    """Points (distance, height) in order of distance, m. Beyond both ends the height is constant."""
    rounding: Annotated[float, Field(strict=True, ge=0.0, le=10.0)] = 0.0
    """Length before and after each corner of the profile over which the corner is rounded, m."""


class WaveHeight(Record):
    """Sine wave along a direction."""

    kind: Literal["waves"] = "waves"
    """Selects this kind of height."""
    at: PointXY = (0.0, 0.0)
    """Point (x, y) at which the wave has phase 0, m."""
    turn: Degrees = 0.0
    """Direction of the wave, degrees counter-clockwise from x."""
    amplitude: Annotated[float, Field(strict=True, ge=-10.0, le=10.0)]
    """Amplitude of the wave, m."""
    length: Length
    """Wavelength, m."""
    level: Annotated[tuple[tuple[Number, Number, Number, Number], ...], Field(max_length=50, fail_fast=True)] = ()
    """Circles without waves: centre x, centre y, radius inside which the ground is level, larger radius from which the
    waves have their full amplitude, m."""

    @model_validator(mode="after")
    def _check_radii(self) -> WaveHeight:
        if any(inner >= outer for _, _, inner, outer in self.level):
            raise PydanticCustomError("level", "level: expected an inner radius smaller than the outer")
        return self


AnyHeight: TypeAlias = Annotated[RadialHeight | DirectionalHeight | WaveHeight, Field(discriminator="kind")]
