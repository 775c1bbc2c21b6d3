"""Parts of course files: one record for each kind of solid.

Lengths are in metres. Angles are in degrees, counter-clockwise seen from above, with 0 along x.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from minigolf_env.courses.course import Material
from minigolf_env.courses.schema.heights import AnyHeight, ProfilePoints
from minigolf_env.courses.schema.record import (
    Degrees,
    HexColor,
    Length,
    NameField,
    Number,
    NumSides,
    PointXY,
    PointXYZ,
    Record,
)
from minigolf_env.courses.schema.shapes import OptionalShapes, OutlineShapes


class PartRecord(Record):
    """Keys that every kind of part has."""

    name: NameField | None = None
    """Name of the part. Default: its kind and its position in the list."""
    surface: NameField = "wood"
    """Surface of the part: one that the file describes, or a built-in one (felt, slope, track, wood, stone, brick,
    roof, water, lining)."""
    material: Material | None = None
    """Texture the part is drawn with. Default: that of its surface."""
    color: HexColor | None = None
    """Colour the texture is tinted with, such as "#c03020". Default: that of its surface."""


class LanePart(PartRecord):
    """Floor with a border around it. The cup is cut into the lane that contains it."""

    kind: Literal["lane"] = "lane"
    """Selects this kind of part."""
    surface: NameField = "felt"
    """Surface of the floor."""
    outline: OutlineShapes
    """Area the ball rolls on."""
    holes: OptionalShapes = ()
    """Areas without floor; the border does not follow their edges."""
    level: Number = 0.0
    """Level z of the floor, m."""
    heights: Annotated[tuple[AnyHeight, ...], Field(max_length=50, fail_fast=True)] = ()
    """Heights that are added to the level."""
    cell: tuple[Length, Length] = (0.05, 0.05)
    """Size of the cells of the grid that a floor with heights is made of, along x and y, m."""
    thickness: Annotated[float, Field(strict=True, ge=0.123, le=10.0)] = 0.123
    """Thickness of the floor below its lowest point, m. The cup needs its depth and 23 mm."""
    border: Annotated[float, Field(strict=True, ge=0.0, le=10.0)] = 0.12
    """Width of the border, m; 0 for no border."""
    border_height: Length = 0.12
    """Height of the border above the floor, m."""
    border_surface: NameField = "wood"
    """Surface of the border."""
    border_color: HexColor | None = None
    """Colour the border is tinted with. Default: that of its surface."""
    gaps: OptionalShapes = ()
    """Areas in which the border is left out."""


class BlockPart(PartRecord):
    """Upright prism over an outline."""

    kind: Literal["block"] = "block"
    """Selects this kind of part."""
    outline: OutlineShapes
    """Cross-section in the xy-plane."""
    holes: OptionalShapes = ()
    """Areas that are cut out of the outline."""
    bottom: Number = -0.05
    """Level z of the bottom, m."""
    top: Number = 0.12
    """Level z of the top, m."""
    inwards: bool = False
    """True if the ball is inside the block, as in a room."""


class PrismPart(PartRecord):
    """Upright cross-section extruded along a line: ramps, roofs, half-pipes."""

    kind: Literal["prism"] = "prism"
    """Selects this kind of part."""
    profile: OutlineShapes
    """Cross-section in coordinates (to the left of the direction from start to end, up), relative to the line, m."""
    holes: OptionalShapes = ()
    """Areas that are cut out of the profile."""
    start: PointXYZ
    """Start (x, y, z) of the line, m."""
    end: PointXYZ
    """End (x, y, z) of the line, m."""


class RevolvedPart(PartRecord):
    """Solid of revolution around a vertical axis."""

    kind: Literal["revolved"] = "revolved"
    """Selects this kind of part."""
    at: PointXY
    """Position (x, y) of the axis, m."""
    profile: ProfilePoints
    """Points (distance from the axis, z) of the half cross-section, counter-clockwise, m."""
    sides: NumSides = 64
    """Number of sides of the solid."""


class BoxPart(PartRecord):
    """Box."""

    kind: Literal["box"] = "box"
    """Selects this kind of part."""
    at: PointXYZ
    """Centre (x, y, z), m."""
    size: tuple[Length, Length, Length]
    """Lengths of the edges along the box's own x, y and z axes, m."""
    turn: Degrees = 0.0
    """Rotation about the vertical axis, degrees counter-clockwise."""


class CylinderPart(PartRecord):
    """Upright cylinder, or a cone if its top radius is 0."""

    kind: Literal["cylinder"] = "cylinder"
    """Selects this kind of part."""
    at: PointXYZ
    """Centre (x, y, z) of the bottom, m."""
    radius: Length
    """Radius of the bottom, m."""
    top_radius: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)] | None = None
    """Radius of the top, m. Default: that of the bottom."""
    height: Length
    """Height, m."""
    sides: NumSides = 64
    """Number of sides of the solid."""


class SpherePart(PartRecord):
    """Sphere of triangles (an icosphere)."""

    kind: Literal["sphere"] = "sphere"
    """Selects this kind of part."""
    at: PointXYZ
    """Centre (x, y, z), m."""
    radius: Length
    """Radius, m."""
    subdivisions: Annotated[int, Field(strict=True, ge=0, le=6)] = 3
    """Number of times each triangle of an icosahedron is divided into four."""


class TorusPart(PartRecord):
    """Ring that lies flat."""

    kind: Literal["torus"] = "torus"
    """Selects this kind of part."""
    at: PointXYZ
    """Centre (x, y, z), m."""
    major_radius: Length
    """Distance from the centre to the middle of the tube, m."""
    minor_radius: Length
    """Radius of the tube, m."""
    major_sections: NumSides = 32
    """Number of sections around the ring."""
    minor_sections: NumSides = 32
    """Number of sides of the tube."""


class RampPart(PartRecord):
    """Straight slope from a line on the floor up to a height, with an upright back."""

    kind: Literal["ramp"] = "ramp"
    """Selects this kind of part."""
    surface: NameField = "slope"
    """Surface of the ramp."""
    start: PointXY
    """Middle (x, y) of the lower edge, m."""
    end: PointXY
    """Point (x, y) below the middle of the upper edge, m."""
    width: Length
    """Width across the direction of the slope, m."""
    height: Length
    """Height of the upper edge above the floor, m."""
    level: Number = 0.0
    """Level z of the floor, m."""


class TunnelPart(PartRecord):
    """House with a gabled roof and an arched tunnel through it."""

    kind: Literal["tunnel"] = "tunnel"
    """Selects this kind of part."""
    surface: NameField = "brick"
    """Surface of the walls; the roof has the surface "roof"."""
    start: PointXY
    """Middle (x, y) of the entrance, m."""
    end: PointXY
    """Middle (x, y) of the exit, m."""
    width: Length
    """Width of the house, m."""
    height: Length
    """Height of the walls, m."""
    roof: Length
    """Height of the gable above the walls, m."""
    door: Length
    """Width of the tunnel and its height at the crown, m."""
    roof_color: HexColor | None = None
    """Colour the roof is tinted with. Default: that of its surface."""
    level: Number = 0.0
    """Level z of the floor, m."""


class HalfPipePart(PartRecord):
    """Two curved banks along a line, with a level floor between them."""

    kind: Literal["halfpipe"] = "halfpipe"
    """Selects this kind of part."""
    surface: NameField = "slope"
    """Surface of the banks."""
    start: PointXYZ
    """Start (x, y, z) of the centre line, on the floor, m."""
    end: PointXYZ
    """End (x, y, z) of the centre line, on the floor, m."""
    radius: Length
    """Radius of the banks, m."""
    floor: Length
    """Width of the floor between the banks, m."""
    arc: Annotated[float, Field(strict=True, gt=0.0, le=90.0)] = 60.0
    """Slope of the banks at their upper edges, degrees."""
    lip: Length = 0.1
    """Width of the level shoulders on top of the banks, m."""
    sides: NumSides = 48
    """Number of facets of each bank."""


class LoopPart(PartRecord):
    """Loop-the-loop: a trough with rails that turns over once and comes down next to its start."""

    kind: Literal["loop"] = "loop"
    """Selects this kind of part."""
    surface: NameField = "track"
    """Surface of the trough."""
    at: PointXYZ
    """Middle (x, y, z) of the trough where the ball enters, at its lowest point, m."""
    turn: Degrees = 0.0
    """Direction in which the ball enters, degrees counter-clockwise from x."""
    radius: Length
    """Radius of the loop, m."""
    width: Length
    """Width of the trough between the rails, m."""
    shift: Number
    """Distance to the left by which the exit is displaced from the entrance, m."""
    rail: Length = 0.06
    """Height of the rails, m."""
    thickness: Length = 0.03
    """Thickness of the trough and its rails, m."""
    sides: NumSides = 256
    """Number of facets around the loop. Each facet the ball rolls onto costs a little speed."""


class MeshPart(PartRecord):
    """Closed triangle mesh: a file below the course file's folder, or vertices and faces in the course file."""

    kind: Literal["mesh"] = "mesh"
    """Selects this kind of part."""
    file: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Path of a .obj, .stl, .ply or .glb file, relative to the course file's folder."""
    vertices: Annotated[tuple[tuple[float, float, float], ...], Field(fail_fast=True)] | None = None
    """Vertices (x, y, z), m; instead of ``file``."""
    faces: Annotated[tuple[tuple[int, int, int], ...], Field(fail_fast=True)] | None = None
    """Triangles as indices of vertices, from 0; with ``vertices``."""
    scale: Length = 1.0
    """Factor that all coordinates are multiplied by."""
    turn: Degrees = 0.0
    """Rotation about the mesh's z axis, degrees counter-clockwise, after scaling."""
    at: PointXYZ = (0.0, 0.0, 0.0)
    """Position (x, y, z) of the mesh's origin, m, after scaling and rotation."""
    inwards: bool = False
    """True if the ball is inside the mesh, as in a room."""
    floor: bool = False
    """True if the cup is cut into the mesh's level top."""

    @model_validator(mode="after")
    def _check_one_source(self) -> MeshPart:
        if (self.file is None) == (self.vertices is None) or (self.vertices is None) != (self.faces is None):
            raise PydanticCustomError("mesh", "expected either file, or both vertices and faces")
        return self


AnyPart: TypeAlias = Annotated[
    LanePart
    | BlockPart
    | PrismPart
    | RevolvedPart
    | BoxPart
    | CylinderPart
    | SpherePart
    | TorusPart
    | RampPart
    | TunnelPart
    | HalfPipePart
    | LoopPart
    | MeshPart,
    Field(discriminator="kind"),
]
