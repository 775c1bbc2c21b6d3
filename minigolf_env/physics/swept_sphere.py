"""Time of impact of a swept sphere and one triangle, exact to rounding.

Let phi(t) = distance(p + t w, triangle) - radius be the gap at the fraction t of the path. The first hit is the first
zero of phi. It is found in two steps:

1. A sphere cannot touch a triangle before it touches the triangle's plane. Where it touches the plane over the face,
   that is the hit, in closed form.
2. Elsewhere the hit can only be at an edge or a vertex. The distance from a point on a line to a convex set is convex
   in t, so that Newton's method on phi, started when the plane is touched, rises monotonically to the first zero: it
   can neither overshoot nor miss it. Cheap bounds reject most triangles that stay out of reach before it starts.

Example: a sphere of radius 0.2 falls by 1 onto the triangle (0, 0, 0), (1, 0, 0), (0, 1, 0). From (0.2, 0.2, 1) it
touches the plane at t = (1 - 0.2) / 1 = 0.8, with its centre over the face: alpha = 0.8, normal (0, 0, 1).
From (0.5, -0.1, 1) its centre is not over the face then; Newton's method finds the edge at t = 1 - sqrt(0.03) = 0.83.

All is computed relative to the sphere's start, so that vertices are small numbers where it matters.
"""

from __future__ import annotations

import math

import numpy as np

from minigolf_env.physics.jit import device_function
from minigolf_env.physics.types import Vec3
from minigolf_env.physics.vec3 import add, dot, mul_add, norm, scale, sub, vec3

ALPHA_MISS = 1.0
"""Hit fraction of a path without a hit."""

ALPHA_DEFERRED = 2.0
"""Stands for a hit fraction where the face is not hit and the edges have not been tested yet."""

PARALLEL_TOLERANCE = 2.0**-47
"""Largest ratio of approach speed to speed that is rounding (some units in the last place), not an approach."""

MAX_NEWTON_ITERATIONS = 64
"""Maximum number of Newton iterations; 3 on average and 18 at most for the edges and vertices in the reference data.
Stopping at the maximum gives an early time of impact, never a late one."""

CULLING_MARGIN = 2.0
"""Margin by which boxes and triangles are culled beyond the ball's radius, in eps: one for touching, one for rounding,
so that no tie is lost."""

CLEARANCE_MARGIN = 0.875
"""Tolerance of the test that rejects triangles beyond an edge, in eps: the other eighth is for rounding, so that what
the test rejects never gets deeper than eps."""


@device_function
def closest_on_segment(a: Vec3, ab: Vec3) -> Vec3:
    """Return the point closest to the origin on the segment from a to a + ab (which may be a point)."""
    length_sq = dot(ab, ab)
    if length_sq == 0.0:
        return a
    return mul_add(a, min(1.0, max(0.0, -dot(a, ab) / length_sq)), ab)


@device_function
def closest_point(a: Vec3, e: Vec3, f: Vec3, n: Vec3, dual_u: Vec3, dual_v: Vec3) -> Vec3:
    """Return the closest point to the origin of a triangle, given as in TRIANGLE_DTYPE with a relative to the origin.

    Over the face it is the origin's projection on the plane, elsewhere the nearest point of the edges that the origin
    is beyond. Near an edge both are the same point, so that a wrong choice by rounding does no harm. A triangle
    without area is its edges.
    """
    x, y = -dot(a, dual_u), -dot(a, dual_v)
    best_sq = math.inf
    q = scale(n, dot(a, n))
    if y <= 0.0:
        best_sq, q = _nearer_point(best_sq, q, closest_on_segment(a, e))
    if x <= 0.0:
        best_sq, q = _nearer_point(best_sq, q, closest_on_segment(a, f))
    if x + y >= 1.0:
        best_sq, q = _nearer_point(best_sq, q, closest_on_segment(add(a, e), sub(f, e)))
    return q


@device_function
def _nearer_point(best_sq: float, q: Vec3, candidate: Vec3) -> tuple[float, Vec3]:
    """Return the nearer of a candidate and the point q, and its squared distance from the origin."""
    distance_sq = dot(candidate, candidate)
    if distance_sq < best_sq:
        return distance_sq, candidate
    return best_sq, q


@device_function
def sweep_triangle(
    p: Vec3, w: Vec3, radius: float, eps: float, triangle: np.void, max_fraction: float, test_edges: bool
) -> tuple[float, Vec3]:
    """Return the fraction of the path p to p + w before a sphere first hits a triangle, and the unit contact normal.

    A hit is touching (within eps) and approaching such that the rest of the path is somewhere deeper than eps. The
    fraction is in [0, 1), ``ALPHA_MISS`` without a hit up to ``max_fraction``. Without ``test_edges`` it may be
    ``ALPHA_DEFERRED``: edges are most of the work, and a smaller ``max_fraction``, from other faces, may avoid it.
    """
    # Reject a one-sided triangle from behind, and a path that stays on one side of the plane and clear of it.
    n = vec3(triangle["n"])
    wn = dot(w, n)
    if triangle["one_sided"] and wn >= 0.0:
        return ALPHA_MISS, n
    a = sub(vec3(triangle["a"]), p)
    height = -dot(a, n)
    if min(height, height + wn) >= radius - eps or max(height, height + wn) <= eps - radius:
        return ALPHA_MISS, n

    # Find when the sphere touches the plane: no hit is earlier. Over the face, that is the hit.
    dual_u = vec3(triangle["dual_u"])
    dual_v = vec3(triangle["dual_v"])
    t = 0.0
    gap = abs(height) - radius
    rate = abs(wn)
    if height * wn < 0.0:
        if gap > eps:
            t = gap / rate
        if t > max_fraction:
            return ALPHA_MISS, n
        t_deep = max(t, (gap + eps) / rate)
        if (
            gap >= -2.0 * eps
            and is_approaching(-rate, w)
            and _is_over_face(-dot(a, dual_u), -dot(a, dual_v), dot(w, dual_u), dot(w, dual_v), t)
            and _is_over_face(-dot(a, dual_u), -dot(a, dual_v), dot(w, dual_u), dot(w, dual_v), t_deep)
        ):
            return t, scale(n, math.copysign(1.0, height))

    # Reject triangles that the sphere surely stays clear of.
    if not may_overlap(a, n, dual_u, dual_v, w, t, max_fraction, radius + CULLING_MARGIN * eps):
        return ALPHA_MISS, n
    if not test_edges:
        return ALPHA_DEFERRED, n
    if _stays_clear(a, n, dual_u, dual_v, w, t, radius - CLEARANCE_MARGIN * eps):
        return ALPHA_MISS, n

    # Find the time of impact with an edge or a vertex.
    e = vec3(triangle["e"])
    f = vec3(triangle["f"])
    t, normal = _first_contact_newton(a, e, f, n, dual_u, dual_v, w, t, radius, eps, max_fraction)

    # A hit at an edge with the centre at the distance of the radius from the plane (within 2 eps) is a ball that rolls
    # over a seam: it has the face's normal, and only counts if the ball approaches the face.
    if abs(height + t * wn) >= radius - 2.0 * eps and height * wn < 0.0:
        if not is_approaching(-abs(wn), w):
            return ALPHA_MISS, n
        normal = scale(n, math.copysign(1.0, height))
    return t, normal


@device_function
def is_approaching(rate: float, w: Vec3) -> bool:
    """Return whether a distance that changes by ``rate`` over the path w shrinks, by more than rounding."""
    return rate < 0.0 and rate * rate > PARALLEL_TOLERANCE * PARALLEL_TOLERANCE * dot(w, w)


@device_function
def _is_over_face(x0: float, y0: float, rate_x: float, rate_y: float, t: float) -> bool:
    """Return whether the centre is over the face at t, given two barycentric coordinates at 0 and their rates."""
    x = x0 + t * rate_x
    y = y0 + t * rate_y
    return x > 0.0 and y > 0.0 and x + y < 1.0


@device_function
def may_overlap(
    a: Vec3, n: Vec3, dual_u: Vec3, dual_v: Vec3, w: Vec3, t: float, end: float, inflated_radius: float
) -> bool:
    """Return whether the centre may be within ``inflated_radius`` of a triangle from t to ``end``; false is certain.

    Cheaper than a distance: it uses the height over the plane, and how far the centre stays beyond one of the edges.
    Branch-free, for SIMD loops.
    """
    # Intersect the inflated sphere with the plane at the lowest height on the path: there the circle is largest.
    height_start = dot(a, n) - t * dot(w, n)
    height_end = dot(a, n) - end * dot(w, n)
    lowest = min(abs(height_start), abs(height_end)) if height_start * height_end > 0.0 else 0.0
    in_plane_radius_sq = inflated_radius * inflated_radius - lowest * lowest

    # Barycentric coordinates x, y and 1 - x - y: the centre is beyond an edge where the coordinate of the opposite
    # vertex is negative at both ends.
    x_start, y_start = t * dot(w, dual_u) - dot(a, dual_u), t * dot(w, dual_v) - dot(a, dual_v)
    x_end, y_end = end * dot(w, dual_u) - dot(a, dual_u), end * dot(w, dual_v) - dot(a, dual_v)
    x = max(x_start, x_end)
    y = max(y_start, y_end)
    rest = max(1.0 - x_start - y_start, 1.0 - x_end - y_end)
    dual_uv = add(dual_u, dual_v)
    is_clear = (x < 0.0) & (x * x > in_plane_radius_sq * dot(dual_u, dual_u))
    is_clear |= (y < 0.0) & (y * y > in_plane_radius_sq * dot(dual_v, dual_v))
    is_clear |= (rest < 0.0) & (rest * rest > in_plane_radius_sq * dot(dual_uv, dual_uv))
    return not (is_clear | (in_plane_radius_sq < 0.0))


@device_function
def _stays_clear(a: Vec3, n: Vec3, dual_u: Vec3, dual_v: Vec3, w: Vec3, t: float, min_distance: float) -> bool:
    """Return whether the centre stays ``min_distance`` away from a triangle from t on: true only if it surely does.

    A triangle lies in the half plane behind each of its edges and is no nearer than that. For a ball that rolls off
    over an edge, nearly along the tangent, Newton's method takes a dozen iterations, and this test a division.
    """
    height = -dot(a, n)
    height_rate = dot(w, n)
    x, y = -dot(a, dual_u), -dot(a, dual_v)
    rate_x, rate_y = dot(w, dual_u), dot(w, dual_v)
    dual_uv = add(dual_u, dual_v)
    return (
        _stays_clear_of_edge(-x, -rate_x, dot(dual_u, dual_u), height, height_rate, t, min_distance)
        or _stays_clear_of_edge(-y, -rate_y, dot(dual_v, dual_v), height, height_rate, t, min_distance)
        or _stays_clear_of_edge(
            x + y - 1.0, rate_x + rate_y, dot(dual_uv, dual_uv), height, height_rate, t, min_distance
        )
    )


@device_function
def _stays_clear_of_edge(
    edge_coordinate: float,
    rate: float,
    scale_sq: float,
    height: float,
    height_rate: float,
    t: float,
    min_distance: float,
) -> bool:
    """Return whether the centre, where nearest to an edge's line, is beyond the edge and ``min_distance`` from it.

    ``edge_coordinate`` is positive beyond the edge: the distance across the edge times the root of ``scale_sq``. It
    changes by ``rate`` over the path. Without area all are zero, and the result is false.
    """
    nearest = -(edge_coordinate * rate + scale_sq * height * height_rate) / (
        rate * rate + scale_sq * height_rate * height_rate
    )
    nearest = min(1.0, max(t, nearest))
    across = edge_coordinate + nearest * rate
    up = height + nearest * height_rate
    return across > 0.0 and across * across + scale_sq * up * up >= scale_sq * min_distance * min_distance


@device_function
def _first_contact_newton(
    a: Vec3,
    e: Vec3,
    f: Vec3,
    n: Vec3,
    dual_u: Vec3,
    dual_v: Vec3,
    w: Vec3,
    t: float,
    radius: float,
    eps: float,
    max_fraction: float,
) -> tuple[float, Vec3]:
    """Return the hit as ``sweep_triangle`` does, by Newton's method from a fraction t that is not too late."""
    normal = n
    for _ in range(MAX_NEWTON_ITERATIONS):
        # Evaluate the gap and its rate.
        q = closest_point(mul_add(a, -t, w), e, f, n, dual_u, dual_v)
        distance = norm(q)
        normal = _contact_normal(q, distance, w, n)
        gap = distance - radius
        rate = dot(normal, w)

        # The gap is convex: once it does not shrink, it never will.
        if not is_approaching(rate, w):
            return ALPHA_MISS, normal

        # Touching is a hit only if the rest of the path is somewhere deeper than eps.
        if gap <= eps:
            if gap + (1.0 - t) * rate >= -eps or not _penetrates(a, e, f, n, dual_u, dual_v, w, t, radius - eps):
                return ALPHA_MISS, normal
            return t, normal

        # Take a Newton step, until rounding leaves none.
        next_t = t - gap / rate
        if next_t >= 1.0 or next_t > max_fraction:
            return ALPHA_MISS, normal
        if next_t <= t:
            return t, normal
        t = next_t
    return t, normal


@device_function
def _penetrates(
    a: Vec3, e: Vec3, f: Vec3, n: Vec3, dual_u: Vec3, dual_v: Vec3, w: Vec3, t: float, min_distance: float
) -> bool:
    """Return whether the centre comes closer than ``min_distance`` after t, by Newton's method from a touch at t."""
    for _ in range(MAX_NEWTON_ITERATIONS):
        q = closest_point(mul_add(a, -t, w), e, f, n, dual_u, dual_v)
        distance = norm(q)
        rate = dot(_contact_normal(q, distance, w, n), w)
        if distance < min_distance:
            return True
        if not is_approaching(rate, w):
            return False
        next_t = t - (distance - min_distance) / rate
        if next_t >= 1.0:
            return False
        if next_t <= t:
            return True
        t = next_t
    return True


@device_function
def _contact_normal(q: Vec3, distance: float, w: Vec3, n: Vec3) -> Vec3:
    """Return the unit vector from the closest point q to the centre; against the motion where the centre is on it."""
    if distance > 0.0:
        return scale(q, -1.0 / distance)
    if dot(w, n) != 0.0:
        return scale(n, -math.copysign(1.0, dot(w, n)))
    # q is zero here. Written with q so that LLVM does not hoist this square root out of the loops of sweeps.
    against = sub(q, w)
    speed = norm(against)
    if speed > 0.0:
        return scale(against, 1.0 / speed)
    return n


@device_function
def closest_point_offset(triangle: np.void, p: Vec3) -> Vec3:
    """Return the vector from p to the closest point of a triangle."""
    return closest_point(
        sub(vec3(triangle["a"]), p),
        vec3(triangle["e"]),
        vec3(triangle["f"]),
        vec3(triangle["n"]),
        vec3(triangle["dual_u"]),
        vec3(triangle["dual_v"]),
    )
