"""The time step, the run to rest, and batches of runs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.candidate_cache import Neighbourhood, is_short, no_neighbourhood, sweep_near
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
from minigolf_env.physics.jit import entry_kernel, kernel, merged_kernel
from minigolf_env.physics.rolling_batch import LANE, LANES, enter, roll
from minigolf_env.physics.sweep import distance, is_near, sweep
from minigolf_env.physics.types import ZERO, FloatArray, RecordArray, Scene, Status, Vec3
from minigolf_env.physics.vec3 import along, column, dot, norm, scale, store, vec3

MAX_SUB_STEPS = 64
"""Pieces of one time step, nearly always 1 to 6: the guarantee that every step ends."""

PATIENCE = MAX_SUB_STEPS // 2
"""Sub-steps after which every contact lasts and none leaves, and a stop is one for good: for a ball that rattles in a
wedge, or turns on a slope, and uses up no time."""

TOGETHER = 8
"""Steps that balls roll on between two looks at which have ceased to."""

REST, OUT_OF_BOUNDS, TIME_LIMIT = int(Status.REST), int(Status.OUT_OF_BOUNDS), int(Status.TIME_LIMIT)


class Scratch(NamedTuple):
    """Memory that the steps of one thread work in; what it holds changes the cost of a step and never its result."""

    contacts: FloatArray
    """(MAX_CONTACTS, 4): the contacts that last, see contact.py."""
    near: Neighbourhood
    lanes: RecordArray
    """(1,) of LANE: balls that roll on."""


def new_scratch() -> Scratch:
    """Return memory for one thread."""
    return Scratch(np.zeros((MAX_CONTACTS, 4)), no_neighbourhood(), np.zeros(1, LANE))


class Balls(NamedTuple):
    """The balls of a batch."""

    positions: FloatArray
    """(N, 3) centres, m: at the start, and at the end when they have run."""
    velocities: FloatArray
    """(N, 3) m/s."""
    results: RecordArray
    """(N,) of RESULT."""


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


@merged_kernel
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
            pull, held = _hemmed(scene, scratch, p, scene.gravity, 0.5 * scene.dt * scene.dt)
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
    v, _ = _hemmed(scene, scratch, p, v, scene.dt)
    return Moved(p, v, 0.0, False, bounces, True, MAX_SUB_STEPS)


@kernel
def _note(log: FloatArray, row: int, time: float, p: Vec3, n: Vec3, triangle: int) -> None:
    if row < len(log):
        log[row, 0], log[row, 7] = time, triangle
        log[row, 1], log[row, 2], log[row, 3] = p.x, p.y, p.z
        log[row, 4], log[row, 5], log[row, 6] = n.x, n.y, n.z


@kernel
def _hemmed(scene: Scene, scratch: Scratch, p: Vec3, x: Vec3, span: float) -> tuple[Vec3, int]:
    """Return what the contacts touching the ball at p leave of the vector x, and how many they are.

    They are found one by one, by sweeping along what is left of x for a duration ``span``.
    """
    contacts, left, held = scratch.contacts, x, ZERO
    for _ in range(MAX_CONTACTS):
        if dot(left, left) == 0.0:
            break
        hit = sweep(scene, scratch.near.walk, p, scale(left, span))
        if hit.alpha > 0.0:
            break
        held = hold(contacts, held, hit.normal, surface_of(scene, hit)["rolling"])
        left = project(contacts, held, x)
    return left, held


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
    balls: Balls,
    path: FloatArray,
    log: FloatArray,
) -> None:
    """Run balls first to last - 1, each until it rests, leaves the bounds, or ``max_steps`` are done.

    Balls that roll on do so together, a lane each; the other steps a ball takes alone. If position and sub-steps of
    each step are written to a ``path`` (T, 4) with rows (row 0 is the start), and bounces to ``log``, there should be
    one ball, which takes all its steps alone.
    """
    for i in range(first, last):
        result = balls.results[i]
        result["steps"], result["bounces"], result["exhausted"] = 0, 0, 0
        _trace(path, ZERO, vec3(balls.positions[i]), ZERO)
    lane, count, waiting = scratch.lanes[0], min(LANES, last - first), first
    for k in range(count):
        lane["ball"][k], lane["rolls"][k], lane["rolled"][k] = -1, 0, 0
    rolling = True
    while rolling:
        rolling = False
        for k in range(count):
            while lane["rolls"][k] == 0 and (lane["ball"][k] >= 0 or waiting < last):
                if lane["ball"][k] < 0:
                    lane["ball"][k], waiting = waiting, waiting + 1
                i = lane["ball"][k]
                if not _walk(scene, scratch, k, i, max_steps, balls, path, log):
                    lane["ball"][k] = -1
            rolling |= lane["rolls"][k] != 0
        for _ in range(TOGETHER):
            if roll(scene, scratch.lanes, count) == 0:
                break


@merged_kernel
def _walk(
    scene: Scene, scratch: Scratch, k: int, i: int, max_steps: int, balls: Balls, path: FloatArray, log: FloatArray
) -> bool:
    """Take steps with ball i alone until it may roll on in lane k, or its run ends; return whether it may."""
    lane, near, result = scratch.lanes[0], scratch.near, balls.results[i]
    p, v, smooth = vec3(balls.positions[i]), vec3(balls.velocities[i]), ZERO
    steps, bounces, exhausted = result["steps"], result["bounces"], result["exhausted"]
    if lane["rolled"][k] > 0:  # It comes from the lane.
        p, v, smooth = column(lane["p"], k), column(lane["v"], k), ZERO + 1
        steps, lane["rolled"][k] = steps + lane["rolled"][k], 0
    status, left, rolls = TIME_LIMIT, 0.0, False
    while steps < max_steps:
        # Where the ground is not level it seldom is a step later: looks that fail become rare.
        if smooth > 0 and smooth & (smooth - 1) == 0 and len(path) == 0:
            rolls = enter(scene, near.walk, scratch.contacts, scratch.lanes, k, p, v)
        if rolls:
            lane["left"][k] = max_steps - steps
            break
        ball = step(scene, scratch, p, v, log, bounces, steps * scene.dt)
        smooth = smooth + 1 if ball.sub_steps == 2 and ball.bounces == bounces and is_short(near) else ZERO
        lane["ground"][k] = near.cylinder[0]["met"]
        p, v, bounces, exhausted, steps = ball.p, ball.v, ball.bounces, exhausted + int(ball.exhausted), steps + 1
        _trace(path, steps, p, ball.sub_steps)
        if ball.resting:
            status, left = REST, ball.left
            break
        if not _within(p, scene.lower, scene.upper):
            status = OUT_OF_BOUNDS
            break
    store(balls.positions[i], p)
    store(balls.velocities[i], v)
    result["status"], result["steps"], result["bounces"], result["exhausted"] = status, steps, bounces, exhausted
    result["time"] = (steps - 1) * scene.dt + (scene.dt - left) if status == REST else steps * scene.dt
    return rolls


@entry_kernel
def sweep_range(
    first: int,
    last: int,
    scene: Scene,
    walk: RecordArray,
    starts: FloatArray,
    paths: FloatArray,
    alphas: FloatArray,
    normals: FloatArray,
    triangles: NDArray[np.int64],
) -> None:
    """Sweep balls first to last - 1 of a batch along paths (N, 3) and write alpha, normal and triangle."""
    for i in range(first, last):
        hit = sweep(scene, walk, vec3(starts[i]), vec3(paths[i]))
        alphas[i], triangles[i] = hit.alpha, hit.order
        store(normals[i], hit.normal)


@entry_kernel
def clearance_range(
    first: int, last: int, scene: Scene, walk: RecordArray, positions: FloatArray, clearances: FloatArray
) -> None:
    """Write the distance from the skin of balls first to last - 1 to the nearest triangle."""
    for i in range(first, last):
        clearances[i] = distance(scene, walk, vec3(positions[i])) - scene.radius


@entry_kernel
def doubt_range(
    first: int, last: int, scene: Scene, walk: RecordArray, positions: FloatArray, doubts: NDArray[np.bool_]
) -> None:
    """Write whether balls first to last - 1 may be deeper than ``eps`` in a triangle; the others surely are not."""
    for i in range(first, last):
        doubts[i] = is_near(scene, walk, vec3(positions[i]), scene.radius - 1.5 * scene.eps)
