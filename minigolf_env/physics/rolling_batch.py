"""Balls that roll on, several at once: most steps of a putt, each at a tenth of what ``step`` takes.

A ball that rolls and will meet nothing but its ground does the same in each step: it falls onto the ground, the contact
lasts, it rolls on. That needs no branches, and the compiler turns a loop over balls without branches into vector
instructions, a ball in each of their lanes. Whatever may be anything else is left to ``step``; the bits are the same.

**Why a plane will do for the ground.** In a lane are balls that can reach level triangles only: of one closed mesh, in
one plane, their normals the same to the last bit. Then the ground has no border within reach (beyond it would
be a triangle of another plane), and a ball's foot is always within a triangle, or on a seam. If the ball touches the
plane and its path goes well into it, the sweep meets the triangle under the foot at alpha = 0, with the plane's normal;
at a seam that one where the ball has become deeper than eps, whose border is so near to the foot that its distance is
the height to rounding. Others that it meets at 0 have the same normal, so it matters not which one counts.
"""

from __future__ import annotations

import math

import numpy as np

from minigolf_env.physics.candidate_cache import Cylinder, around, holds, reach_around
from minigolf_env.physics.contact import GRAZE, ROUNDING, brake, hold, pressing, project, rolling_resistance
from minigolf_env.physics.jit import entry_kernel, kernel
from minigolf_env.physics.traversal import begin, next_leaf_on_path
from minigolf_env.physics.types import ZERO, FloatArray, RecordArray, Scene, Vec3
from minigolf_env.physics.vec3 import add, along, choose, column, dot, norm, put, scale, sub, vec3

LANES = 8
"""Balls that roll at once: one vector of 512 bits, or some shorter ones."""

AHEAD = 64.0
"""Steps for which the ground is looked at."""

LEAST = 2.0
"""Steps for which it must be level, or it is not worth it."""

LEVEL = 0.125
"""Share of eps by which level triangles may be apart."""

TOUCHES = 0.75
"""Share of eps by which a ball may be off its ground: with ``LEVEL``, less than what touches all level triangles."""

LANE = np.dtype(
    [
        *((name, "f8", (3, LANES)) for name in ("p", "v", "corner", "normal", "pull", "foot", "axis")),
        *((name, "f8", (LANES,)) for name in ("resistance", "restitution", "press", "length", "radius2")),
        *((name, "i8", (LANES,)) for name in ("ball", "ground", "left", "rolled", "rolls")),
    ]
)
"""A column for each ball: centre and velocity; a corner and the normal of its ground, gravity along it and rolling
resistance (m/s^2), what an impact keeps of the normal speed, and the speed up to which that lasts (m/s); the cylinder
in which its centre stays. Its row in the batch (-1 without a ball), a triangle of its ground, the steps that are left
to it, those it has rolled in the lane, and whether it goes on."""


@entry_kernel
def enter(scene: Scene, walk: RecordArray, contacts: FloatArray, lanes: RecordArray, i: int, p: Vec3, v: Vec3) -> bool:
    """Let a ball that rolls on the triangle that is lane i's ground roll on in the lane, if it may; return whether."""
    lane = lanes[0]
    ground = lane["ground"][i]
    triangle = scene.triangles[ground]
    if not triangle["one_sided"]:
        return False
    surface, n = scene.surfaces[triangle["surface"]], vec3(triangle["n"])
    held = hold(contacts, ZERO, n, surface["rolling"])
    pull = project(contacts, held, scene.gravity)
    level, cylinder = _look_ahead(scene, walk, p, v, pull, ground)
    if level:
        put(lane["p"], i, p)
        put(lane["v"], i, v)
        put(lane["corner"], i, vec3(triangle["a"]))
        put(lane["normal"], i, n)
        put(lane["pull"], i, pull)
        put(lane["foot"], i, cylinder.foot)
        put(lane["axis"], i, cylinder.axis)
        lane["length"][i], lane["radius2"][i] = cylinder.length, cylinder.radius2
        lane["resistance"][i] = rolling_resistance(contacts, held, scene.gravity)
        lane["restitution"][i] = surface["restitution"]
        lane["press"][i] = 0.5 * pressing(scene.gravity, scene.gravity, n) * scene.dt
        lane["rolled"][i], lane["rolls"][i] = 0, 1
    return level


@kernel
def _look_ahead(scene: Scene, walk: RecordArray, p: Vec3, v: Vec3, pull: Vec3, ground: int) -> tuple[bool, Cylinder]:
    """Return whether a ball at p, that rolls at velocity v, has level ground under and before it, and up to where.

    The cylinder is wide enough for what gravity dips a path, and for how the ``pull`` along the ground bends the way.
    """
    time = AHEAD * scene.dt
    if norm(pull) * time * time > scene.radius:
        time = math.sqrt(scene.radius / norm(pull))
    w = scale(v, time)
    radius = scene.dt * scene.dt * norm(scene.gravity) + 0.5 * norm(pull) * time * time + 4.0 * scene.eps
    reach = reach_around(scene, radius)
    stands, free = False, 1.0
    begin(walk)
    size = ZERO + 1
    while size > 0 and free * time >= LEAST * scene.dt:
        first, size = next_leaf_on_path(scene.nodes, walk, p, scale(w, free), reach)
        for i in range(first, first + size):
            triangle = scene.triangles[i]
            foot, u, f = sub(p, vec3(triangle["a"])), vec3(triangle["u"]), vec3(triangle["v"])
            if not _is_level(scene, ground, i):
                free = min(free, _clear_until(foot, vec3(triangle["n"]), u, f, w, reach))
            elif dot(foot, u) > 0.0 and dot(foot, f) > 0.0 and dot(foot, u) + dot(foot, f) < 1.0:
                stands = True
    return stands and free * time >= LEAST * scene.dt, around(p, scale(w, free), radius)


@kernel
def _is_level(scene: Scene, ground: int, other: int) -> bool:
    """Return whether two triangles are of one mesh, in one plane, and have the same normal."""
    a, b = scene.triangles[ground], scene.triangles[other]
    n, m = vec3(a["n"]), vec3(b["n"])
    step = sub(vec3(b["a"]), vec3(a["a"]))
    return bool(
        a["surface"] == b["surface"]  # A row for each mesh.
        and n.x == m.x
        and n.y == m.y
        and n.z == m.z
        and abs(dot(step, n)) <= LEVEL * scene.eps
    )


@kernel
def _clear_until(start: Vec3, n: Vec3, u: Vec3, v: Vec3, w: Vec3, reach: float) -> float:
    """Return up to which share of its way w a point is surely beyond ``reach`` of a triangle; ``start`` is from its a.

    That is while it is so far off the triangle's plane, or so far beyond one of its edges.
    """
    height, climb = dot(start, n), dot(w, n)
    x, y, rate_x, rate_y = dot(start, u), dot(start, v), dot(w, u), dot(w, v)
    side = math.copysign(1.0, height)
    off_plane = _parted_until(side * height - reach, side * climb)
    off_edges = max(_parted_until(-x - reach * norm(u), -rate_x), _parted_until(-y - reach * norm(v), -rate_y))
    off_third = _parted_until(x + y - 1.0 - reach * norm(add(u, v)), rate_x + rate_y)
    return max(off_plane, max(off_edges, off_third))


@kernel
def _parted_until(gap: float, rate: float) -> float:
    """Return up to when a gap that grows at a rate is positive, in [0, 1]."""
    if gap <= 0.0:
        return 0.0
    return min(1.0, -gap / rate) if rate < 0.0 else 1.0


@entry_kernel
def roll(scene: Scene, lanes: RecordArray, count: int) -> int:
    """Take a time step with each of the first ``count`` balls that rolls on; return how many do.

    The others, and those whose step may not be ``step``'s, to the last bit, stay where they are.
    """
    lane, rolling = lanes[0], 0
    radius, eps, dt, gravity, lower, upper = scene.radius, scene.eps, scene.dt, scene.gravity, scene.lower, scene.upper
    slow = GRAZE * dt
    for i in range(count):
        p, v, n = column(lane["p"], i), column(lane["v"], i), column(lane["normal"], i)
        cylinder = Cylinder(column(lane["foot"], i), column(lane["axis"], i), lane["length"][i], lane["radius2"][i])

        # It falls onto its ground, which it touches: alpha is 0;
        average = along(v, 0.5 * dt, gravity)
        path = scale(average, dt)
        gap, climb = dot(sub(p, column(lane["corner"], i)), n) - radius, dot(path, n)
        on = holds(cylinder, p) & holds(cylinder, add(p, path)) & (abs(gap) <= TOUCHES * eps)
        on &= (climb <= -16.0 * eps) & (climb * climb * radius >= 128.0 * eps * dot(path, path))

        # the contact lasts: for certain if the seed's approach is too slow, as the conservative one is slower;
        rising = dot(v, n)
        on &= -lane["restitution"][i] * dot(average, n) <= lane["press"][i]
        sunk = along(v, -max(0.0, rising), n)
        sinking = dot(sunk, n)
        w = choose(sinking < 0.0, along(sunk, -sinking, n), sunk)
        left, speed2 = dot(n, w), dot(w, w)
        on &= (speed2 > ROUNDING * ROUNDING * dot(sunk, sunk)) & (speed2 > slow * slow * dot(gravity, gravity))
        on &= (left <= 0.0) | (left * left <= GRAZE * GRAZE * speed2)

        # and it rolls on along the plane,
        pull, resistance = column(lane["pull"], i), lane["resistance"][i]
        net, speed, braking = brake(w, pull, resistance)
        net = choose(resistance == 0.0, pull, net)
        on &= (resistance == 0.0) | (braking <= 0.0) | (speed > braking * dt)
        way = scale(along(w, 0.5 * dt, net), dt)
        end = add(p, way)
        on &= holds(cylinder, end) & (gap + dot(way, n) >= -TOUCHES * eps)
        on &= (lower.x <= end.x) & (end.x <= upper.x) & (lower.y <= end.y) & (end.y <= upper.y)
        on &= (lower.z <= end.z) & (end.z <= upper.z)

        # if it may.
        on &= (lane["rolls"][i] != 0) & (lane["rolled"][i] < lane["left"][i])
        put(lane["p"], i, choose(on, end, p))
        put(lane["v"], i, choose(on, along(w, dt, net), v))
        lane["rolls"][i] = on
        lane["rolled"][i] += on
        rolling += on
    return rolling
