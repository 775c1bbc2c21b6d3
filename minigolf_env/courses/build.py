"""From the description of a hole to the Course: every part becomes a closed solid, and the cup is cut."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import shapely
from trimesh import Trimesh

from minigolf_env._validation import one_of
from minigolf_env.courses import description as d
from minigolf_env.courses import solids
from minigolf_env.courses.course import Course, CourseError, Cup, Part, Point3, Tee, faults_of
from minigolf_env.courses.limits import Limits
from minigolf_env.courses.outlines import outline
from minigolf_env.courses.parts import Site, holds_cup, solids_of
from minigolf_env.courses.solids import Outline, cup_liner
from minigolf_env.courses.surfaces import Look, known_surfaces

BELOW, ABOVE = 0.3, 2.0
"""How far bounds reach below the lowest floor, and above the highest, m: beyond where a ball in play can fly."""


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
            for solid in solids_of(record, site):
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
                if file.cup is not None and uncut and cup is not None and holds_cup(record, cup):
                    lining = looks[one_of(file.cup.surface, tuple(looks), "cup: surface")]
                    yield solids.part("cup", cup_liner(cup), lining.material, lining.surface)
                    uncut = False
    if uncut and cup is not None:
        raise CourseError(
            f"cup position: expected a place on a lane, at its level, received {cup.position}; "
            "move the cup over a floor."
        )


def _rgb(color: str) -> tuple[float, float, float]:
    red, green, blue = (int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue


def _bounds(file: d.CourseFile, parts: tuple[Part, ...]) -> tuple[Point3, Point3]:
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
