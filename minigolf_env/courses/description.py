"""The format of course files: what a hole is described by, checked field by field.

The same records build a hole in Python: ``CourseFile(name=..., parts=[Lane(...), ...])``. Metres, seconds, degrees;
"turn" is counter-clockwise seen from above, 0 looks along x.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from minigolf_env.courses.course import EARTH, GOLF_BALL, Material
from minigolf_env.courses.shapes import (
    Colour,
    Height,
    Length,
    Name,
    Number,
    Outline,
    Point2,
    Point3,
    Profile,
    Record,
    Shapes,
    Sides,
    SurfaceRecord,
    Turn,
)


class PartRecord(Record):
    """What all parts share."""

    name: Name | None = None
    surface: Name = "wood"
    """One of the file's surfaces, or felt, slope, wood, stone, brick, track, lining, water."""
    material: Material | None = None
    """What it looks like, if not like its surface."""
    color: Colour | None = None


class Lane(PartRecord):
    """A floor with a border around it; the cup is cut into the lane it lies in."""

    kind: Literal["lane"] = "lane"
    surface: Name = "felt"
    outline: Outline
    """Where the ball rolls."""
    holes: Shapes = ()
    """Where there is no floor, nor a border around."""
    level: Number = 0.0
    heights: Annotated[tuple[Height, ...], Field(max_length=50)] = ()
    """Added to the level."""
    cell: tuple[Length, Length] = (0.05, 0.05)
    """Size of the grid that heights are drawn with, along x and y."""
    thickness: Annotated[float, Field(strict=True, ge=0.123, le=10.0)] = 0.123
    """From the lowest place down; the cup needs its depth and 23 mm."""
    border: Annotated[float, Field(strict=True, ge=0.0, le=10.0)] = 0.12
    """Width; 0: no border."""
    border_height: Length = 0.12
    """Above the floor."""
    border_surface: Name = "wood"
    border_color: Colour | None = None
    gaps: Shapes = ()
    """Where the border is left out."""


class Block(PartRecord):
    """A prism on an outline in plan."""

    kind: Literal["block"] = "block"
    outline: Outline
    holes: Shapes = ()
    bottom: Number = -0.05
    top: Number = 0.12
    inwards: bool = False
    """The ball is inside: a room."""


class Prism(PartRecord):
    """A cross-section that stands upright, drawn out along a line: ramps, roofs, half-pipes."""

    kind: Literal["prism"] = "prism"
    profile: Outline
    """In (to the left of the way, up), from the line."""
    holes: Shapes = ()
    start: Point3
    end: Point3


class Revolved(PartRecord):
    """What a profile sweeps out around an upright axis."""

    kind: Literal["revolved"] = "revolved"
    at: Point2
    profile: Profile
    """(distance from the axis, z), counter-clockwise."""
    sides: Sides = 64


class Box(PartRecord):
    """A box."""

    kind: Literal["box"] = "box"
    at: Point3
    """Its middle."""
    size: tuple[Length, Length, Length]
    turn: Turn = 0.0


class Cylinder(PartRecord):
    """An upright cylinder, or a cone if its top radius is 0."""

    kind: Literal["cylinder"] = "cylinder"
    at: Point3
    """The middle of its foot."""
    radius: Length
    top_radius: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)] | None = None
    height: Length
    sides: Sides = 64


class Sphere(PartRecord):
    """A ball of triangles."""

    kind: Literal["sphere"] = "sphere"
    at: Point3
    radius: Length
    subdivisions: Annotated[int, Field(strict=True, ge=0, le=6)] = 3


class Torus(PartRecord):
    """A ring that lies flat."""

    kind: Literal["torus"] = "torus"
    at: Point3
    major_radius: Length
    minor_radius: Length
    major_sections: Sides = 32
    minor_sections: Sides = 32


class Ramp(PartRecord):
    """A straight slope from a line on the floor up to a height, upright behind."""

    kind: Literal["ramp"] = "ramp"
    surface: Name = "slope"
    start: Point2
    """The middle of its foot."""
    end: Point2
    """Below the middle of its upper edge."""
    width: Length
    height: Length
    level: Number = 0.0


class Tunnel(PartRecord):
    """A house with a gabled roof and an arched tunnel through it."""

    kind: Literal["tunnel"] = "tunnel"
    surface: Name = "brick"
    start: Point2
    """The middle of the entrance."""
    end: Point2
    width: Length
    """Of the house."""
    height: Length
    """Of its walls."""
    roof: Length
    """Height of the gable above the walls."""
    door: Length
    """Width of the tunnel; it is as high to its crown."""
    roof_color: Colour | None = None
    level: Number = 0.0


class HalfPipe(PartRecord):
    """Two curved banks along a line, with a level floor between them."""

    kind: Literal["halfpipe"] = "halfpipe"
    surface: Name = "slope"
    start: Point3
    end: Point3
    radius: Length
    floor: Length
    """Width between the banks."""
    arc: Annotated[float, Field(strict=True, gt=0.0, le=90.0)] = 60.0
    """How steep the banks get, degrees."""
    lip: Length = 0.1
    """Width of the banks' shoulders."""
    sides: Sides = 48
    """Facets of a bank."""


class Loop(PartRecord):
    """A loop-the-loop: a trough with rails that turns over once and comes down beside its start."""

    kind: Literal["loop"] = "loop"
    surface: Name = "track"
    at: Point3
    """The middle of the trough's lowest line, where the ball comes in."""
    turn: Turn = 0.0
    """Where the ball goes."""
    radius: Length
    width: Length
    """Between the rails."""
    shift: Number
    """How far to the left it comes down."""
    rail: Length = 0.06
    thickness: Length = 0.03
    sides: Sides = 256


class Mesh(PartRecord):
    """Triangles from a file beside the course file (.obj .stl .ply .glb), or written out here."""

    kind: Literal["mesh"] = "mesh"
    file: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    vertices: tuple[tuple[float, float, float], ...] | None = None
    faces: tuple[tuple[int, int, int], ...] | None = None
    scale: Length = 1.0
    turn: Turn = 0.0
    at: Point3 = (0.0, 0.0, 0.0)
    """Where its origin goes, after scale and turn."""
    inwards: bool = False
    """The ball is inside it: a room."""
    floor: bool = False
    """The cup is cut into its level top."""

    @model_validator(mode="after")
    def _one_source(self) -> Mesh:
        if (self.file is None) == (self.vertices is None) or (self.vertices is None) != (self.faces is None):
            raise PydanticCustomError("mesh", "expected either file, or both vertices and faces")
        return self


AnyPart: TypeAlias = Annotated[
    Lane | Block | Prism | Revolved | Box | Cylinder | Sphere | Torus | Ramp | Tunnel | HalfPipe | Loop | Mesh,
    Field(discriminator="kind"),
]


class TeeRecord(Record):
    """Where the ball starts: a point, or anywhere in a box."""

    at: Point2 | None = None
    lower: Point2 | None = None
    upper: Point2 | None = None
    height: Number = 0.0
    """Level of the floor there."""

    @model_validator(mode="after")
    def _one_place(self) -> TeeRecord:
        if (self.at is None) == (self.lower is None) or (self.lower is None) != (self.upper is None):
            raise PydanticCustomError("tee", "expected either at, or both lower and upper")
        return self


class CupRecord(Record):
    """The hole to play."""

    position: Point3
    radius: Length = 0.054
    depth: Length = 0.10
    surface: Name = "lining"
    cut: bool = False
    """The parts have the cup in them already."""


class CourseFile(Record):
    """A hole, as a course file describes it."""

    name: Name
    par: Annotated[int, Field(strict=True, ge=1, le=100)] | None = None
    about: Annotated[str, Field(max_length=500)] = ""
    """What makes it fun, in a sentence."""
    top_speed: Annotated[float, Field(strict=True, gt=0.0, le=1000.0)] = 6.0
    """Launch speed of a full putt, m/s."""
    ball_radius: Length = GOLF_BALL
    gravity: Point3 = EARTH
    bounds: tuple[Point3, Point3] | None = None
    """Where the ball is in play; left out: over the lanes and their borders, from 0.3 m below to 2 m above."""
    route: Annotated[tuple[Point2, ...], Field(max_length=200)] = ()
    """Corners of the way of play between tee and cup."""
    tee: TeeRecord
    cup: CupRecord | None = None
    surfaces: Annotated[dict[Name, SurfaceRecord], Field(max_length=100, default_factory=dict)]
    parts: Annotated[tuple[AnyPart, ...], Field(min_length=1, max_length=500)]
    hole_in_one: tuple[Number, Number] | None = None
    """A known one from the middle of the tee: an action, direction and share of the top speed."""
