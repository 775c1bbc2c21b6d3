"""The time of first contact of a moving sphere with one triangle, exact to rounding.

A triangle is not met before its plane; where the sphere meets the plane within the triangle, that is the contact, in
closed form. Elsewhere it can only be at the border. The distance from a point on a line to a convex set is convex in
time, so Newton's method on phi(t) = distance(p + t w, triangle) - r, from the time of the plane on, rises monotonically
to the first contact and can neither pass nor miss it; triangles that stay out of reach are told apart before it starts.
Everything is computed relative to the sphere's start: corners are small numbers where it matters.
"""

from __future__ import annotations

import math

import numpy as np

from minigolf_env.physics.jit import kernel
from minigolf_env.physics.types import Vec3
from minigolf_env.physics.vec3 import add, along, dot, norm, scale, sub, vec3

MISS = 1.0
"""The share of the path of a sphere that meets nothing."""

LATER = 2.0
"""Stands for the share of a path that may end at a triangle's border, which is not looked at yet."""

PARALLEL = 2.0**-47
"""An approach slower than this share of the speed is rounding (some units in the last place), not an approach."""

MAX_NEWTON = 64
"""Iterations; 3 on average and 18 at most for the borders met in the reference data. Stopping early is never late."""


@kernel
def closest_on_segment(a: Vec3, ab: Vec3) -> Vec3:
    """Return the point closest to the origin on the segment from a to a + ab (which may be a point)."""
    length2 = dot(ab, ab)
    if length2 == 0.0:
        return a
    return along(a, min(1.0, max(0.0, -dot(a, ab) / length2)), ab)


@kernel
def closest_point(a: Vec3, e: Vec3, f: Vec3, n: Vec3, u: Vec3, v: Vec3) -> Vec3:
    """Return the point closest to the origin of a TRIANGLE whose corner a is given relative to it.

    Above the face it is the foot on the plane, elsewhere the nearest point of the edges that the origin is beyond: near
    a border both are the same point, so a wrong choice by rounding does no harm. A triangle without area is its edges.
    """
    x, y = -dot(a, u), -dot(a, v)
    best, q = math.inf, scale(n, dot(a, n))
    if y <= 0.0:
        best, q = _closer(best, q, closest_on_segment(a, e))
    if x <= 0.0:
        best, q = _closer(best, q, closest_on_segment(a, f))
    if x + y >= 1.0:
        best, q = _closer(best, q, closest_on_segment(add(a, e), sub(f, e)))
    return q


@kernel
def _closer(best: float, q: Vec3, candidate: Vec3) -> tuple[float, Vec3]:
    distance2 = dot(candidate, candidate)
    if distance2 < best:
        return distance2, candidate
    return best, q


@kernel
def sweep_triangle(
    p: Vec3, w: Vec3, radius: float, eps: float, triangle: np.void, latest: float, borders: bool
) -> tuple[float, Vec3]:
    """Return when a sphere that moves from p to p + w first collides with a TRIANGLE, and the unit normal there.

    The time is the share of the path, in [0, 1); ``MISS`` stands for no collision, and for one later than ``latest``.
    Without ``borders`` it may be ``LATER`` instead: they are most of the work, and an earlier ``latest`` may spare it.
    Colliding is touching (within eps) and approaching so that the rest of the path would end deeper than eps.
    """
    n = vec3(triangle["n"])
    wn = dot(w, n)
    if triangle["one_sided"] and wn >= 0.0:
        return MISS, n
    a = sub(vec3(triangle["a"]), p)
    height = -dot(a, n)
    if min(height, height + wn) >= radius - eps or max(height, height + wn) <= eps - radius:
        return MISS, n
    u = vec3(triangle["u"])
    v = vec3(triangle["v"])
    t, gap, rate = 0.0, abs(height) - radius, abs(wn)
    if height * wn < 0.0:
        # A triangle is not met before its plane. Where the plane is met within the triangle, that is all.
        if gap > eps:
            t = gap / rate
        if t > latest:
            return MISS, n
        t_deep = max(t, (gap + eps) / rate)
        if (
            gap >= -2.0 * eps
            and approaches(-rate, w)
            and _is_inside(-dot(a, u), -dot(a, v), dot(w, u), dot(w, v), t)
            and _is_inside(-dot(a, u), -dot(a, v), dot(w, u), dot(w, v), t_deep)
        ):
            return t, scale(n, math.copysign(1.0, height))
    if not may_come_near(a, n, u, v, w, t, latest, radius + 2.0 * eps):
        return MISS, n
    if not borders:
        return LATER, n
    # An eighth of the tolerance is for rounding: what stays off by this never goes deeper than eps.
    if _stays_off(a, n, u, v, w, t, radius - 0.875 * eps):
        return MISS, n
    e = vec3(triangle["e"])
    f = vec3(triangle["f"])
    t, normal = _newton(a, e, f, n, u, v, w, t, radius, eps, latest)
    if abs(height + t * wn) >= radius - 2.0 * eps and height * wn < 0.0:
        # Met at a border, but flat: what a ball that rolls over a seam meets is the face, and only if it approaches.
        if not approaches(-abs(wn), w):
            return MISS, n
        normal = scale(n, math.copysign(1.0, height))
    return t, normal


@kernel
def approaches(rate: float, w: Vec3) -> bool:
    """Return whether a distance that changes at this rate on the way w shrinks, by more than rounding."""
    return rate < 0.0 and rate * rate > PARALLEL * PARALLEL * dot(w, w)


@kernel
def _is_inside(x: float, y: float, speed_x: float, speed_y: float, t: float) -> bool:
    """Return whether the centre is above the face at time t, given its coordinates along the edges at 0."""
    x, y = x + t * speed_x, y + t * speed_y
    return x > 0.0 and y > 0.0 and x + y < 1.0


@kernel
def may_come_near(a: Vec3, n: Vec3, u: Vec3, v: Vec3, w: Vec3, t: float, end: float, reach: float) -> bool:
    """Return whether the centre may be within ``reach`` of a triangle between two times: false only if it never is.

    Cheaper than a distance: the height above the plane, and how far the centre's foot stays beyond one of the edges.
    Without a branch, for loops of vector instructions.
    """
    height, height_end = dot(a, n) - t * dot(w, n), dot(a, n) - end * dot(w, n)
    lowest = min(abs(height), abs(height_end)) if height * height_end > 0.0 else 0.0
    room = reach * reach - lowest * lowest
    x, y = t * dot(w, u) - dot(a, u), t * dot(w, v) - dot(a, v)
    x_end, y_end = end * dot(w, u) - dot(a, u), end * dot(w, v) - dot(a, v)
    beyond_x, beyond_y, beyond_z = max(x, x_end), max(y, y_end), max(1.0 - x - y, 1.0 - x_end - y_end)
    uv = add(u, v)
    off = (beyond_x < 0.0) & (beyond_x * beyond_x > room * dot(u, u))
    off |= (beyond_y < 0.0) & (beyond_y * beyond_y > room * dot(v, v))
    off |= (beyond_z < 0.0) & (beyond_z * beyond_z > room * dot(uv, uv))
    return not (off | (room < 0.0))


@kernel
def _stays_off(a: Vec3, n: Vec3, u: Vec3, v: Vec3, w: Vec3, t: float, depth: float) -> bool:
    """Return whether the centre, from time t on, stays ``depth`` away from a triangle: true only if it surely does.

    A triangle lies in the half plane behind each of its edges and is no nearer than that: a ball that rolls off over an
    edge, touching it all but along the tangent, takes Newton's method a dozen iterations and this a division.
    """
    height, climb = -dot(a, n), dot(w, n)
    x, y, speed_x, speed_y = -dot(a, u), -dot(a, v), dot(w, u), dot(w, v)
    uv = add(u, v)
    return (
        _stays_off_edge(-x, -speed_x, dot(u, u), height, climb, t, depth)
        or _stays_off_edge(-y, -speed_y, dot(v, v), height, climb, t, depth)
        or _stays_off_edge(x + y - 1.0, speed_x + speed_y, dot(uv, uv), height, climb, t, depth)
    )


@kernel
def _stays_off_edge(
    beyond: float, speed: float, stretch: float, height: float, climb: float, t: float, depth: float
) -> bool:
    """Return whether the centre is beyond an edge when it comes nearest to its line, and ``depth`` away from it.

    ``beyond`` and its ``speed`` are lengths times the root of ``stretch``. Without area all are zero: false.
    """
    nearest = -(beyond * speed + stretch * height * climb) / (speed * speed + stretch * climb * climb)
    nearest = min(1.0, max(t, nearest))
    x, z = beyond + nearest * speed, height + nearest * climb
    return x > 0.0 and x * x + stretch * z * z >= stretch * depth * depth


@kernel
def _newton(
    a: Vec3, e: Vec3, f: Vec3, n: Vec3, u: Vec3, v: Vec3, w: Vec3, t: float, radius: float, eps: float, latest: float
) -> tuple[float, Vec3]:
    """Return the collision as ``sweep_triangle`` does, by Newton's method from a time t that is not too late."""
    normal = n
    for _ in range(MAX_NEWTON):
        q = closest_point(along(a, -t, w), e, f, n, u, v)
        distance = norm(q)
        normal = _direction(q, distance, w, n)
        gap, rate = distance - radius, dot(normal, w)
        if not approaches(rate, w):
            return MISS, normal
        if gap <= eps:
            if gap + (1.0 - t) * rate >= -eps or not _goes_deeper(a, e, f, n, u, v, w, t, radius - eps):
                return MISS, normal
            return t, normal
        next_t = t - gap / rate
        if next_t >= 1.0 or next_t > latest:
            return MISS, normal
        if next_t <= t:
            return t, normal
        t = next_t
    return t, normal


@kernel
def _goes_deeper(a: Vec3, e: Vec3, f: Vec3, n: Vec3, u: Vec3, v: Vec3, w: Vec3, t: float, depth: float) -> bool:
    """Return whether, after t, the centre comes closer than ``depth``: Newton's method once more, from a touch."""
    for _ in range(MAX_NEWTON):
        q = closest_point(along(a, -t, w), e, f, n, u, v)
        distance = norm(q)
        rate = dot(_direction(q, distance, w, n), w)
        if distance < depth:
            return True
        if not approaches(rate, w):
            return False
        next_t = t - (distance - depth) / rate
        if next_t >= 1.0:
            return False
        if next_t <= t:
            return True
        t = next_t
    return True


@kernel
def _direction(q: Vec3, distance: float, w: Vec3, n: Vec3) -> Vec3:
    """Return the unit vector from the closest point q to the centre; against the motion where the centre lies on it."""
    if distance > 0.0:
        return scale(q, -1.0 / distance)
    if dot(w, n) != 0.0:
        return scale(n, -math.copysign(1.0, dot(w, n)))
    against = sub(q, w)  # q is zero here; without it the compiler takes a root before every loop of sweeps.
    speed = norm(against)
    if speed > 0.0:
        return scale(against, 1.0 / speed)
    return n


@kernel
def offset(triangle: np.void, p: Vec3) -> Vec3:
    """Return the vector from p to the closest point of a TRIANGLE."""
    return closest_point(
        sub(vec3(triangle["a"]), p),
        vec3(triangle["e"]),
        vec3(triangle["f"]),
        vec3(triangle["n"]),
        vec3(triangle["u"]),
        vec3(triangle["v"]),
    )
