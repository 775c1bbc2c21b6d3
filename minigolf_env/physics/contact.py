"""What a collision does: the seed's response, contacts that last, and the motion those contacts leave the ball.

Lasting contacts are kept in a scratch array (MAX_CONTACTS, 4), a row each: unit normal, rolling resistance; ``held``
counts the rows in use. It belongs to one time step: a step starts with none, so that a state is position and velocity.
"""

from __future__ import annotations

import math
from typing import Any

from minigolf_env.physics.jit import entry_kernel, kernel
from minigolf_env.physics.sweep import Collision
from minigolf_env.physics.types import FloatArray, Scene, Vec3
from minigolf_env.physics.vec3 import along, cross, dot, norm, scale, sub, vec3

MAX_CONTACTS = 8
"""Contacts held at once: three hold a ball; the rest is for bowls of many facets."""

GRAZE = 1e-10
"""Relative speed normal to a surface below which a ball neither bounces off it nor has left it."""

ROUNDING = 2.0**-48
"""Normal speed of a projected vector, as a share of its length, that is rounding: some units in the last place."""


@entry_kernel
def hold(contacts: FloatArray, held: int, n: Vec3, rolling: float) -> int:
    """Add a lasting contact, in place of one with the same normal or the closest of a full set; return their number."""
    row, closest = min(held, MAX_CONTACTS - 1), -1.0
    for i in range(held):
        likeness = dot(vec3(contacts[i]), n)
        apart = sub(vec3(contacts[i]), n)
        if norm(apart) <= ROUNDING or (held == MAX_CONTACTS and likeness > closest):
            row, closest = i, likeness
    contacts[row, 0], contacts[row, 1], contacts[row, 2], contacts[row, 3] = n.x, n.y, n.z, rolling
    return max(held, row + 1)


@kernel
def release(contacts: FloatArray, held: int, v: Vec3) -> int:
    """Drop the contacts that the ball moves away from at velocity v; return how many are left."""
    left = 0
    for i in range(held):
        rising = dot(vec3(contacts[i]), v)
        if rising <= 0.0 or rising * rising <= GRAZE * GRAZE * dot(v, v):
            for k in range(4):
                contacts[left, k] = contacts[i, k]
            left += 1
    return left


@entry_kernel
def project(contacts: FloatArray, held: int, x: Vec3) -> Vec3:
    """Return the vector closest to x in the cone {y : y . n >= 0 for every contact normal n}.

    It is x itself, or x projected on one contact plane, on the crease of two, or zero.
    """
    if _in_cone(contacts, held, x, held, held, 0.0):
        return x
    slack = 0.0 if held == 1 else -ROUNDING * norm(x)
    for i in range(held):
        n = vec3(contacts[i])
        y = along(x, -dot(x, n), n)
        if dot(x, n) < 0.0 and _in_cone(contacts, held, y, i, i, slack):
            return y if dot(y, y) > ROUNDING * ROUNDING * dot(x, x) else Vec3(0.0, 0.0, 0.0)
    best = Vec3(0.0, 0.0, 0.0)
    for i in range(held):
        for j in range(i):
            crease = _crease(vec3(contacts[i]), vec3(contacts[j]))
            y = scale(crease, dot(x, crease))
            if norm(y) > norm(best) and _in_cone(contacts, held, y, i, j, slack):
                best = y  # Of the vectors in the cone's creases the longest is the closest to x.
    return best if norm(best) > -slack else Vec3(0.0, 0.0, 0.0)


@kernel
def _crease(n: Vec3, m: Vec3) -> Vec3:
    """Return the unit vector along which two planes meet, perpendicular to both normals to rounding; zero if parallel.

    Taking m's part across n first keeps that true for planes that are nearly parallel, where n x m itself is not.
    """
    across = along(m, -dot(m, n), n)
    if norm(across) == 0.0:
        return across
    return cross(n, scale(across, 1.0 / norm(across)))


@kernel
def _in_cone(contacts: FloatArray, held: int, x: Vec3, i: int, j: int, slack: float) -> bool:
    """Return whether x . n >= slack for every contact but i and j, in whose planes it was put."""
    for k in range(held):
        if k != i and k != j and dot(vec3(contacts[k]), x) < slack:
            return False
    return True


@kernel
def rolling_resistance(contacts: FloatArray, held: int, gravity: Vec3) -> float:
    """Return R, the deceleration of a rolling ball, m/s^2: each contact's share of the weight it carries."""
    total = 0.0
    for i in range(held):
        total += contacts[i, 3] * max(0.0, -dot(gravity, vec3(contacts[i])))
    return total


@kernel
def resist(v: Vec3, a: Vec3, resistance: float, h: float) -> tuple[Vec3, float, bool]:
    """Return (net acceleration, duration, stops) of a piece of the step that lasts at most h.

    The resistance acts against v, or holds back the acceleration a of a ball that lies still. The piece ends where the
    velocity along its first direction reaches zero (``stops``). A ball at rest gets zero acceleration and duration.
    """
    if dot(v, v) == 0.0:
        pull = norm(a)
        if pull <= resistance:
            return Vec3(0.0, 0.0, 0.0), 0.0, True
        return scale(a, 1.0 - resistance / pull), h, False
    if resistance == 0.0:
        return a, h, False
    net, speed, braking = brake(v, a, resistance)
    if braking > 0.0 and speed <= braking * h:
        return net, speed / braking, True
    return net, h, False


@kernel
def brake(v: Vec3, a: Vec3, resistance: float) -> tuple[Vec3, float, float]:
    """Return the net acceleration of a ball that rolls at velocity v, its speed, and how fast that falls, m/s^2."""
    speed = norm(v)
    return along(a, -resistance / speed, v), speed, resistance - dot(a, v) / speed


@kernel
def stop(v: Vec3, end: Vec3, braking: float, eps: float) -> Vec3:
    """Return the velocity ``end`` without its part along the first velocity v.

    Zero where only rounding is left, or where ``braking`` (m/s^2) would end the ball's way within eps (m): across a
    slope too gentle to roll down, each stop leaves a part of the speed sideways, and stops would follow without end.
    """
    sideways = along(end, -dot(end, v) / dot(v, v), v)
    if norm(sideways) <= GRAZE * norm(v) or dot(sideways, sideways) <= 2.0 * eps * braking:
        return Vec3(0.0, 0.0, 0.0)
    return sideways


@kernel
def surface_of(scene: Scene, hit: Collision) -> Any:
    """Return the SURFACE that a collision met."""
    return scene.surfaces[scene.triangles[hit.row]["surface"]]


@kernel
def rebound(scene: Scene, hit: Collision, w: Vec3, v: Vec3, a: Vec3, net: Vec3, span: float) -> tuple[Vec3, bool]:
    """Return (velocity after the impact, whether the contact lasts instead).

    ``w`` is the average velocity over the path of duration ``span``, which the seed's response uses; ``v`` the velocity
    at the collision and ``net`` the acceleration on the way, which the conservative response uses: its approach speed
    makes up for the height between the straight path and the parabola, so that the impact keeps energy exactly. The
    contact lasts if the rebound is too slow to outlast dt against ``a`` or gravity, which press the ball down.
    """
    surface, n = surface_of(scene, hit), hit.normal
    restitution, tangential = surface["restitution"], surface["tangential"]
    incoming, approach = w, -dot(w, n)
    if scene.conservative:
        incoming = v
        approach = math.sqrt(dot(v, n) ** 2 + hit.alpha * (1.0 - hit.alpha) * span * span * dot(net, net))
        if dot(v, n) >= 0.0:  # It only grazes, and leaves undamped.
            restitution, tangential = 1.0, 1.0
    # A rolling ball meets its floor at just the speed pressing dt / 2: rounding must not make it bounce if e = 1.
    weak = restitution * approach - 0.5 * pressing(scene.gravity, a, n) * scene.dt
    if weak <= 0.0 or min(weak, approach) <= GRAZE * norm(w):
        return v, True
    sliding = along(incoming, -dot(incoming, n), n)
    return along(scale(sliding, tangential), restitution * approach, n), False


@kernel
def pressing(gravity: Vec3, a: Vec3, n: Vec3) -> float:
    """Return how hard gravity or the acceleration a presses a ball onto a surface, m/s^2."""
    return max(0.0, -dot(gravity, n), -dot(a, n))


@kernel
def settle(scene: Scene, hit: Collision, contacts: FloatArray, held: int, v: Vec3, rattles: bool) -> tuple[Vec3, int]:
    """Let a contact last; return what it leaves of the velocity v, and how many contacts last now.

    The contact of a ball that ``rattles`` lasts from both sides: resistance, which pulls a ball back to what it leaves,
    would throw it to and fro between two contacts in ever smaller hits.
    """
    n = hit.normal
    held = hold(contacts, held, n, surface_of(scene, hit)["rolling"])
    if rattles:
        held = hold(contacts, held, scale(n, -1.0), 0.0)
    # A part that rises goes too: the ball would be back within the step.
    v = project(contacts, held, along(v, -max(0.0, dot(v, n)), n))
    slow = GRAZE * scene.dt  # Times gravity: the rounding of a ball that is held fast.
    if dot(v, v) <= slow * slow * dot(scene.gravity, scene.gravity):
        v = Vec3(0.0, 0.0, 0.0)
    return v, held
