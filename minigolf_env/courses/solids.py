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

from minigolf_env.courses.course import CourseError, Cup, Material, Part
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


def part(name: str, solid: Trimesh, material: Material, surface: Surface, inwards: bool = False) -> Part:
    """Return a solid as a Part of a course; ``inwards``: the ball is inside it.

    Raises:
        CourseError: the solid is not closed, is wound inconsistently, or has no volume.
    """
    if not solid.is_volume:
        raise CourseError(
            f"part {name!r}: expected a closed solid, received {solid!r} that is not watertight or has no volume; "
            "keep the outline simple and its parts apart."
        )
    faces = solid.faces[:, ::-1] if inwards else solid.faces
    return Part(name, TriangleMesh(solid.vertices, faces, surface, name=name), material)


def floor_with_cup(outline: Outline, clear: Outline, cup: Cup, felt: Surface, lining: Surface) -> tuple[Part, Part]:
    """Return the floor, its top at the cup's rim, with a hole cut for the cup, and the cup's liner that fills the hole.

    Every place within the cup's radius is open: the hole is the polygon around the circle. The liner's rim is flush
    with the floor and shares its edges.

    Args:
        outline: the floor's.
        clear: the part of it where a ball can roll, in which the cup must lie.
        cup: what to cut.
        felt: the floor's surface.
        lining: the cup's.

    Raises:
        CourseError: the cup reaches beyond ``clear``.
    """
    x, y, rim = cup.position
    hole = disc((x, y), cup.radius + LINER)
    if not clear.contains(hole):
        most = clear.boundary.distance(Point(x, y)) / _corner(SIDES) - LINER
        raise CourseError(
            f"cup radius: expected less than {most:.3f} m, received {cup.radius!r}; "
            "a wider cup would cut into a border or an obstacle."
        )
    inner, outer = cup.radius, cup.radius + LINER
    bottom = rim - cup.depth
    under = bottom - LINER
    profile = [(0.0, under), (outer, under), (outer, rim), (inner, rim), (inner, bottom), (0.0, bottom)]
    liner = revolved(profile, (x, y))
    slab = extruded(outline - hole, bottom - SLAB, rim)
    return part("floor", slab, "felt", felt), part("cup", liner, "cup", lining)


def _corner(sides: int) -> float:
    """Return how far a regular polygon's corners are from its centre, as a share of the inscribed circle's radius."""
    return 1.0 / math.cos(math.pi / sides)
