"""The rolling batch: up to eight balls that roll on flat ground, advanced together with SIMD instructions.

A ball that rolls on a plane and can reach nothing else does the same in each step: it falls onto the plane (alpha = 0),
the contact is resting, and it rolls along the plane. ``step_rolling`` computes that branch-free, so that the loop
auto-vectorises, one ball in each element of a vector. It takes a tenth of the time of ``step``,
for most steps of a putt. Each operation is that of ``step`` on the same numbers, and the results are the same bits; a
ball whose next step might do anything else becomes inactive and takes that step in ``step``. Example::

    try_enter(..., slot 2, p, v)     # the next 2 to 64 steps at velocity v are over coplanar triangles
    step_rolling(scene, batch, 8)    # 8 balls, one step each
    ...                              # until the ball in slot 2 slows down, or comes near a wall: its ``active`` is 0

**Why a plane is enough.** The balls of a batch can reach coplanar triangles only: of one closed mesh, in one plane,
with the same normal to the last bit. Such a floor has no border within reach (beyond it would be a triangle of another
plane), and the projection of the ball's centre is always over a triangle, or on a seam. Let the ball touch the plane,
and let its path descend by at least MIN_PENETRATION eps. Then the sweep hits a triangle at alpha = 0 with the plane's
normal. Over the inside of a triangle this is that triangle. At a seam it is the triangle over which the ball gets
deeper than eps. The projection of the centre is then so near to that triangle's edge (see MIN_STEEPNESS) that the
distance from the edge is the height over the plane, to rounding. Other triangles hit at alpha = 0 have the same normal,
so that it does not matter which one is the first hit.
"""

from __future__ import annotations

import math

import numpy as np

from minigolf_env.physics.contact import (
    GRAZING_SPEED_RATIO,
    PROJECTION_ROUNDOFF,
    add_contact,
    normal_load,
    project_onto_cone,
    rolling_kinematics,
    rolling_resistance_deceleration,
)
from minigolf_env.physics.cylinder import (
    CYLINDER_MARGIN,
    BoundingCylinder,
    bounding_cylinder,
    cylinder_contains,
    query_radius,
)
from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.traversal import next_leaf_in_sweep, start_traversal
from minigolf_env.physics.types import INT64_ONE, INT64_ZERO, CompiledScene, FloatArray, RecordArray, Vec3
from minigolf_env.physics.vec3 import add, column, dot, mul_add, norm, scale, select, store_column, sub, vec3

SIMD_WIDTH = 8
"""Number of balls in a batch: one SIMD vector of 512 bits, or several shorter ones."""

MAX_FLAT_RUN_STEPS = 64.0
"""Maximum number of steps, at the current velocity, for which the ground ahead is searched."""

MIN_FLAT_RUN_STEPS = 2.0
"""Minimum number of steps on flat ground for which a ball enters: fewer do not pay for the search."""

COPLANAR_TOLERANCE = 0.125
"""Maximum distance of coplanar triangles from each other's plane, in eps."""

SUPPORT_TOLERANCE = 0.75
"""Maximum distance of a ball from its supporting plane, in eps: plus COPLANAR_TOLERANCE it is below 1, so that the ball
touches all coplanar triangles."""

MIN_PENETRATION = 16.0
"""Minimum descent of a path towards the plane, in eps, with which it surely hits the plane."""

MIN_STEEPNESS = 128.0
"""Minimum of (sine of the angle between path and plane)^2 radius / eps: while the ball sinks by 2 eps its centre moves
so little sideways that its distance from an edge under it is its height to within eps / 64."""

ROLLING_BATCH_DTYPE = np.dtype(
    [
        ("p", "f8", (3, SIMD_WIDTH)),  # centre of the ball, m
        ("v", "f8", (3, SIMD_WIDTH)),  # m/s
        ("vertex", "f8", (3, SIMD_WIDTH)),  # a vertex of the supporting triangle, m
        ("normal", "f8", (3, SIMD_WIDTH)),  # its unit normal
        ("tangential_gravity", "f8", (3, SIMD_WIDTH)),  # gravity along the plane, m/s^2
        ("base", "f8", (3, SIMD_WIDTH)),  # cylinder in which the centre must stay, as in BoundingCylinder
        ("axis", "f8", (3, SIMD_WIDTH)),
        ("length", "f8", (SIMD_WIDTH,)),
        ("radius_sq", "f8", (SIMD_WIDTH,)),
        ("resistance_deceleration", "f8", (SIMD_WIDTH,)),  # deceleration by rolling resistance, m/s^2
        ("restitution", "f8", (SIMD_WIDTH,)),
        ("max_resting_speed", "f8", (SIMD_WIDTH,)),  # rebound speed up to which a contact is resting, m/s
        ("ball", "i8", (SIMD_WIDTH,)),  # row of the ball in its batch of runs; -1 for an empty slot
        ("support", "i8", (SIMD_WIDTH,)),  # row of the supporting triangle
        ("max_steps", "i8", (SIMD_WIDTH,)),  # maximum of steps_done: the steps of the run that were left on entry
        ("steps_done", "i8", (SIMD_WIDTH,)),  # steps taken in the rolling batch
        ("active", "i8", (SIMD_WIDTH,)),  # 1 while the ball's steps are taken here, else 0
    ]
)
"""Rolling batch: a column (slot) for each ball."""


@kernel
def try_enter(
    scene: CompiledScene, traversal: RecordArray, contacts: FloatArray, batch: RecordArray, i: int, p: Vec3, v: Vec3
) -> bool:
    """Put a ball that rolls on slot i's supporting triangle into slot i if the ground is flat; return whether it is."""
    slots = batch[0]
    support = slots["support"][i]
    triangle = scene.triangles[support]
    if not triangle["one_sided"]:
        return False

    # Make the contact with the ground, and search the ground ahead.
    surface = scene.surfaces[triangle["surface"]]
    n = vec3(triangle["n"])
    num_contacts = add_contact(contacts, INT64_ZERO, n, surface["rolling_coefficient"])
    tangential_gravity = project_onto_cone(contacts, num_contacts, scene.gravity)
    is_flat, cylinder = _find_flat_run(scene, traversal, p, v, tangential_gravity, support)
    if not is_flat:
        return False

    # Fill the slot.
    store_column(slots["p"], i, p)
    store_column(slots["v"], i, v)
    store_column(slots["vertex"], i, vec3(triangle["a"]))
    store_column(slots["normal"], i, n)
    store_column(slots["tangential_gravity"], i, tangential_gravity)
    store_column(slots["base"], i, cylinder.base)
    store_column(slots["axis"], i, cylinder.axis)
    slots["length"][i] = cylinder.length
    slots["radius_sq"][i] = cylinder.radius_sq
    slots["resistance_deceleration"][i] = rolling_resistance_deceleration(contacts, num_contacts, scene.gravity)
    slots["restitution"][i] = surface["restitution"]
    slots["max_resting_speed"][i] = 0.5 * normal_load(scene.gravity, scene.gravity, n) * scene.dt
    slots["steps_done"][i] = 0
    slots["active"][i] = 1
    return True


@device_function
def _find_flat_run(
    scene: CompiledScene, traversal: RecordArray, p: Vec3, v: Vec3, tangential_gravity: Vec3, support: int
) -> tuple[bool, BoundingCylinder]:
    """Find how far a ball that rolls from p at velocity v has flat ground: return whether far enough, and the cylinder.

    The cylinder is wide enough for the drop of a path below its tangent by gravity, and for the deflection by the
    tangential gravity.
    """
    # Limit the time so that tangential gravity deflects the path by half a radius at most.
    time = MAX_FLAT_RUN_STEPS * scene.dt
    if norm(tangential_gravity) * time * time > scene.radius:
        time = math.sqrt(scene.radius / norm(tangential_gravity))
    min_time = MIN_FLAT_RUN_STEPS * scene.dt
    w = scale(v, time)
    drop = scene.dt * scene.dt * norm(scene.gravity)
    radius = drop + 0.5 * norm(tangential_gravity) * time * time + CYLINDER_MARGIN * scene.eps
    inflated_radius = query_radius(scene, radius)

    # Shorten the path at each triangle of another plane; look for the triangle under the ball.
    is_supported = False
    fraction = 1.0
    start_traversal(traversal)
    size = INT64_ONE
    while size > 0 and fraction * time >= min_time:
        first, size = next_leaf_in_sweep(scene.nodes, traversal, p, scale(w, fraction), inflated_radius)
        for i in range(first, first + size):
            triangle = scene.triangles[i]
            from_vertex = sub(p, vec3(triangle["a"]))
            dual_u = vec3(triangle["dual_u"])
            dual_v = vec3(triangle["dual_v"])
            x, y = dot(from_vertex, dual_u), dot(from_vertex, dual_v)
            if not _is_coplanar(scene, support, i):
                n = vec3(triangle["n"])
                fraction = min(fraction, _clear_fraction(from_vertex, n, dual_u, dual_v, w, inflated_radius))
            elif x > 0.0 and y > 0.0 and x + y < 1.0:
                is_supported = True
    return is_supported and fraction * time >= min_time, bounding_cylinder(p, scale(w, fraction), radius)


@device_function
def _is_coplanar(scene: CompiledScene, row: int, other: int) -> bool:
    """Return whether two triangles are of one mesh, in one plane, and have the same normal to the last bit."""
    a = scene.triangles[row]
    b = scene.triangles[other]
    n = vec3(a["n"])
    m = vec3(b["n"])
    between = sub(vec3(b["a"]), vec3(a["a"]))
    return bool(
        a["surface"] == b["surface"]  # Each mesh has its own row.
        and n.x == m.x
        and n.y == m.y
        and n.z == m.z
        and abs(dot(between, n)) <= COPLANAR_TOLERANCE * scene.eps
    )


@device_function
def _clear_fraction(start: Vec3, n: Vec3, dual_u: Vec3, dual_v: Vec3, w: Vec3, inflated_radius: float) -> float:
    """Return up to which fraction of the path w a point is surely beyond ``inflated_radius`` of a triangle.

    ``start`` is the start of the path relative to the triangle's corner a. The point is clear while it is far enough
    from the plane, or far enough beyond one of the edges.
    """
    height = dot(start, n)
    height_rate = dot(w, n)
    x, y = dot(start, dual_u), dot(start, dual_v)
    rate_x, rate_y = dot(w, dual_u), dot(w, dual_v)
    side = math.copysign(1.0, height)
    plane = _first_zero_fraction(side * height - inflated_radius, side * height_rate)
    edge_e = _first_zero_fraction(-y - inflated_radius * norm(dual_v), -rate_y)
    edge_f = _first_zero_fraction(-x - inflated_radius * norm(dual_u), -rate_x)
    edge_ef = _first_zero_fraction(x + y - 1.0 - inflated_radius * norm(add(dual_u, dual_v)), rate_x + rate_y)
    return max(plane, max(max(edge_f, edge_e), edge_ef))


@device_function
def _first_zero_fraction(start_value: float, rate: float) -> float:
    """Return up to which fraction in [0, 1] the linear function start_value + fraction * rate is positive."""
    if start_value <= 0.0:
        return 0.0
    return min(1.0, -start_value / rate) if rate < 0.0 else 1.0


@kernel
def step_rolling(scene: CompiledScene, batch: RecordArray, count: int) -> int:
    """Advance the active balls among the first ``count`` by one time step; return the number of balls still active.

    A ball whose step might differ from that of ``step`` in any bit becomes inactive and stays where it is.
    """
    slots = batch[0]
    num_active = 0
    radius, eps, dt, gravity = scene.radius, scene.eps, scene.dt, scene.gravity
    lower, upper = scene.lower, scene.upper
    rounding_time = GRAZING_SPEED_RATIO * dt
    for i in range(count):
        p = column(slots["p"], i)
        v = column(slots["v"], i)
        n = column(slots["normal"], i)
        cylinder = BoundingCylinder(
            column(slots["base"], i), column(slots["axis"], i), slots["length"][i], slots["radius_sq"][i]
        )

        # Fall onto the supporting plane: the ball touches it, and its path goes well into it, so that alpha is 0.
        average = mul_add(v, 0.5 * dt, gravity)
        path = scale(average, dt)
        plane_gap = dot(sub(p, column(slots["vertex"], i)), n) - radius
        height_change = dot(path, n)
        ok = cylinder_contains(cylinder, p) & cylinder_contains(cylinder, add(p, path))
        ok &= abs(plane_gap) <= SUPPORT_TOLERANCE * eps
        ok &= height_change <= -MIN_PENETRATION * eps
        ok &= height_change * height_change * radius >= MIN_STEEPNESS * eps * dot(path, path)

        # Make the contact resting: certain if the average-velocity approach is too slow, as at alpha = 0 the
        # energy-conserving one is slower.
        ok &= -slots["restitution"][i] * dot(average, n) <= slots["max_resting_speed"][i]
        falling = mul_add(v, -max(0.0, dot(v, n)), n)
        normal_speed = dot(falling, n)
        rolling_velocity = select(normal_speed < 0.0, mul_add(falling, -normal_speed, n), falling)
        speed_sq = dot(rolling_velocity, rolling_velocity)
        ok &= speed_sq > PROJECTION_ROUNDOFF * PROJECTION_ROUNDOFF * dot(falling, falling)
        ok &= speed_sq > rounding_time * rounding_time * dot(gravity, gravity)

        # Keep the contact: the ball does not separate.
        normal_speed = dot(n, rolling_velocity)
        is_grazing = normal_speed * normal_speed <= GRAZING_SPEED_RATIO * GRAZING_SPEED_RATIO * speed_sq
        ok &= (normal_speed <= 0.0) | is_grazing

        # Roll along the plane, without stopping.
        tangential_gravity = column(slots["tangential_gravity"], i)
        resistance_deceleration = slots["resistance_deceleration"][i]
        net, speed, deceleration = rolling_kinematics(rolling_velocity, tangential_gravity, resistance_deceleration)
        net = select(resistance_deceleration == 0.0, tangential_gravity, net)
        ok &= (resistance_deceleration == 0.0) | (deceleration <= 0.0) | (speed > deceleration * dt)
        path = scale(mul_add(rolling_velocity, 0.5 * dt, net), dt)
        end = add(p, path)
        ok &= cylinder_contains(cylinder, end) & (plane_gap + dot(path, n) >= -SUPPORT_TOLERANCE * eps)

        # Stay within the bounds and the number of steps.
        ok &= (lower.x <= end.x) & (end.x <= upper.x) & (lower.y <= end.y) & (end.y <= upper.y)
        ok &= (lower.z <= end.z) & (end.z <= upper.z)
        ok &= (slots["active"][i] != 0) & (slots["steps_done"][i] < slots["max_steps"][i])

        # Move the ball if all of this holds; else leave it where it is, inactive.
        store_column(slots["p"], i, select(ok, end, p))
        store_column(slots["v"], i, select(ok, mul_add(rolling_velocity, dt, net), v))
        slots["active"][i] = ok
        slots["steps_done"][i] += ok
        num_active += ok
    return num_active
