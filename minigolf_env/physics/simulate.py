"""The time step, the run to rest, and batches of runs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.contact import (
    MAX_CONTACTS,
    hold,
    project,
    rebound,
    release,
    resist,
    rolling_resistance,
    settle,
    stop,
    surface_of,
)
from minigolf_env.physics.kernel import entry_kernel, kernel, merged_kernel
from minigolf_env.physics.neighbourhood import Neighbourhood, no_neighbourhood, sweep_near
from minigolf_env.physics.sweep import distance, is_near, sweep
from minigolf_env.physics.types import ZERO, FloatArray, RecordArray, Scene, Status, Vec3
from minigolf_env.physics.vec3 import along, dot, norm, scale, vec3

MAX_SUB_STEPS = 64
"""Pieces of one time step, nearly always 1 to 6: the guarantee that every step ends."""

PATIENCE = MAX_SUB_STEPS // 2
"""Sub-steps after which every contact lasts and none leaves, and a stop is one for good: for a ball that rattles in a
wedge, or turns on a slope, and uses up no time."""

REST, OUT_OF_BOUNDS, TIME_LIMIT = int(Status.REST), int(Status.OUT_OF_BOUNDS), int(Status.TIME_LIMIT)


class Scratch(NamedTuple):
    """Memory that the steps of one thread work in; what it holds changes the cost of a step and never its result."""

    contacts: FloatArray
    """(MAX_CONTACTS, 4): the contacts that last, see contact.py."""
    near: Neighbourhood


def new_scratch() -> Scratch:
    """Return memory for one thread."""
    return Scratch(np.zeros((MAX_CONTACTS, 4)), no_neighbourhood())


class Moved(NamedTuple):
    """The ball after a time step."""

    p: Vec3
    v: Vec3
    left: float
    """Time of the step that was not needed: 0 unless the ball came to rest, s."""
    resting: bool
    bounces: int
    """Those before the step included."""
    exhausted: bool
    """The sub-steps ran out."""
    sub_steps: int


@entry_kernel
def step(scene: Scene, scratch: Scratch, p: Vec3, v: Vec3, log: FloatArray, bounces: int, clock: float) -> Moved:
    """Move the ball by one dt: the seed's algorithm, with lasting contacts.

    Bounces are noted in ``log`` (K, 8) as far as it has rows: time, centre, normal, triangle.
    """
    contacts, held = scratch.contacts, ZERO
    a, h = scene.gravity, scene.dt
    still = dot(v, v) == 0.0
    for sub_step in range(MAX_SUB_STEPS):
        resistance = rolling_resistance(contacts, held, scene.gravity)
        net, span, stops = resist(v, a, resistance, h)
        if stops and span == 0.0:
            pull, held = _hemmed(scene, contacts, p, scene.gravity, 0.5 * scene.dt * scene.dt)
            if still or norm(pull) <= rolling_resistance(contacts, held, scene.gravity):
                return Moved(p, net, h, True, bounces, False, sub_step)
            still, held, a, v = True, 0, scene.gravity, net  # It has rolled off what stopped it.
            continue
        average = along(v, 0.5 * span, net)
        path = scale(average, span)
        hit = sweep_near(scene, scratch.near, p, path)

        end = v
        if hit.alpha > 0.0:
            p, end, still = along(p, hit.alpha, path), along(v, hit.alpha * span, net), False
            h = (1.0 - hit.alpha) * span + (h - span)
        rattles = sub_step >= PATIENCE
        if hit.row < 0:
            if not stops:
                return Moved(p, end, 0.0, False, bounces, False, sub_step + 1)
            v = Vec3(0.0, 0.0, 0.0) if rattles else stop(v, end, resistance - norm(a), scene.eps)
        else:
            v, lasts = rebound(scene, hit, average, end, a, net, span)
            if lasts or rattles:
                v, held = settle(scene, hit, contacts, held, end, rattles)
            else:
                held = 0
                _note(log, bounces, clock + (scene.dt - h), p, hit.normal, hit.order)
                bounces += 1
        if not rattles:
            held = release(contacts, held, v)
        a = project(contacts, held, scene.gravity)
    v, _ = _hemmed(scene, contacts, p, v, scene.dt)
    return Moved(p, v, 0.0, False, bounces, True, MAX_SUB_STEPS)


@kernel
def _note(log: FloatArray, row: int, time: float, p: Vec3, n: Vec3, triangle: int) -> None:
    if row < len(log):
        log[row, 0], log[row, 7] = time, triangle
        log[row, 1], log[row, 2], log[row, 3] = p.x, p.y, p.z
        log[row, 4], log[row, 5], log[row, 6] = n.x, n.y, n.z


@kernel
def _hemmed(scene: Scene, contacts: FloatArray, p: Vec3, x: Vec3, span: float) -> tuple[Vec3, int]:
    """Return what the contacts touching the ball at p leave of the vector x, and how many they are.

    They are found one by one, by sweeping along what is left of x for a duration ``span``.
    """
    left, held = x, ZERO
    for _ in range(MAX_CONTACTS):
        if dot(left, left) == 0.0:
            break
        hit = sweep(scene, p, scale(left, span))
        if hit.alpha > 0.0:
            break
        held = hold(contacts, held, hit.normal, surface_of(scene, hit)["rolling"])
        left = project(contacts, held, x)
    return left, held


@merged_kernel
def simulate(
    scene: Scene, scratch: Scratch, p: Vec3, v: Vec3, max_steps: int, path: FloatArray, log: FloatArray
) -> tuple[Vec3, Vec3, int, int, float, int, int]:
    """Run the ball until it rests, leaves the bounds, or ``max_steps`` are done.

    Returns position, velocity, status, steps begun, time (s), bounces and exhausted steps. Position and sub-steps
    of each step are written to ``path`` (T, 4) as far as it has rows (row 0 is the start), bounces to ``log``.
    """
    _trace(path, ZERO, p, ZERO)
    bounces, exhausted = ZERO, ZERO
    for k in range(max_steps):
        ball = step(scene, scratch, p, v, log, bounces, k * scene.dt)
        p, v, bounces = ball.p, ball.v, ball.bounces
        exhausted += int(ball.exhausted)
        _trace(path, k + 1, p, ball.sub_steps)
        if ball.resting:
            return p, v, REST, k + 1, k * scene.dt + (scene.dt - ball.left), bounces, exhausted
        if not _within(p, scene.lower, scene.upper):
            return p, v, OUT_OF_BOUNDS, k + 1, (k + 1) * scene.dt, bounces, exhausted
    return p, v, TIME_LIMIT, max_steps, max_steps * scene.dt, bounces, exhausted


@kernel
def _trace(path: FloatArray, row: int, p: Vec3, sub_steps: int) -> None:
    if row < len(path):
        path[row, 0], path[row, 1], path[row, 2], path[row, 3] = p.x, p.y, p.z, sub_steps


@kernel
def _within(p: Vec3, lower: Vec3, upper: Vec3) -> bool:
    return lower.x <= p.x <= upper.x and lower.y <= p.y <= upper.y and lower.z <= p.z <= upper.z


@entry_kernel
def simulate_range(
    first: int,
    last: int,
    scene: Scene,
    scratch: Scratch,
    max_steps: int,
    positions: FloatArray,
    velocities: FloatArray,
    results: RecordArray,
    path: FloatArray,
    log: FloatArray,
) -> None:
    """Run balls first to last - 1; positions and velocities (N, 3) become those at the end, ``results`` (N,) is filled.

    Only one ball should have a ``path`` and a ``log`` with rows.
    """
    for i in range(first, last):
        p, v, status, steps, time, bounces, exhausted = simulate(
            scene, scratch, vec3(positions[i]), vec3(velocities[i]), max_steps, path, log
        )
        positions[i, 0], positions[i, 1], positions[i, 2] = p.x, p.y, p.z
        velocities[i, 0], velocities[i, 1], velocities[i, 2] = v.x, v.y, v.z
        result = results[i]
        result["status"], result["steps"], result["time"] = status, steps, time
        result["bounces"], result["exhausted"] = bounces, exhausted


@entry_kernel
def sweep_range(
    first: int,
    last: int,
    scene: Scene,
    starts: FloatArray,
    paths: FloatArray,
    alphas: FloatArray,
    normals: FloatArray,
    triangles: NDArray[np.int64],
) -> None:
    """Sweep balls first to last - 1 of a batch along paths (N, 3) and write alpha, normal and triangle."""
    for i in range(first, last):
        hit = sweep(scene, vec3(starts[i]), vec3(paths[i]))
        alphas[i], triangles[i] = hit.alpha, hit.order
        normals[i, 0], normals[i, 1], normals[i, 2] = hit.normal.x, hit.normal.y, hit.normal.z


@entry_kernel
def clearance_range(first: int, last: int, scene: Scene, positions: FloatArray, clearances: FloatArray) -> None:
    """Write the distance from the skin of balls first to last - 1 to the nearest triangle."""
    for i in range(first, last):
        clearances[i] = distance(scene, vec3(positions[i])) - scene.radius


@entry_kernel
def doubt_range(first: int, last: int, scene: Scene, positions: FloatArray, doubts: NDArray[np.bool_]) -> None:
    """Write whether balls first to last - 1 may be deeper than ``eps`` in a triangle; the others surely are not."""
    for i in range(first, last):
        doubts[i] = is_near(scene, vec3(positions[i]), scene.radius - 1.5 * scene.eps)
