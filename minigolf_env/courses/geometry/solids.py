"""Closed solids from outlines and profiles.

Outlines are polygons in the xy-plane. Profiles are (radius, z) points from the axis around to the axis. Lengths are in
metres, z points up. The modules of this package import trimesh and shapely, which load slowly; they are therefore
imported only when a course is loaded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from shapely import Polygon
from trimesh import Trimesh

from minigolf_env._validation import quote
from minigolf_env.courses.course import CourseError

ShapelyPolygon: TypeAlias = Any
"""A shapely Polygon; shapely has no type annotations."""

ROUND_SIDES = 64
"""Number of sides of round solids: neighbouring facets differ by 5.6 degrees, and a cup's corners lie 0.07 mm outside
its circle."""


def extrude(outline: ShapelyPolygon, bottom: float, top: float) -> Trimesh:
    """Return the solid over an outline between two levels, m."""
    solid = trimesh.creation.extrude_polygon(outline, top - bottom)
    solid.apply_translation((0.0, 0.0, bottom))
    return solid


def revolve(profile: ArrayLike, axis: tuple[float, float], sides: int = ROUND_SIDES) -> Trimesh:
    """Return the solid that a profile (K, 2), counter-clockwise, sweeps around a vertical axis, with ``sides`` sides.

    The circles of the profile's radii lie inside the solid and touch the middle of each side, as in ``circle_polygon``.
    """
    solid = trimesh.creation.revolve(np.multiply(profile, (corner_ratio(sides), 1.0)), sections=sides)
    solid.apply_translation((*axis, 0.0))
    return solid


def circle_polygon(center: tuple[float, float], radius: float, sides: int = ROUND_SIDES) -> ShapelyPolygon:
    """Return the regular polygon circumscribed about a circle of a radius, m."""
    angles = np.arange(sides) * (2.0 * math.pi / sides)
    return Polygon(np.column_stack([np.cos(angles), np.sin(angles)]) * (radius * corner_ratio(sides)) + center)


def corner_ratio(sides: int) -> float:
    """Return the distance of a regular polygon's corners from its centre, in radii of its inscribed circle."""
    return 1.0 / math.cos(math.pi / sides)


def sweep_along_line(profile: ShapelyPolygon, start: ArrayLike, end: ArrayLike) -> Trimesh:
    """Return the solid that an upright profile, (to the left, up), sweeps along the line from start to end (3,), m.

    Raises:
        CourseError: the line is vertical or has no length.
    """
    delta = np.subtract(end, start)
    length = float(np.linalg.norm(delta))
    horizontal_length = float(np.hypot(*delta[:2]))
    if not horizontal_length > 1e-6:
        raise CourseError(
            f"expected a line that is not upright, received {quote(start)} to {quote(end)}; move its end."
        )
    left = np.array([-delta[1], delta[0], 0.0]) / horizontal_length
    forward = delta / length
    transform = np.eye(4)
    transform[:3, :3] = np.column_stack([left, np.cross(forward, left), forward])
    transform[:3, 3] = start
    solid = trimesh.creation.extrude_polygon(profile, length)
    solid.apply_transform(transform)
    return solid


def build_loop_track(radius: float, width: float, shift: float, rail: float, thickness: float, sides: int) -> Trimesh:
    """Return a trough that turns over once, from the origin along x, and comes down ``shift`` further to the left.

    Its cross-section is a U with rails on both sides. Its inner surface has ``sides`` facets around and touches the
    floor z = 0 at both ends. Its displacement to the left is a smoothstep of the angle. All lengths in m.
    """
    half = 0.5 * width
    out = 0.5 * width + thickness
    # Corners of the cross-section, (to the left, inwards), counter-clockwise seen against the direction of travel.
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
    # Place the cross-section at each angle of the loop.
    fraction = np.linspace(0.0, 1.0, sides + 1)[:, None]
    angle = 2.0 * math.pi * fraction
    distance = radius - section[:, 1]
    x = distance * np.sin(angle)
    z = radius - distance * np.cos(angle)
    y = section[:, 0] + shift * fraction**2 * (3.0 - 2.0 * fraction)
    # Connect neighbouring cross-sections by quads and close both ends. All quads of a facet are divided along the same
    # diagonal, so that the facet across the trough stays as close to one plane as it can.
    k = len(section)
    a = (np.arange(sides)[:, None] * k + np.arange(k)).ravel()
    b = (np.arange(sides)[:, None] * k + (np.arange(k) + 1) % k).ravel()
    walls = np.concatenate([np.c_[a, b, b + k], np.c_[a, b + k, a + k]])
    caps = np.array([(0, 1, 6), (0, 6, 7), (1, 2, 5), (1, 5, 6), (2, 3, 4), (2, 4, 5)])
    faces = np.concatenate([walls, caps[:, ::-1], caps + sides * k])
    return Trimesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces)


def join_meshes(meshes: Sequence[Trimesh]) -> Trimesh:
    """Return several meshes as one, with coinciding vertices merged."""
    return Trimesh(*trimesh.util.append_faces([mesh.vertices for mesh in meshes], [mesh.faces for mesh in meshes]))
