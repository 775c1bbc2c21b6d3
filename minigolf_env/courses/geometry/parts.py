"""Solids of one part: a builder for each kind of part record."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import shapely
import trimesh
from trimesh import Trimesh

from minigolf_env.courses.course import CUP_LINER_THICKNESS, EMBED_DEPTH, CourseError, Cup
from minigolf_env.courses.geometry import solids
from minigolf_env.courses.geometry.cup import cup_outline, cut_cup_into_mesh
from minigolf_env.courses.geometry.ground import LEVEL_TOLERANCE, ground_level
from minigolf_env.courses.geometry.outlines import build_outline, join_shapes
from minigolf_env.courses.geometry.shells import orient_shells
from minigolf_env.courses.geometry.solids import ShapelyPolygon, extrude, sweep_along_line
from minigolf_env.courses.geometry.terrain import build_terrain, make_height_function
from minigolf_env.courses.schema import parts
from minigolf_env.courses.schema.limits import MAX_COURSE_COORDINATE, Limits

FLOOR_BELOW_CUP = 0.02
"""Thickness of a lane below the inside of its cup, or below the cup's liner if it has heights, m."""

ROOF_OVERHANG = 0.06
"""Distance by which the roof of a tunnel projects beyond its walls, m."""


class PartContext(NamedTuple):
    """Data that the parts of a course share while they are built."""

    cup: Cup | None
    """Cup to cut; None if there is none, or if the parts contain it already."""
    obstacles: tuple[ShapelyPolygon, ...]
    """Outlines in the xy-plane of obstacles that stand on the floors."""
    limits: Limits
    """Limits on the size of the course."""
    load_mesh: Callable[[str], Trimesh]
    """Function that returns the mesh that a part names as its ``file``."""
    placed: dict[int, Trimesh]
    """Meshes of mesh parts at their places, by the id of the record; filled by ``place_mesh``."""


class PartSolid(NamedTuple):
    """Solid of a part, with the name of its surface."""

    name: str
    """Name that is added to the part's; empty if the part is one solid."""
    mesh: Trimesh
    """Closed mesh, wound outwards."""
    surface: str
    """Name of its surface."""
    color: str | None = None
    """Colour such as "#c03020"; None: that of the part or its surface."""


def contains_cup(record: parts.PartRecord, cup: Cup, context: PartContext) -> bool:
    """Return whether the cup is cut into this part: a lane, or a mesh that is a floor, with ground level at the rim."""
    x, y, rim = cup.position
    if isinstance(record, parts.MeshPart):
        mesh = place_mesh(record, context)
        return record.floor and ground_level(mesh.triangles, x, y, rim) is not None
    if not isinstance(record, parts.LanePart):
        return False
    if not join_shapes(record.outline).contains(shapely.Point(x, y)):
        return False
    # Require that the ground is level with the rim at the centre and on four sides of the cup.
    offsets = np.array([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)])
    around = np.array([(x, y)]) + (cup.radius + CUP_LINER_THICKNESS) * offsets
    height_at = make_height_function(record.level, record.heights)
    return bool(np.abs(height_at(around) - rim).max() <= LEVEL_TOLERANCE)


def cup_level(record: parts.PartRecord, cup: Cup, context: PartContext) -> float | None:
    """Return the exact level of a part's ground at the cup; None if the cup is not cut into it, or it has heights."""
    if not contains_cup(record, cup, context):
        return None
    if isinstance(record, parts.MeshPart):
        return ground_level(place_mesh(record, context).triangles, *cup.position)
    return record.level if isinstance(record, parts.LanePart) and not record.heights else None


@functools.singledispatch
def build_part_solids(record: parts.PartRecord, context: PartContext) -> Iterator[PartSolid]:
    """Yield the solids of a part, by the kind of its record.

    Raises:
        CourseError: the part that the record describes cannot be built.
    """
    raise TypeError(f"part: no builder for {type(record).__name__}")


@build_part_solids.register
def _(record: parts.LanePart, context: PartContext) -> Iterator[PartSolid]:
    # Extend the floor below the border, except in its gaps.
    lane = build_outline(record.outline, record.holes)
    floor = lane.buffer(record.border / 2.0, join_style="mitre") if record.border else lane
    if record.gaps:
        floor = (floor - join_shapes(record.gaps)) | lane
    # Cut the cup, and make the floor thick enough for it.
    height_at = make_height_function(record.level, record.heights)
    low = _lowest_level(lane, record)
    bottom = low - record.thickness
    if context.cup is not None and contains_cup(record, context.cup, context):
        clear = functools.reduce(lambda area, obstacle: area - obstacle, context.obstacles, lane)
        floor = floor - cup_outline(clear, context.cup)
        low, bottom = _levels_below_cup(record, context.cup, low)
    # Build the floor and the border.
    if record.heights:
        context.limits.check_cells(floor.bounds, record.cell)
        yield PartSolid("floor", build_terrain(floor, height_at, record.cell, bottom), record.surface)
    else:
        yield PartSolid("floor", extrude(floor, bottom, record.level), record.surface)
    if record.border:
        yield from _build_border(lane, record, low)


def _build_border(lane: ShapelyPolygon, record: parts.LanePart, low: float) -> Iterator[PartSolid]:
    """Yield the pieces of the border around a lane; ``low`` is the lowest level of its floor, m."""
    outside = lane.buffer(record.border, join_style="mitre")
    ring = outside - lane - join_shapes(record.gaps) if record.gaps else outside - lane
    for piece in shapely.get_parts(ring):
        if record.heights:
            top = make_height_function(record.level + record.border_height, record.heights)
            mesh = build_terrain(piece, top, record.cell, low - EMBED_DEPTH)
        else:
            mesh = extrude(piece, record.level - EMBED_DEPTH, record.level + record.border_height)
        yield PartSolid("border", mesh, record.border_surface, record.border_color)


def _levels_below_cup(record: parts.LanePart, cup: Cup, low: float) -> tuple[float, float]:
    """Return the level from which the border reaches down, and the bottom of the floor, for a lane that has the cup, m.

    A level floor ends FLOOR_BELOW_CUP below the cup's inside; one with heights is at least as thick as its lowest point
    requires, and ends FLOOR_BELOW_CUP below the cup's liner.
    """
    under_cup = cup.position[2] - cup.depth
    low = min(low, under_cup - CUP_LINER_THICKNESS - FLOOR_BELOW_CUP + record.thickness)
    bottom = low - record.thickness if record.heights else under_cup - FLOOR_BELOW_CUP
    return low, bottom


def _lowest_level(lane: ShapelyPolygon, record: parts.LanePart) -> float:
    """Return the lowest level of a lane at the points of a 60 x 60 grid, m."""
    if not record.heights:
        return record.level
    left, front, right, back = lane.bounds
    grid = np.stack(np.meshgrid(np.linspace(left, right, 60), np.linspace(front, back, 60)), axis=-1).reshape(-1, 2)
    return float(make_height_function(record.level, record.heights)(grid).min())


@build_part_solids.register
def _(record: parts.BlockPart, context: PartContext) -> Iterator[PartSolid]:
    outline = build_outline(record.outline, record.holes)
    yield PartSolid("", extrude(outline, record.bottom, record.top), record.surface)


@build_part_solids.register
def _(record: parts.PrismPart, context: PartContext) -> Iterator[PartSolid]:
    profile = build_outline(record.profile, record.holes)
    yield PartSolid("", sweep_along_line(profile, record.start, record.end), record.surface)


@build_part_solids.register
def _(record: parts.RevolvedPart, context: PartContext) -> Iterator[PartSolid]:
    yield PartSolid("", solids.revolve(record.profile, record.at, record.sides), record.surface)


@build_part_solids.register
def _(record: parts.BoxPart, context: PartContext) -> Iterator[PartSolid]:
    box = trimesh.creation.box(extents=record.size)
    yield PartSolid("", _place(box, record.at, record.turn), record.surface)


@build_part_solids.register
def _(record: parts.CylinderPart, context: PartContext) -> Iterator[PartSolid]:
    x, y, z = record.at
    top = record.radius if record.top_radius is None else record.top_radius
    profile = [(0.0, z), (record.radius, z), (top, z + record.height), (0.0, z + record.height)]
    yield PartSolid("", solids.revolve(profile if top else profile[:3], (x, y), record.sides), record.surface)


@build_part_solids.register
def _(record: parts.SpherePart, context: PartContext) -> Iterator[PartSolid]:
    ball = trimesh.creation.icosphere(subdivisions=record.subdivisions, radius=record.radius)
    yield PartSolid("", _place(ball, record.at), record.surface)


@build_part_solids.register
def _(record: parts.TorusPart, context: PartContext) -> Iterator[PartSolid]:
    ring = trimesh.creation.torus(
        record.major_radius,
        record.minor_radius,
        major_sections=record.major_sections,
        minor_sections=record.minor_sections,
    )
    yield PartSolid("", _place(ring, record.at), record.surface)


@build_part_solids.register
def _(record: parts.RampPart, context: PartContext) -> Iterator[PartSolid]:
    delta = np.subtract(record.end, record.start)
    length = float(np.hypot(*delta))
    if not length > 0.0:
        raise CourseError(f"end: expected a place other than the start, received {record.end}; move it.")
    # Sweep the wedge's cross-section, which lies along the slope, across the slope.
    side = np.array([-delta[1], delta[0]]) / length * (0.5 * record.width)
    wedge = shapely.Polygon([(0, 0), (-length, record.height), (-length, -EMBED_DEPTH), (0, -EMBED_DEPTH)])
    near = np.array(record.start) - side
    far = np.array(record.start) + side
    yield PartSolid("", sweep_along_line(wedge, (*near, record.level), (*far, record.level)), record.surface)


@build_part_solids.register
def _(record: parts.TunnelPart, context: PartContext) -> Iterator[PartSolid]:
    half_width = 0.5 * record.width
    half_door = 0.5 * record.door
    top = record.height
    if not (half_door < half_width and record.door < top):
        raise CourseError(
            f"door: expected less than the width and the height of the house, received {record.door}; narrow it."
        )
    # Build the walls: a rectangle with an arch cut out.
    angles = np.linspace(0.0, math.pi, 25).tolist()
    arch = [(half_door * math.cos(t), half_door + half_door * math.sin(t)) for t in angles]
    left = [(-half_width, -EMBED_DEPTH), (-half_door, -EMBED_DEPTH)]
    right = [(half_door, -EMBED_DEPTH), (half_width, -EMBED_DEPTH)]
    walls = shapely.Polygon([*left, *arch[::-1], *right, (half_width, top), (-half_width, top)])
    start = (*record.start, record.level)
    end = (*record.end, record.level)
    yield PartSolid("walls", sweep_along_line(walls, start, end), record.surface)
    # Build the roof: a triangle that projects beyond the walls on all sides.
    eave = half_width + ROOF_OVERHANG
    gable = shapely.Polygon([(-eave, top), (eave, top), (0.0, top + record.roof)])
    overhang = np.subtract(end, start) * (ROOF_OVERHANG / math.dist(start, end))
    yield PartSolid("roof", sweep_along_line(gable, start - overhang, end + overhang), "roof", record.roof_color)


@build_part_solids.register
def _(record: parts.HalfPipePart, context: PartContext) -> Iterator[PartSolid]:
    angles = np.radians(record.arc) * np.arange(record.sides + 1) / record.sides
    bank = np.c_[0.5 * record.floor + record.radius * np.sin(angles), record.radius * (1.0 - np.cos(angles))]
    outer = bank[-1, 0] + record.lip
    points = [*bank.tolist(), [outer, bank[-1, 1]], [outer, -EMBED_DEPTH], [bank[0, 0], -EMBED_DEPTH]]
    for name, side in (("left bank", 1.0), ("right bank", -1.0)):
        profile = shapely.Polygon([(side * across, up) for across, up in points])
        yield PartSolid(name, sweep_along_line(profile, record.start, record.end), record.surface)


@build_part_solids.register
def _(record: parts.LoopPart, context: PartContext) -> Iterator[PartSolid]:
    track = solids.build_loop_track(
        record.radius, record.width, record.shift, record.rail, record.thickness, record.sides
    )
    yield PartSolid("", _place(track, record.at, record.turn), record.surface)


@build_part_solids.register
def _(record: parts.MeshPart, context: PartContext) -> Iterator[PartSolid]:
    mesh = place_mesh(record, context)
    if context.cup is not None and contains_cup(record, context.cup, context):
        mesh = cut_cup_into_mesh(mesh, context.cup, context.obstacles)
    yield PartSolid("", mesh, record.surface)


def place_mesh(record: parts.MeshPart, context: PartContext) -> Trimesh:
    """Return the mesh of a part, scaled, turned, moved, and wound outwards; ``make_part`` turns it for a room."""
    if id(record) in context.placed:
        return context.placed[id(record)]
    mesh = build_inline_mesh(record, context.limits) if record.file is None else context.load_mesh(record.file)
    if record.scale != 1.0:
        mesh = Trimesh(mesh.vertices * record.scale, mesh.faces, process=False)
    mesh = _place(mesh, record.at, record.turn)
    if not np.abs(mesh.vertices).max(initial=0.0) <= MAX_COURSE_COORDINATE:
        raise CourseError(
            f"mesh: expected corners within {MAX_COURSE_COORDINATE:g} m, received some beyond; give a `scale`."
        )
    context.placed[id(record)] = orient_shells(mesh)
    return context.placed[id(record)]


def build_inline_mesh(record: parts.MeshPart, limits: Limits) -> Trimesh:
    """Return the mesh whose vertices and faces are in the course file.

    Raises:
        CourseError: a coordinate is not finite or too large, an index is out of range, or there are too many faces.
    """
    vertices = np.array(record.vertices, dtype=np.float64)
    faces = np.array(record.faces, dtype=np.int64)
    limits.check_triangles(len(faces))
    if not len(faces) or not np.isfinite(vertices).all() or np.abs(vertices).max() > MAX_COURSE_COORDINATE:
        raise CourseError(
            f"vertices and faces: expected finite numbers within {MAX_COURSE_COORDINATE:g} m, and at least one face."
        )
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise CourseError(f"faces: expected rows 0 to {len(vertices) - 1} of vertices, received up to {faces.max()}.")
    return Trimesh(vertices, faces, process=False)


def _place(solid: Trimesh, at: tuple[float, float, float], rotation_degrees: float = 0.0) -> Trimesh:
    """Return a solid rotated about the z axis, counter-clockwise, then moved."""
    if rotation_degrees:
        cos = math.cos(math.radians(rotation_degrees))
        sin = math.sin(math.radians(rotation_degrees))
        rotation = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1.0]])
        solid = Trimesh(solid.vertices @ rotation, solid.faces, process=False)
    if any(at):
        solid.apply_translation(at)
    return solid
