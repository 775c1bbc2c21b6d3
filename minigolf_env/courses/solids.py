"""Closed solids from outlines and profiles, and the floor with its cup: what bundled courses are made of.

Outlines are polygons in plan, profiles run from the axis round to the axis as (radius, z) points; metres, z up.
Builders import this module, and with it trimesh and shapely, when a course is loaded: both are heavy.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from shapely import Point, Polygon
from trimesh import Trimesh

from minigolf_env.courses.course import Color, CourseError, Cup, Material, Part
from minigolf_env.physics import Surface, TriangleMesh

Outline: TypeAlias = Any
"""A shapely Polygon; shapely carries no types."""

SIDES = 64
"""Sides of everything round: a ball meets a turn of 5.6 degrees, and a cup's corners are 0.07 mm outside its circle."""

LINER = 0.003
"""Thickness of the cup's wall and bottom, m: the rim one sees around the hole."""

ROOT = 0.05
"""How deep borders and obstacles stand in the floor, m: there is no seam for a ball to find."""

SLAB = 0.02
"""What the floor is thicker than the cup is deep, m."""


def extruded(outline: Outline, bottom: float, top: float) -> Trimesh:
    """Return the solid over an outline between two levels, m."""
    solid = trimesh.creation.extrude_polygon(outline, top - bottom)
    solid.apply_translation((0.0, 0.0, bottom))
    return solid


def revolved(profile: ArrayLike, axis: tuple[float, float], sides: int = SIDES) -> Trimesh:
    """Return the solid that a profile (K, 2), counter-clockwise, sweeps around a vertical axis: a prism of ``sides``.

    The circles of the profile's radii lie inside the prism and touch the middle of each side, as in ``disc``.
    """
    solid = trimesh.creation.revolve(np.multiply(profile, (_corner(sides), 1.0)), sections=sides)
    solid.apply_translation((*axis, 0.0))
    return solid


def disc(axis: tuple[float, float], radius: float, sides: int = SIDES) -> Outline:
    """Return the regular polygon around a circle of the given radius, m."""
    turns = np.arange(sides) * (2.0 * math.pi / sides)
    return Polygon(np.column_stack([np.cos(turns), np.sin(turns)]) * (radius * _corner(sides)) + axis)


def prism(profile: Outline, start: ArrayLike, end: ArrayLike) -> Trimesh:
    """Return the solid that an upright outline, (to the left, up), sweeps along the line from start to end (3,), m.

    Raises:
        CourseError: the line is upright or has no length.
    """
    way = np.subtract(end, start)
    length, level = float(np.linalg.norm(way)), float(np.hypot(*way[:2]))
    if not level > 1e-6:
        raise CourseError(f"expected a line that is not upright, received {start!r} to {end!r}; move its end.")
    left, ahead = np.array([-way[1], way[0], 0.0]) / level, way / length
    place = np.eye(4)
    place[:3, :3] = np.column_stack([left, np.cross(ahead, left), ahead])
    place[:3, 3] = start
    solid = trimesh.creation.extrude_polygon(profile, length)
    solid.apply_transform(place)
    return solid


def loop(radius: float, width: float, shift: float, rail: float, thickness: float, sides: int) -> Trimesh:
    """Return a trough that turns over once, from the origin along x, and comes down ``shift`` further to the left.

    Its cross-section is a U with rails to both sides; its inner surface has ``sides`` facets around, touches the floor
    z = 0 at both ends, and its sideways way is a smooth step. All in m.
    """
    half, out = 0.5 * width, 0.5 * width + thickness
    # (to the left, inwards), counter-clockwise seen against the way.
    section = np.array(
        [
            (-out, rail),
            (-out, -thickness),
            (out, -thickness),
            (out, rail),
            (half, rail),
            (half, 0),
            (-half, 0),
            (-half, rail),
        ]
    )
    share = np.linspace(0.0, 1.0, sides + 1)[:, None]
    angle = 2.0 * math.pi * share
    reach = radius - section[:, 1]
    x, z = reach * np.sin(angle), radius - reach * np.cos(angle)
    y = section[:, 0] + shift * share**2 * (3.0 - 2.0 * share)
    k = len(section)
    a = (np.arange(sides)[:, None] * k + np.arange(k)).ravel()
    b = (np.arange(sides)[:, None] * k + (np.arange(k) + 1) % k).ravel()
    # All quads of a facet are cut alike, so that the facet across the trough stays one plane as far as it is one.
    walls = np.concatenate([np.c_[a, b, b + k], np.c_[a, b + k, a + k]])
    caps = np.array([(0, 1, 6), (0, 6, 7), (1, 2, 5), (1, 5, 6), (2, 3, 4), (2, 4, 5)])
    faces = np.concatenate([walls, caps[:, ::-1], caps + sides * k])
    return Trimesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces)


def part(
    name: str,
    solid: Trimesh,
    material: Material,
    surface: Surface,
    inwards: bool = False,
    color: Color | None = None,
) -> Part:
    """Return a solid as a Part of a course; ``inwards``: the ball is inside it.

    Raises:
        CourseError: the solid is not closed, is wound inconsistently, or has no volume.
    """
    faces = solid.faces[:, ::-1] if inwards else solid.faces
    mesh = TriangleMesh(solid.vertices, faces, surface, name=name)
    if mesh.two_sided or not abs(mesh.volume) > 0.0:
        raise CourseError(
            f"part {name!r}: expected a closed solid, received {solid!r} that is open, wound inconsistently or without "
            "volume; close its holes, keep outlines simple and parts apart."
        )
    return Part(name, mesh, material, color)


def cup_hole(clear: Outline, cup: Cup) -> Outline:
    """Return the outline of the hole to cut for a cup: every place within the cup's radius is open.

    Args:
        clear: where a ball can roll, in which the cup must lie.
        cup: what to cut.

    Raises:
        CourseError: the cup reaches beyond ``clear``.
    """
    x, y, _ = cup.position
    hole = disc((x, y), cup.radius + LINER)
    if not clear.contains(hole):
        most = clear.boundary.distance(Point(x, y)) / _corner(SIDES) - LINER if clear.contains(Point(x, y)) else 0.0
        if most <= 0.0:
            raise CourseError(f"cup position: expected a place on the floor, received {cup.position}; move the cup.")
        raise CourseError(
            f"cup radius: expected less than {most:.3f} m, received {cup.radius!r}; "
            "a wider cup would cut into a border or an obstacle."
        )
    return hole


def cup_liner(cup: Cup) -> Trimesh:
    """Return the cup's wall and bottom, which fill the hole; the rim is flush with the floor and shares its edges."""
    x, y, rim = cup.position
    inner, outer = cup.radius, cup.radius + LINER
    bottom = rim - cup.depth
    under = bottom - LINER
    return revolved([(0.0, under), (outer, under), (outer, rim), (inner, rim), (inner, bottom), (0.0, bottom)], (x, y))


def _corner(sides: int) -> float:
    """Return how far a regular polygon's corners are from its centre, as a share of the inscribed circle's radius."""
    return 1.0 / math.cos(math.pi / sides)
