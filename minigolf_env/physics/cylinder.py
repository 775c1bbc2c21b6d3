"""Bounding cylinders of paths: while the ball's centre stays in one, only a known set of triangles can be touched.

A cylinder is convex, so that a straight path with both ends inside it stays inside. The candidate cache and the rolling
batch therefore collect the triangles near a whole cylinder once, and use them for as long as the ball stays in it.
"""

from __future__ import annotations

from typing import NamedTuple

from minigolf_env.physics.jit import device_function
from minigolf_env.physics.types import CompiledScene, Vec3
from minigolf_env.physics.vec3 import dot, mul_add, norm, scale, sub

RIM_DISTANCE_RATIO = 1.42
"""Distance from the path to the rim of its cylinder's ends, in radii: the square root of 2, rounded up."""

MIN_PATH_LENGTH = 1e-100
"""Length of a path up to which its direction is taken as zero, m: the inverse of the length stays finite."""

CYLINDER_MARGIN = 4.0
"""Margin for touching and rounding in the radius of a cylinder and of the search around it, in eps."""

RADIUS_ROUNDOFF = 1e-14
"""Part of the squared length by which the squared radius is reduced, for the rounding of ``cylinder_contains``."""


class BoundingCylinder(NamedTuple):
    """A cylinder around a path."""

    base: Vec3
    """Centre of one end, m."""
    axis: Vec3
    """Unit vector to the other end; zero for a path without length."""
    length: float
    """Distance of the ends, m; negative for no cylinder."""
    radius_sq: float
    """Squared radius, m^2."""


@device_function
def bounding_cylinder(p: Vec3, w: Vec3, radius: float) -> BoundingCylinder:
    """Return the cylinder around the path p to p + w with the given radius, which extends by it beyond both ends."""
    path_length = norm(w)
    axis = scale(w, 1.0 / path_length) if path_length > MIN_PATH_LENGTH else Vec3(0.0, 0.0, 0.0)
    length = path_length + 2.0 * radius
    return BoundingCylinder(
        mul_add(p, -radius, axis), axis, length, radius * radius - RADIUS_ROUNDOFF * length * length
    )


@device_function
def cylinder_contains(cylinder: BoundingCylinder, p: Vec3) -> bool:
    """Return whether the point p is in the cylinder; branch-free, for SIMD loops."""
    from_base = sub(p, cylinder.base)
    height = dot(from_base, cylinder.axis)
    is_between_ends = (height >= 0.0) & (height <= cylinder.length)
    return bool(is_between_ends & (dot(from_base, from_base) - height * height <= cylinder.radius_sq))


@device_function
def query_radius(scene: CompiledScene, radius: float) -> float:
    """Return the largest distance from a path of a triangle that a ball in the path's cylinder can touch, m."""
    return RIM_DISTANCE_RATIO * radius + scene.radius + CYLINDER_MARGIN * scene.eps
