"""From the description of a hole to the Course: every part becomes a closed solid, and the cup is cut."""

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
from minigolf_env.courses.course import Course, CourseError, Cup, Material, Part, Tee, faults_of
from minigolf_env.courses.limits import Limits
from minigolf_env.courses.meshes import cut_cup, inline_mesh, read_mesh
from minigolf_env.courses.outlines import outline, union
from minigolf_env.courses.solids import Outline, cup_hole, cup_liner, extruded
from minigolf_env.courses.surfaces import Look, known_surfaces
from minigolf_env.courses.terrain import height_function, terrain
from minigolf_env.physics.checks import one_of

BELOW, ABOVE = 0.3, 2.0
"""How far bounds reach below the lowest floor, and above the highest, m: beyond where a ball in play can fly."""

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


def build(
    file: d.CourseFile,
    folder: Path | None = None,
    limits: Limits | None = None,
    objects: Mapping[str, Trimesh] | None = None,
) -> Course:
    """Return the course that a file describes.

    Args:
        file: the description.
        folder: where mesh files lie; None: there are none.
        limits: on what is built; None: the default.
        objects: meshes at hand, which stand for files of these names.

    Raises:
        CourseError: what is described cannot be built.
    """
    limits = limits or Limits()
    with faults_of(f"course {file.name!r}"):
        cup = None if file.cup is None else Cup(file.cup.position, file.cup.radius, file.cup.depth)
        if cup is not None:
            cup.check_takes(file.ball_radius)
        tee = _tee(file.tee)
        parts = tuple(_parts(file, cup, folder, limits, objects or {}))
        route = () if cup is None else (tee.centre, *file.route, cup.position[:2])
        return Course(
            name=file.name,
            parts=parts,
            tee=tee,
            cup=cup,
            par=file.par,
            bounds=file.bounds or _bounds(file, parts),
            route=route,
            top_speed=file.top_speed,
            ball_radius=file.ball_radius,
            gravity=file.gravity,
        )


def _tee(tee: d.TeeRecord) -> Tee:
    lower, upper = (tee.at, tee.at) if tee.at is not None else (tee.lower, tee.upper)
    if lower is None or upper is None:
        raise CourseError("tee: expected either at, or both lower and upper.")
    return Tee(lower, upper, tee.height)


def _parts(
    file: d.CourseFile, cup: Cup | None, folder: Path | None, limits: Limits, objects: Mapping[str, Trimesh]
) -> Iterator[Part]:
    looks = known_surfaces(file.surfaces)
    to_cut = None if file.cup is None or file.cup.cut else cup
    site = Site(to_cut, tuple(_obstacles(file)), folder, limits, objects)
    uncut, triangles = to_cut is not None, 0
    for number, record in enumerate(file.parts):
        name = record.name or f"{record.kind} {number + 1}"
        with faults_of(f"part {name!r}"):
            for solid in _solids(record, site):
                look: Look = looks[one_of(solid.surface, tuple(looks), "surface")]
                mine = solid.surface == record.surface
                material = solid.material or (record.material if mine else None) or look.material
                color = solid.color or (record.color if mine else None) or look.color
                triangles += len(solid.mesh.faces)
                limits.check_triangles(triangles)
                inwards = isinstance(record, (d.Block, d.Mesh)) and record.inwards
                title = solid.name if record.name is None or solid.name == "" else f"{record.name} {solid.name}"
                rgb = None if color is None else _rgb(color)
                yield solids.part(title or name, solid.mesh, material, look.surface, inwards, rgb)
                if file.cup is not None and uncut and cup is not None and _holds_cup(record, cup):
                    lining = looks[one_of(file.cup.surface, tuple(looks), "cup: surface")]
                    yield solids.part("cup", cup_liner(cup), lining.material, lining.surface)
                    uncut = False
    if uncut and cup is not None:
        raise CourseError(
            f"cup position: expected a place on a lane, at its level, received {cup.position}; move the cup over a floor."
        )


def _rgb(color: str) -> tuple[float, float, float]:
    red, green, blue = (int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue


def _bounds(file: d.CourseFile, parts: tuple[Part, ...]) -> tuple[d.Point3, d.Point3]:
    lanes = [part for part in file.parts if isinstance(part, d.Lane)]
    if not lanes:
        points = np.concatenate([part.mesh.vertices for part in parts])
        low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return (low[0], low[1], low[2] - BELOW), (high[0], high[1], high[2] + ABOVE)
    area = shapely.union_all([_outside(lane) for lane in lanes])
    left, front, right, back = area.bounds
    levels = [lane.level for lane in lanes]
    return (left, front, min(levels) - BELOW), (right, back, max(levels) + ABOVE)


def _outside(lane: d.Lane) -> Outline:
    area = outline(lane.outline)
    return area.buffer(lane.border, join_style="mitre") if lane.border else area


def _obstacles(file: d.CourseFile) -> Iterator[Outline]:
    """Yield the outlines of upright things that stand on the floors, as far as they have one."""
    rim = 0.0 if file.cup is None else file.cup.position[2]
    for record in file.parts:
        if isinstance(record, d.Block) and not record.inwards and record.bottom <= rim < record.top:
            yield outline(record.outline, record.holes)
        elif isinstance(record, d.Revolved):
            yield solids.disc(record.at, max(radius for radius, _ in record.profile))
        elif isinstance(record, d.Cylinder):
            yield solids.disc(record.at[:2], record.radius)


def _holds_cup(record: d.PartRecord, cup: Cup) -> bool:
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
def _solids(record: d.PartRecord, site: Site) -> Iterator[Solid]:
    raise TypeError(f"part: no builder for {type(record).__name__}")


@_solids.register
def _(record: d.Lane, site: Site) -> Iterator[Solid]:
    lane = outline(record.outline, record.holes)
    floor = lane.buffer(record.border / 2.0, join_style="mitre") if record.border else lane
    if record.gaps:
        floor = (floor - union(record.gaps)) | lane
    height = height_function(record.level, record.heights)
    low = _lowest(lane, record, height)
    if site.cup is not None and _holds_cup(record, site.cup):
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


@_solids.register
def _(record: d.Block, site: Site) -> Iterator[Solid]:
    yield Solid("", extruded(outline(record.outline, record.holes), record.bottom, record.top), record.surface)


@_solids.register
def _(record: d.Prism, site: Site) -> Iterator[Solid]:
    profile = outline(record.profile, record.holes)
    yield Solid("", solids.prism(profile, record.start, record.end), record.surface)


@_solids.register
def _(record: d.Revolved, site: Site) -> Iterator[Solid]:
    yield Solid("", solids.revolved(record.profile, record.at, record.sides), record.surface)


@_solids.register
def _(record: d.Box, site: Site) -> Iterator[Solid]:
    yield Solid("", _placed(trimesh.creation.box(extents=record.size), record.at, record.turn), record.surface)


@_solids.register
def _(record: d.Cylinder, site: Site) -> Iterator[Solid]:
    x, y, z = record.at
    top = record.radius if record.top_radius is None else record.top_radius
    profile = [(0.0, z), (record.radius, z), (top, z + record.height), (0.0, z + record.height)]
    yield Solid("", solids.revolved(profile if top else profile[:3], (x, y), record.sides), record.surface)


@_solids.register
def _(record: d.Sphere, site: Site) -> Iterator[Solid]:
    ball = trimesh.creation.icosphere(subdivisions=record.subdivisions, radius=record.radius)
    yield Solid("", _placed(ball, record.at), record.surface)


@_solids.register
def _(record: d.Torus, site: Site) -> Iterator[Solid]:
    ring = trimesh.creation.torus(
        record.major_radius,
        record.minor_radius,
        major_sections=record.major_sections,
        minor_sections=record.minor_sections,
    )
    yield Solid("", _placed(ring, record.at), record.surface)


@_solids.register
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


@_solids.register
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


@_solids.register
def _(record: d.HalfPipe, site: Site) -> Iterator[Solid]:
    turns = np.radians(record.arc) * np.arange(record.sides + 1) / record.sides
    bank = np.c_[0.5 * record.floor + record.radius * np.sin(turns), record.radius * (1.0 - np.cos(turns))]
    outer = bank[-1, 0] + record.lip
    points = [*bank.tolist(), [outer, bank[-1, 1]], [outer, -solids.ROOT], [bank[0, 0], -solids.ROOT]]
    for name, side in (("left bank", 1.0), ("right bank", -1.0)):
        profile = shapely.Polygon([(side * across, up) for across, up in points])
        yield Solid(name, solids.prism(profile, record.start, record.end), record.surface)


@_solids.register
def _(record: d.Loop, site: Site) -> Iterator[Solid]:
    track = solids.loop(record.radius, record.width, record.shift, record.rail, record.thickness, record.sides)
    yield Solid("", _placed(track, record.at, record.turn), record.surface)


@_solids.register
def _(record: d.Mesh, site: Site) -> Iterator[Solid]:
    if record.file is None:
        mesh = inline_mesh(record, site.limits)
    elif record.file in site.objects:
        mesh = site.objects[record.file]
    else:
        mesh = read_mesh(record.file, site.folder, site.limits)
    if record.scale != 1.0:
        mesh.apply_scale(record.scale)
    mesh = _placed(mesh, record.at, record.turn)
    if mesh.volume < 0.0:  # Wound inwards; _parts does so where the ball is inside.
        mesh = Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)
    if record.floor and site.cup is not None:
        mesh = cut_cup(mesh, site.cup, site.obstacles)
    yield Solid("", mesh, record.surface)


def _placed(solid: Trimesh, at: tuple[float, float, float], turn: float = 0.0) -> Trimesh:
    if turn:
        solid.apply_transform(trimesh.transformations.rotation_matrix(math.radians(turn), (0.0, 0.0, 1.0)))
    if any(at):
        solid.apply_translation(at)
    return solid
