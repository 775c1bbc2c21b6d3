"""Assembly of a Course from its description: every part becomes closed solids, and the cup is cut."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import shapely
from trimesh import Trimesh

from minigolf_env._validation import one_of, quote, quote_error
from minigolf_env.courses.course import Color, Course, CourseError, Cup, Material, Part, Point3, Tee, course_errors
from minigolf_env.courses.geometry.cup import build_cup_liner
from minigolf_env.courses.geometry.ground import snap_to_ground
from minigolf_env.courses.geometry.outlines import build_outline
from minigolf_env.courses.geometry.parts import PartContext, PartSolid, build_part_solids, contains_cup, cup_level
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

BOUNDS_ABOVE_PARTS = 0.3
"""Distance from the highest point of all parts up to the default bounds, m, at least."""


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
            f"course {quote(file.name)}: its geometry cannot be built: {type(error).__name__}: "
            f"{quote_error(error)}; "
            "simplify its outlines and meshes, and make sure that each has an area or a volume."
        ) from error


def _replace_cup_radius(file: CourseFile, cup_radius: float | None) -> CourseFile:
    if cup_radius is None:
        return file
    if file.cup is None:
        raise CourseError(
            f"cup_radius: expected None for {quote(file.name)}, which has no cup, received {quote(cup_radius)}."
        )
    if file.cup.cut and cup_radius != file.cup.radius:
        raise CourseError(
            f"cup_radius: expected None for {quote(file.name)}, whose cup is already cut, received {quote(cup_radius)}."
        )
    return file.model_copy(update={"cup": file.cup.model_copy(update={"radius": cup_radius})})


def _assemble(file: CourseFile, load_mesh: Callable[[str], Trimesh], limits: Limits) -> Course:
    with course_errors(f"course {quote(file.name)}"):
        cup = _build_cup(file)
        tee = _build_tee(file.tee)
        context = PartContext(None, tuple(_find_obstacles(file)), limits, load_mesh, {})
        if file.cup is not None and cup is not None and not file.cup.cut:
            cup = _snap_cup(file, cup, context)
            context = context._replace(cup=cup)
        parts = tuple(_build_parts(file, cup, context))
        tee = _snap_tee(tee, parts)
        bounds = file.bounds or _default_bounds(file, parts)
        if file.bounds is None:
            _check_within(bounds, tee, cup, file.ball_radius)
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


def _build_cup(file: CourseFile) -> Cup | None:
    if file.cup is None:
        return None
    with course_errors("cup", "cup"):
        cup = Cup(file.cup.position, file.cup.radius, file.cup.depth)
        cup.check_ball_fits(file.ball_radius)
        return cup


def _build_tee(tee: TeeRecord) -> Tee:
    lower, upper = (tee.at, tee.at) if tee.at is not None else (tee.lower, tee.upper)
    if lower is None or upper is None:
        raise CourseError("tee: expected either at, or both lower and upper.")
    with course_errors("tee", "tee"):
        return Tee(lower, upper, tee.height)


def _part_name(file: CourseFile, number: int) -> str:
    """Return the name of a part, or its kind and number."""
    record = file.parts[number]
    return record.name or f"{record.kind} {number + 1}"


def _snap_cup(file: CourseFile, cup: Cup, context: PartContext) -> Cup:
    """Return the cup with its rim exactly on the level of the floor that it is cut into."""
    levels = []
    for number, record in enumerate(file.parts):
        with course_errors(f"part {quote(_part_name(file, number))}", "parts", number):
            levels.append(cup_level(record, cup, context))
    x, y, rim = cup.position
    return dataclasses.replace(cup, position=(x, y, max((z for z in levels if z is not None), default=rim)))


def _snap_tee(tee: Tee, parts: Sequence[Part]) -> Tee:
    """Return the tee with its height exactly on the ground, if that is within rounding of it."""
    places = list(itertools.product(*zip(tee.lower, tee.centre, tee.upper, strict=True)))
    return dataclasses.replace(tee, height=snap_to_ground((part.mesh.triangles for part in parts), places, tee.height))


def _check_within(bounds: tuple[Point3, Point3], tee: Tee, cup: Cup | None, ball_radius: float) -> None:
    """Raise a CourseError if the tee or the cup is outside the default bounds, which hold all floors."""
    height = tee.height + ball_radius
    places = [("tee", (*corner, height)) for corner in (tee.lower, tee.upper)]
    if cup is not None:
        places.append(("cup", cup.position))
    for name, place in places:
        if not all(low < value < high for low, value, high in zip(bounds[0], place, bounds[1], strict=True)):
            with course_errors(name, name):
                raise CourseError(
                    f"expected a place over a floor, received {place}, outside the box around all floors, "
                    f"{bounds[0]} to {bounds[1]}; move the {name}, or give `bounds`."
                )


def _build_parts(file: CourseFile, cup: Cup | None, context: PartContext) -> Iterator[Part]:
    surfaces = collect_surfaces(file.surfaces)
    is_cup_missing = context.cup is not None
    triangles = 0
    for number, record in enumerate(file.parts):
        name = _part_name(file, number)
        with course_errors(f"part {quote(name)}", "parts", number):
            for solid in build_part_solids(record, context):
                triangles += len(solid.mesh.faces)
                context.limits.check_triangles(triangles)
                yield _finish_part(name, record, solid, surfaces)
                # The cup follows the first solid of the part that it is cut into.
                if file.cup is not None and is_cup_missing and cup is not None and contains_cup(record, cup, context):
                    with course_errors("cup", "cup", "surface"):
                        lining = surfaces[one_of(file.cup.surface, tuple(surfaces), "surface")]
                    yield make_part("cup", build_cup_liner(cup), lining.material, lining.surface)
                    is_cup_missing = False
    if is_cup_missing and cup is not None:
        with course_errors("cup", "cup"):
            raise CourseError(
                f"position: expected a place on a lane or a floor, at its level, received {cup.position}; "
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
    # Parts may reach beyond: ground that rises or falls, floors that are meshes.
    points = np.concatenate([part.mesh.vertices for part in parts])
    low = np.minimum((left, front, min(levels) - BOUNDS_BELOW_FLOOR), points.min(axis=0)).tolist()
    above_parts = np.add(points.max(axis=0), (0.0, 0.0, BOUNDS_ABOVE_PARTS))
    high = np.maximum((right, back, max(levels) + BOUNDS_ABOVE_FLOOR), above_parts).tolist()
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


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
