"""Assembly of a Course from its description: every part becomes closed solids, and the cup is cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import shapely
from trimesh import Trimesh

from minigolf_env._validation import one_of
from minigolf_env.courses.course import Color, Course, CourseError, Cup, Material, Part, Point3, Tee, course_errors
from minigolf_env.courses.geometry.cup import build_cup_liner
from minigolf_env.courses.geometry.outlines import build_outline
from minigolf_env.courses.geometry.parts import PartContext, PartSolid, build_part_solids, contains_cup
from minigolf_env.courses.geometry.solids import ShapelyPolygon, circle_polygon
from minigolf_env.courses.schema.course_file import CourseFile, TeeRecord
from minigolf_env.courses.schema.limits import Limits
from minigolf_env.courses.schema.parts import (
    AnyPart,
    BlockPart,
    CylinderPart,
    LanePart,
    MeshPart,
    RevolvedPart,
)
from minigolf_env.courses.schema.surfaces import SurfaceAppearance, collect_surfaces
from minigolf_env.physics import Surface, TriangleMesh

BOUNDS_BELOW_FLOOR = 0.3
"""Distance from the lowest level of a lane down to the default bounds, m."""

BOUNDS_ABOVE_FLOOR = 2.0
"""Distance from the highest level of a lane up to the default bounds, m: no ball in play flies higher."""


def assemble_course(
    file: CourseFile,
    load_mesh: Callable[[str], Trimesh],
    cup_radius: float | None = None,
    limits: Limits | None = None,
) -> Course:
    """Return the course that a description describes.

    Args:
        file: the description.
        load_mesh: function that returns the mesh that a part names as its ``file``, or raises a CourseError.
        cup_radius: radius of the cup in place of the file's, m; None: the file's.
        limits: limits on the size of the course; None: the default.

    Raises:
        CourseError: the course cannot be built.
    """
    file = _replace_cup_radius(file, cup_radius)
    try:
        return _assemble(file, load_mesh, limits or Limits())
    except CourseError:
        raise
    except Exception as error:  # Geometry libraries raise errors of many kinds on degenerate outlines.
        raise CourseError(
            f"course {file.name!r}: its geometry cannot be built: {type(error).__name__}: {error}; "
            "simplify its outlines and meshes, and make sure that each has an area or a volume."
        ) from error


def _replace_cup_radius(file: CourseFile, cup_radius: float | None) -> CourseFile:
    if cup_radius is None:
        return file
    if file.cup is None:
        raise CourseError(f"cup_radius: expected None for {file.name!r}, which has no cup, received {cup_radius!r}.")
    if file.cup.cut and cup_radius != file.cup.radius:
        raise CourseError(
            f"cup_radius: expected None for {file.name!r}, whose cup is already cut, received {cup_radius!r}."
        )
    return file.model_copy(update={"cup": file.cup.model_copy(update={"radius": cup_radius})})


def _assemble(file: CourseFile, load_mesh: Callable[[str], Trimesh], limits: Limits) -> Course:
    with course_errors(f"course {file.name!r}"):
        cup = None if file.cup is None else Cup(file.cup.position, file.cup.radius, file.cup.depth)
        if cup is not None:
            cup.check_ball_fits(file.ball_radius)
        tee = _build_tee(file.tee)
        parts = tuple(_build_parts(file, cup, load_mesh, limits))
        bounds = file.bounds or _default_bounds(file, parts)
    # A Course names itself in its errors.
    return Course(
        name=file.name,
        parts=parts,
        tee=tee,
        cup=cup,
        par=file.par,
        bounds=bounds,
        route=() if cup is None else (tee.centre, *file.route, cup.position[:2]),
        top_speed=file.top_speed,
        ball_radius=file.ball_radius,
        gravity=file.gravity,
    )


def _build_tee(tee: TeeRecord) -> Tee:
    lower, upper = (tee.at, tee.at) if tee.at is not None else (tee.lower, tee.upper)
    if lower is None or upper is None:
        raise CourseError("tee: expected either at, or both lower and upper.")
    return Tee(lower, upper, tee.height)


def _build_parts(
    file: CourseFile, cup: Cup | None, load_mesh: Callable[[str], Trimesh], limits: Limits
) -> Iterator[Part]:
    surfaces = collect_surfaces(file.surfaces)
    cup_to_cut = None if file.cup is None or file.cup.cut else cup
    context = PartContext(cup_to_cut, tuple(_find_obstacles(file)), limits, load_mesh)
    is_cup_missing = cup_to_cut is not None
    triangles = 0
    for number, record in enumerate(file.parts):
        name = record.name or f"{record.kind} {number + 1}"
        with course_errors(f"part {name!r}"):
            for solid in build_part_solids(record, context):
                triangles += len(solid.mesh.faces)
                limits.check_triangles(triangles)
                yield _finish_part(name, record, solid, surfaces)
                # The cup follows the first solid of the part that it is cut into.
                if file.cup is not None and is_cup_missing and cup is not None and contains_cup(record, cup):
                    lining = surfaces[one_of(file.cup.surface, tuple(surfaces), "cup: surface")]
                    yield make_part("cup", build_cup_liner(cup), lining.material, lining.surface)
                    is_cup_missing = False
    if is_cup_missing and cup is not None:
        raise CourseError(
            f"cup position: expected a place on a lane, at its level, received {cup.position}; "
            "move the cup over a floor."
        )


def _finish_part(name: str, record: AnyPart, solid: PartSolid, surfaces: dict[str, SurfaceAppearance]) -> Part:
    """Return a solid as a Part with its surface, material and colour."""
    appearance = surfaces[one_of(solid.surface, tuple(surfaces), "surface")]
    has_part_surface = solid.surface == record.surface
    material = (record.material if has_part_surface else None) or appearance.material
    color = solid.color or (record.color if has_part_surface else None) or appearance.color
    is_inwards = isinstance(record, (BlockPart, MeshPart)) and record.inwards
    title = solid.name if record.name is None or solid.name == "" else f"{record.name} {solid.name}"
    rgb = None if color is None else _parse_color(color)
    return make_part(title or name, solid.mesh, material, appearance.surface, is_inwards, rgb)


def make_part(
    name: str,
    solid: Trimesh,
    material: Material,
    surface: Surface,
    inwards: bool = False,
    color: Color | None = None,
) -> Part:
    """Return a solid as a Part of a course; ``inwards``: the ball is inside it. Messages do not name the part.

    Raises:
        CourseError: the solid is not closed, is wound inconsistently, or has no volume.
    """
    faces = solid.faces[:, ::-1] if inwards else solid.faces
    mesh = TriangleMesh(solid.vertices, faces, surface, name=name)
    edge = mesh.unpaired_edge()
    if edge is not None:
        start, end = (tuple(corner) for corner in np.round(edge, 6).tolist())
        raise CourseError(
            f"expected a closed solid, received one that is open, or wound two ways, at the edge from {start} to "
            f"{end}; close the hole there, or turn the faces."
        )
    if not abs(mesh.volume) > 0.0:
        raise CourseError("expected a closed solid, received one without volume; give it a thickness.")
    return Part(name, mesh, material, color)


def _parse_color(color: str) -> Color:
    red, green, blue = (int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue


def _default_bounds(file: CourseFile, parts: tuple[Part, ...]) -> tuple[Point3, Point3]:
    """Return bounds around the lanes and their borders, or around all meshes if there is no lane."""
    lanes = [record for record in file.parts if isinstance(record, LanePart)]
    if not lanes:
        points = np.concatenate([part.mesh.vertices for part in parts])
        low = points.min(axis=0).tolist()
        high = points.max(axis=0).tolist()
        return (low[0], low[1], low[2] - BOUNDS_BELOW_FLOOR), (high[0], high[1], high[2] + BOUNDS_ABOVE_FLOOR)
    area = shapely.union_all([_outline_with_border(lane) for lane in lanes])
    left, front, right, back = area.bounds
    levels = [lane.level for lane in lanes]
    return (left, front, min(levels) - BOUNDS_BELOW_FLOOR), (right, back, max(levels) + BOUNDS_ABOVE_FLOOR)


def _outline_with_border(lane: LanePart) -> ShapelyPolygon:
    area = build_outline(lane.outline)
    return area.buffer(lane.border, join_style="mitre") if lane.border else area


def _find_obstacles(file: CourseFile) -> Iterator[ShapelyPolygon]:
    """Yield the outlines of upright parts that stand on the floors, as far as they have one."""
    rim = 0.0 if file.cup is None else file.cup.position[2]
    for record in file.parts:
        if isinstance(record, BlockPart) and not record.inwards and record.bottom <= rim < record.top:
            yield build_outline(record.outline, record.holes)
        elif isinstance(record, RevolvedPart):
            yield circle_polygon(record.at, max(radius for radius, _ in record.profile))
        elif isinstance(record, CylinderPart):
            yield circle_polygon(record.at[:2], record.radius)
