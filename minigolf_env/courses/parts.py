"""From one part's description to its solids."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
import trimesh
from trimesh import Trimesh

from minigolf_env.courses import description as d
from minigolf_env.courses import solids
from minigolf_env.courses.course import CourseError, Cup, Material
from minigolf_env.courses.limits import Limits
from minigolf_env.courses.meshes import check_place, cut_cup, inline_mesh, read_mesh
from minigolf_env.courses.outlines import outline, union
from minigolf_env.courses.solids import Outline, cup_hole, extruded
from minigolf_env.courses.terrain import height_function, terrain

LEVEL = 1e-9
"""Nearer than this two levels are one, m."""


class Site(NamedTuple):
    """What the parts of a hole have in common."""

    cup: Cup | None
    """To cut; None if there is none, or it is cut already."""
    obstacles: tuple[Outline, ...]
    """Outlines in plan of what stands on the floors."""
    folder: Path | None
    """Where mesh files lie."""
    limits: Limits
    objects: Mapping[str, Trimesh]
    """Meshes at hand, by the names of files."""


class Solid(NamedTuple):
    """A piece of a part, before it has a surface."""

    name: str
    mesh: Trimesh
    surface: str
    color: str | None = None
    material: Material | None = None


def holds_cup(record: d.PartRecord, cup: Cup) -> bool:
    """Return whether the cup is cut into this part."""
    if isinstance(record, d.Mesh):
        return record.floor
    if not isinstance(record, d.Lane):
        return False
    x, y, rim = cup.position
    if not union(record.outline).contains(shapely.Point(x, y)):
        return False
    around = np.array([(x, y)]) + (cup.radius + solids.LINER) * np.array([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)])
    return bool(np.abs(height_function(record.level, record.heights)(around) - rim).max() <= LEVEL)


@functools.singledispatch
def solids_of(record: d.PartRecord, site: Site) -> Iterator[Solid]:
    """Yield the solids of a part, by the kind of its record.

    Raises:
        CourseError: what the record describes cannot be built.
    """
    raise TypeError(f"part: no builder for {type(record).__name__}")


@solids_of.register
def _(record: d.Lane, site: Site) -> Iterator[Solid]:
    lane = outline(record.outline, record.holes)
    floor = lane.buffer(record.border / 2.0, join_style="mitre") if record.border else lane
    if record.gaps:
        floor = (floor - union(record.gaps)) | lane
    height = height_function(record.level, record.heights)
    low = _lowest(lane, record, height)
    if site.cup is not None and holds_cup(record, site.cup):
        floor = floor - cup_hole(functools.reduce(lambda area, taken: area - taken, site.obstacles, lane), site.cup)
        low = min(low, site.cup.position[2] - site.cup.depth - solids.LINER - solids.SLAB + record.thickness)
        bottom = site.cup.position[2] - site.cup.depth - solids.SLAB if not record.heights else low - record.thickness
    else:
        bottom = low - record.thickness
    if record.heights:
        site.limits.check_cells(floor.bounds, record.cell)
        yield Solid("floor", terrain(floor, height, record.cell, bottom), record.surface)
    else:
        yield Solid("floor", extruded(floor, bottom, record.level), record.surface)
    if not record.border:
        return
    outside = lane.buffer(record.border, join_style="mitre")
    ring = outside - lane - union(record.gaps) if record.gaps else outside - lane
    for piece in shapely.get_parts(ring):
        if record.heights:
            top = height_function(record.level + record.border_height, record.heights)
            fence = terrain(piece, top, record.cell, low - solids.ROOT)
        else:
            fence = extruded(piece, record.level - solids.ROOT, record.level + record.border_height)
        yield Solid("border", fence, record.border_surface, record.border_color)


def _lowest(lane: Outline, record: d.Lane, height: object) -> float:
    """Return the lowest level of a lane, from a sample of its places, m."""
    if not record.heights:
        return record.level
    left, front, right, back = lane.bounds
    grid = np.stack(np.meshgrid(np.linspace(left, right, 60), np.linspace(front, back, 60)), axis=-1).reshape(-1, 2)
    return float(height_function(record.level, record.heights)(grid).min())


@solids_of.register
def _(record: d.Block, site: Site) -> Iterator[Solid]:
    yield Solid("", extruded(outline(record.outline, record.holes), record.bottom, record.top), record.surface)


@solids_of.register
def _(record: d.Prism, site: Site) -> Iterator[Solid]:
    profile = outline(record.profile, record.holes)
    yield Solid("", solids.prism(profile, record.start, record.end), record.surface)


@solids_of.register
def _(record: d.Revolved, site: Site) -> Iterator[Solid]:
    yield Solid("", solids.revolved(record.profile, record.at, record.sides), record.surface)


@solids_of.register
def _(record: d.Box, site: Site) -> Iterator[Solid]:
    yield Solid("", _placed(trimesh.creation.box(extents=record.size), record.at, record.turn), record.surface)


@solids_of.register
def _(record: d.Cylinder, site: Site) -> Iterator[Solid]:
    x, y, z = record.at
    top = record.radius if record.top_radius is None else record.top_radius
    profile = [(0.0, z), (record.radius, z), (top, z + record.height), (0.0, z + record.height)]
    yield Solid("", solids.revolved(profile if top else profile[:3], (x, y), record.sides), record.surface)


@solids_of.register
def _(record: d.Sphere, site: Site) -> Iterator[Solid]:
    ball = trimesh.creation.icosphere(subdivisions=record.subdivisions, radius=record.radius)
    yield Solid("", _placed(ball, record.at), record.surface)


@solids_of.register
def _(record: d.Torus, site: Site) -> Iterator[Solid]:
    ring = trimesh.creation.torus(
        record.major_radius,
        record.minor_radius,
        major_sections=record.major_sections,
        minor_sections=record.minor_sections,
    )
    yield Solid("", _placed(ring, record.at), record.surface)


@solids_of.register
def _(record: d.Ramp, site: Site) -> Iterator[Solid]:
    way = np.subtract(record.end, record.start)
    length = float(np.hypot(*way))
    if not length > 0.0:
        raise CourseError(f"end: expected a place other than the start, received {record.end}; move it.")
    # Lying on its side: the wedge's upright cross-section along the way, drawn out across it.
    side = np.array([-way[1], way[0]]) / length * (0.5 * record.width)
    root = solids.ROOT
    wedge = shapely.Polygon([(0, 0), (-length, record.height), (-length, -root), (0, -root)])
    near, far = np.array(record.start) - side, np.array(record.start) + side
    yield Solid("", solids.prism(wedge, (*near, record.level), (*far, record.level)), record.surface)


@solids_of.register
def _(record: d.Tunnel, site: Site) -> Iterator[Solid]:
    half, door, high = 0.5 * record.width, 0.5 * record.door, record.height
    if not (door < half and record.door < high):
        raise CourseError(
            f"door: expected less than the width and the height of the house, received {record.door}; narrow it."
        )
    arch = [(door * math.cos(t), door + door * math.sin(t)) for t in np.linspace(0.0, math.pi, 25).tolist()]
    walls = [(-half, -solids.ROOT), (-door, -solids.ROOT), *arch[::-1], (door, -solids.ROOT), (half, -solids.ROOT)]
    house = shapely.Polygon([*walls, (half, high), (-half, high)])
    start, end = (*record.start, record.level), (*record.end, record.level)
    yield Solid("walls", solids.prism(house, start, end), record.surface)
    eave = 0.06
    roof = shapely.Polygon([(-half - eave, high), (half + eave, high), (0.0, high + record.roof)])
    over = np.subtract(end, start) * (eave / math.dist(start, end))
    yield Solid("roof", solids.prism(roof, start - over, end + over), "roof", record.roof_color)


@solids_of.register
def _(record: d.HalfPipe, site: Site) -> Iterator[Solid]:
    turns = np.radians(record.arc) * np.arange(record.sides + 1) / record.sides
    bank = np.c_[0.5 * record.floor + record.radius * np.sin(turns), record.radius * (1.0 - np.cos(turns))]
    outer = bank[-1, 0] + record.lip
    points = [*bank.tolist(), [outer, bank[-1, 1]], [outer, -solids.ROOT], [bank[0, 0], -solids.ROOT]]
    for name, side in (("left bank", 1.0), ("right bank", -1.0)):
        profile = shapely.Polygon([(side * across, up) for across, up in points])
        yield Solid(name, solids.prism(profile, record.start, record.end), record.surface)


@solids_of.register
def _(record: d.Loop, site: Site) -> Iterator[Solid]:
    track = solids.loop(record.radius, record.width, record.shift, record.rail, record.thickness, record.sides)
    yield Solid("", _placed(track, record.at, record.turn), record.surface)


@solids_of.register
def _(record: d.Mesh, site: Site) -> Iterator[Solid]:
    if record.file is None:
        mesh = inline_mesh(record, site.limits)
    elif record.file in site.objects:
        mesh = site.objects[record.file]
    else:
        mesh = read_mesh(record.file, site.folder, site.limits)
    if record.scale != 1.0:
        mesh = Trimesh(mesh.vertices * record.scale, mesh.faces, process=False)
    mesh = _placed(mesh, record.at, record.turn)
    check_place(mesh)
    if mesh.volume < 0.0:  # Wound inwards; _parts does so where the ball is inside.
        mesh = Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)
    if record.floor and site.cup is not None:
        mesh = cut_cup(mesh, site.cup, site.obstacles)
    yield Solid("", mesh, record.surface)


def _placed(solid: Trimesh, at: tuple[float, float, float], turn: float = 0.0) -> Trimesh:
    if turn:
        cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        solid = Trimesh(
            solid.vertices @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1.0]]), solid.faces, process=False
        )
    if any(at):
        solid.apply_translation(at)
    return solid
