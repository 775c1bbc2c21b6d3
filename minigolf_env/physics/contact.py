"""Impact response, resting contacts, and the motion that they leave the ball.

An impact whose rebound would return to the surface within a time step becomes a resting contact: the ball slides or
rolls on the surface until it leaves it. Resting contacts are kept in a scratch array (MAX_CONTACTS, 4), a row each:
unit contact normal, rolling resistance; ``num_contacts`` counts the rows in use. They live for one time step and each
step begins without any, so that the state of a ball is its position and velocity alone.

Example: a ball at rest on a floor falls for an instant, hits the floor at alpha = 0 with a rebound that is too short,
and gets the resting contact (0, 0, 1). Projecting gravity onto the contact cone {y : y_z >= 0} leaves zero: it rests.
"""

from __future__ import annotations

import math
from typing import Any

from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.sweep import Collision
from minigolf_env.physics.types import CompiledScene, FloatArray, Vec3
from minigolf_env.physics.vec3 import cross, dot, mul_add, norm, scale, sub, vec3

MAX_CONTACTS = 8
"""Maximum number of resting contacts: three suffice for rest; a bowl of many facets may add more."""

GRAZING_SPEED_RATIO = 1e-10
"""Speed normal to a surface, divided by the speed, at or below which a contact is neither a bounce nor a separation: it
may be rounding."""

PROJECTION_ROUNDOFF = 2.0**-48
"""Rounding error of a projected vector, divided by its length: some units in the last place."""


@kernel
def add_contact(contacts: FloatArray, num_contacts: int, n: Vec3, rolling_coefficient: float) -> int:
    """Add a resting contact; return the number of contacts.

    It replaces one with the same normal (to rounding), or, if the set is full, the one with the most similar normal.
    """
    row = min(num_contacts, MAX_CONTACTS - 1)
    best_cosine = -1.0
    for i in range(num_contacts):
        cosine = dot(vec3(contacts[i]), n)
        is_same = norm(sub(vec3(contacts[i]), n)) <= PROJECTION_ROUNDOFF
        if is_same or (num_contacts == MAX_CONTACTS and cosine > best_cosine):
            row = i
            best_cosine = cosine
    contacts[row, 0] = n.x
    contacts[row, 1] = n.y
    contacts[row, 2] = n.z
    contacts[row, 3] = rolling_coefficient
    return max(num_contacts, row + 1)


@device_function
def remove_separating(contacts: FloatArray, num_contacts: int, v: Vec3) -> int:
    """Remove the contacts that the ball separates from at velocity v; return the number of those that are left."""
    num_kept = 0
    for i in range(num_contacts):
        normal_speed = dot(vec3(contacts[i]), v)
        is_grazing = normal_speed * normal_speed <= GRAZING_SPEED_RATIO * GRAZING_SPEED_RATIO * dot(v, v)
        if normal_speed <= 0.0 or is_grazing:
            for k in range(4):
                contacts[num_kept, k] = contacts[i, k]
            num_kept += 1
    return num_kept


@kernel
def project_onto_cone(contacts: FloatArray, num_contacts: int, x: Vec3) -> Vec3:
    """Return the vector closest to x in the contact cone {y : y . n >= 0 for every contact normal n}.

    It is x itself, or x projected onto one contact plane, onto the intersection line of two, or zero.
    """
    if _in_cone(contacts, num_contacts, x, num_contacts, num_contacts, 0.0):
        return x

    # One plane.
    slack = 0.0 if num_contacts == 1 else -PROJECTION_ROUNDOFF * norm(x)
    for i in range(num_contacts):
        n = vec3(contacts[i])
        y = mul_add(x, -dot(x, n), n)
        if dot(x, n) < 0.0 and _in_cone(contacts, num_contacts, y, i, i, slack):
            exceeds_roundoff = dot(y, y) > PROJECTION_ROUNDOFF * PROJECTION_ROUNDOFF * dot(x, x)
            return y if exceeds_roundoff else Vec3(0.0, 0.0, 0.0)

    # The intersection lines of two planes: of the projections in the cone, the longest is the closest to x.
    best = Vec3(0.0, 0.0, 0.0)
    for i in range(num_contacts):
        for j in range(i):
            line = _intersection_direction(vec3(contacts[i]), vec3(contacts[j]))
            y = scale(line, dot(x, line))
            if norm(y) > norm(best) and _in_cone(contacts, num_contacts, y, i, j, slack):
                best = y
    return best if norm(best) > -slack else Vec3(0.0, 0.0, 0.0)


@device_function
def _intersection_direction(n: Vec3, m: Vec3) -> Vec3:
    """Return the unit vector along the intersection line of two planes with normals n and m; zero if parallel.

    It is perpendicular to both normals to rounding. Taking m's part across n first keeps that true for planes that are
    nearly parallel, where n x m itself is not.
    """
    across = mul_add(m, -dot(m, n), n)
    if norm(across) == 0.0:
        return across
    return cross(n, scale(across, 1.0 / norm(across)))


@device_function
def _in_cone(contacts: FloatArray, num_contacts: int, x: Vec3, i: int, j: int, slack: float) -> bool:
    """Return whether x . n >= slack for every contact but i and j, in whose planes x lies.

    ``slack`` is 0, or slightly negative: a projected vector may enter another contact by its rounding error.
    """
    for k in range(num_contacts):
        if k != i and k != j and dot(vec3(contacts[k]), x) < slack:
            return False
    return True


@device_function
def rolling_resistance_deceleration(contacts: FloatArray, num_contacts: int, gravity: Vec3) -> float:
    """Return the deceleration R of a rolling ball, m/s^2: the sum of each contact's coefficient times its load."""
    total = 0.0
    for i in range(num_contacts):
        total += contacts[i, 3] * max(0.0, -dot(gravity, vec3(contacts[i])))
    return total


@device_function
def apply_rolling_resistance(
    v: Vec3, acceleration: Vec3, resistance_deceleration: float, time_left: float
) -> tuple[Vec3, float, bool]:
    """Return (net acceleration, duration, stops) of a sub-step that lasts at most ``time_left``.

    The resistance acts against v, or against the acceleration of a ball without velocity. The sub-step ends where the
    velocity along its first direction reaches zero (``stops``). A ball at rest gets zero acceleration and duration.
    """
    if dot(v, v) == 0.0:
        driving_acceleration = norm(acceleration)
        if driving_acceleration <= resistance_deceleration:
            return Vec3(0.0, 0.0, 0.0), 0.0, True
        return scale(acceleration, 1.0 - resistance_deceleration / driving_acceleration), time_left, False
    if resistance_deceleration == 0.0:
        return acceleration, time_left, False
    net, speed, deceleration = rolling_kinematics(v, acceleration, resistance_deceleration)
    if deceleration > 0.0 and speed <= deceleration * time_left:
        return net, speed / deceleration, True
    return net, time_left, False


@device_function
def rolling_kinematics(v: Vec3, acceleration: Vec3, resistance_deceleration: float) -> tuple[Vec3, float, float]:
    """Return (net acceleration, speed in m/s, deceleration along v in m/s^2) of a ball that rolls at velocity v."""
    speed = norm(v)
    net = mul_add(acceleration, -resistance_deceleration / speed, v)
    return net, speed, resistance_deceleration - dot(acceleration, v) / speed


@device_function
def resolve_stop(v: Vec3, end_velocity: Vec3, deceleration: float, eps: float) -> Vec3:
    """Return ``end_velocity`` without its part along the velocity v at the start of the sub-step.

    It is zero where only rounding is left, or where ``deceleration`` would stop the ball within eps. Otherwise a ball
    that crosses a slope too gentle to roll down would stop infinitely often in a finite time (Zeno behaviour): each
    stop leaves a part of the velocity across the previous one.
    """
    sideways = mul_add(end_velocity, -dot(end_velocity, v) / dot(v, v), v)
    is_roundoff = norm(sideways) <= GRAZING_SPEED_RATIO * norm(v)
    if is_roundoff or dot(sideways, sideways) <= 2.0 * eps * deceleration:
        return Vec3(0.0, 0.0, 0.0)
    return sideways


@device_function
def surface_of(scene: CompiledScene, hit: Collision) -> Any:
    """Return the SURFACE_DTYPE record of the triangle that was hit."""
    return scene.surfaces[scene.triangles[hit.row]["surface"]]


@device_function
def resolve_impact(
    scene: CompiledScene, hit: Collision, average: Vec3, v: Vec3, acceleration: Vec3, net: Vec3, duration: float
) -> tuple[Vec3, bool]:
    """Return (velocity after the impact, whether it becomes a resting contact instead).

    The average-velocity response (CS121 notes) uses the ``average`` velocity over the path of the given duration. The
    conservative response uses the velocity ``v`` at the impact and the ``net`` acceleration on the path: its approach
    speed compensates the energy difference between chord and parabola, so that an undamped impact conserves energy,
    up to rounding. The average-velocity response may return more energy than damping takes where the rebound is short,
    and a ball would hop for ever: such an impact gets the conservative approach speed, too. The contact is resting if
    the rebound would last less than dt against the normal load of gravity or ``acceleration``.
    """
    surface = surface_of(scene, hit)
    n = hit.normal
    restitution = surface["restitution"]
    tangential = surface["tangential"]
    load = normal_load(scene.gravity, acceleration, n)

    # Choose the incoming velocity and the approach speed.
    incoming = average
    approach = -dot(average, n)
    normal_speed = dot(v, n)
    chord_factor = hit.alpha * (1.0 - hit.alpha) * duration * duration
    if scene.conservative:
        incoming = v
        approach = math.sqrt(normal_speed**2 + chord_factor * dot(net, net))
        if normal_speed >= 0.0:  # The ball only grazes the surface, and leaves undamped.
            restitution = 1.0
            tangential = 1.0
    elif restitution < 1.0 and (1.0 - restitution**2) * approach < load * scene.dt and normal_speed < 0.0:
        approach = math.sqrt(normal_speed**2 + chord_factor * dot(net, n) ** 2)

    # A rolling ball hits its floor at exactly load * dt / 2: rounding must not make it bounce if e = 1.
    excess = restitution * approach - 0.5 * load * scene.dt
    if excess <= 0.0 or min(excess, approach) <= GRAZING_SPEED_RATIO * norm(average):
        return v, True

    # Reflect the normal velocity, and damp both parts.
    sliding = mul_add(incoming, -dot(incoming, n), n)
    return mul_add(scale(sliding, tangential), restitution * approach, n), False


@device_function
def normal_load(gravity: Vec3, acceleration: Vec3, n: Vec3) -> float:
    """Return the larger acceleration of the two with which the ball is pressed onto a surface, m/s^2; at least 0."""
    return max(0.0, -dot(gravity, n), -dot(acceleration, n))


@device_function
def make_resting(
    scene: CompiledScene, hit: Collision, contacts: FloatArray, num_contacts: int, v: Vec3, force_resting: bool
) -> tuple[Vec3, int]:
    """Make the contact of a hit a resting one; return what it leaves of the velocity v, and the number of contacts.

    With ``force_resting`` the contact becomes bilateral: the ball can neither enter nor leave it. This prevents
    chattering, an endless series of ever smaller impacts between two contacts.
    """
    n = hit.normal
    num_contacts = add_contact(contacts, num_contacts, n, surface_of(scene, hit)["rolling_coefficient"])
    if force_resting:
        num_contacts = add_contact(contacts, num_contacts, scale(n, -1.0), 0.0)

    # Remove the separating part, too: the ball would be back within the step.
    v = project_onto_cone(contacts, num_contacts, mul_add(v, -max(0.0, dot(v, n)), n))

    # A speed of at most |gravity| * rounding_time is the rounding error of a ball at rest.
    rounding_time = GRAZING_SPEED_RATIO * scene.dt
    if dot(v, v) <= rounding_time * rounding_time * dot(scene.gravity, scene.gravity):
        v = Vec3(0.0, 0.0, 0.0)
    return v, num_contacts
