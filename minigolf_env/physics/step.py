"""The time step, and the run of one or many balls to rest.

One time step is a loop over sub-steps. Each moves the ball along a straight path to its first hit and resolves that
hit; the rest of the time begins there. In flight a step is one sub-step. While rolling it is two: the ball falls onto
the ground at alpha = 0, where the contact becomes resting, and then rolls along the ground. A bounce adds one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from minigolf_env.physics.candidate_cache import CandidateCache, has_spare_capacity, new_candidate_cache, sweep_cached
from minigolf_env.physics.contact import (
    MAX_CONTACTS,
    add_contact,
    apply_rolling_resistance,
    make_resting,
    project_onto_cone,
    remove_separating,
    resolve_impact,
    resolve_stop,
    rolling_resistance_deceleration,
    surface_of,
)
from minigolf_env.physics.jit import device_function, inlined_kernel, kernel
from minigolf_env.physics.rolling_batch import ROLLING_BATCH_DTYPE, SIMD_WIDTH, step_rolling, try_enter
from minigolf_env.physics.sweep import sweep
from minigolf_env.physics.types import INT64_ONE, INT64_ZERO, CompiledScene, FloatArray, RecordArray, Status, Vec3
from minigolf_env.physics.vec3 import column, dot, mul_add, norm, scale, store, vec3

MAX_SUBSTEPS = 64
"""Maximum number of sub-steps of a time step, nearly always 1 to 6: the guarantee that every step ends."""

FORCE_RESTING_AFTER = MAX_SUBSTEPS // 2
"""Number of sub-steps of a time step after which every contact is resting and a stop is final.

This ends infinite series of events that use up no time (Zeno behaviour): chattering in a wedge, and repeated stops on a
slope."""

ROLLING_STEPS_PER_CHECK = 8
"""Number of steps of the rolling batch between two checks for balls that have become inactive."""

STATUS_REST = int(Status.REST)
"""Value of ``Status.REST`` in compiled code."""

STATUS_OUT_OF_BOUNDS = int(Status.OUT_OF_BOUNDS)
"""Value of ``Status.OUT_OF_BOUNDS`` in compiled code."""

STATUS_TIME_LIMIT = int(Status.TIME_LIMIT)
"""Value of ``Status.TIME_LIMIT`` in compiled code."""


class Scratch(NamedTuple):
    """Working memory of one thread; its contents change the cost of a step and never the result."""

    contacts: FloatArray
    """(MAX_CONTACTS, 4) resting contacts, see contact.py."""
    cache: CandidateCache
    """Triangles near the ball."""
    rolling_batch: RecordArray
    """(1,) record of ROLLING_BATCH_DTYPE: the balls that roll on flat ground."""


def new_scratch() -> Scratch:
    """Return working memory for one thread."""
    return Scratch(np.zeros((MAX_CONTACTS, 4)), new_candidate_cache(), np.zeros(1, ROLLING_BATCH_DTYPE))


class RunBatch(NamedTuple):
    """State of the balls of a batch of runs, each from its start to its end."""

    positions: FloatArray
    """(N, 3) centres, m: at the start of the runs, and at their end afterwards."""
    velocities: FloatArray
    """(N, 3) velocities, m/s, likewise."""
    results: RecordArray
    """(N,) records of RESULT_DTYPE; zero at the start."""


class StepResult(NamedTuple):
    """The ball after a time step."""

    p: Vec3
    v: Vec3
    time_left: float
    """Time of the step after the ball came to rest, s; 0 for a ball that did not."""
    resting: bool
    bounces: int
    """Number of bounces, those before the step included."""
    exhausted: bool
    """True if the sub-steps were used up, and the rest of the time was lost."""
    num_substeps: int


@inlined_kernel
def step(
    scene: CompiledScene, scratch: Scratch, p: Vec3, v: Vec3, log: FloatArray, bounces: int, clock: float
) -> StepResult:
    """Advance the ball by dt: average-velocity integration, continuous collision detection, resting contacts.

    Bounces are written to ``log`` (K, 8) as long as it has rows: time, centre, contact normal, triangle. ``clock`` is
    the time at the start of the step, s.
    """
    contacts = scratch.contacts
    num_contacts = INT64_ZERO
    acceleration = scene.gravity
    time_left = scene.dt
    was_stopped = dot(v, v) == 0.0
    for substep in range(MAX_SUBSTEPS):
        force_resting = substep >= FORCE_RESTING_AFTER

        # Apply rolling resistance: the net acceleration, and the duration if the ball stops before the time is up.
        resistance_deceleration = rolling_resistance_deceleration(contacts, num_contacts, scene.gravity)
        net, duration, stops = apply_rolling_resistance(v, acceleration, resistance_deceleration, time_left)

        # A ball without velocity is at rest if contacts and rolling resistance balance gravity, or if it stopped twice
        # without moving; else it starts to roll. ``net`` is zero here, and serves as its velocity.
        if stops and duration == 0.0:
            drop_factor = 0.5 * scene.dt * scene.dt  # Times gravity: the drop in a time step.
            unbalanced, num_contacts = _constrain_to_touching(scene, scratch, p, scene.gravity, drop_factor)
            holding_deceleration = rolling_resistance_deceleration(contacts, num_contacts, scene.gravity)
            if was_stopped or norm(unbalanced) <= holding_deceleration:
                return StepResult(p, net, time_left, True, bounces, False, substep)
            was_stopped = True
            num_contacts = 0
            acceleration = scene.gravity
            v = net
            continue

        # Find the first hit along the straight path with the average velocity.
        average = mul_add(v, 0.5 * duration, net)
        path = scale(average, duration)
        hit = sweep_cached(scene, scratch.cache, p, path)

        # Move the ball to the hit, or to the end of the path.
        end_velocity = v
        if hit.alpha > 0.0:
            p = mul_add(p, hit.alpha, path)
            end_velocity = mul_add(v, hit.alpha * duration, net)
            was_stopped = False
            time_left = (1.0 - hit.alpha) * duration + (time_left - duration)

        # Resolve what happened there: the end of the step, a stop, a resting contact, or a bounce.
        if hit.row < 0:
            if not stops:
                return StepResult(p, end_velocity, 0.0, False, bounces, False, substep + 1)
            # The least deceleration in any direction: the resistance, minus all of the acceleration.
            deceleration = resistance_deceleration - norm(acceleration)
            v = Vec3(0.0, 0.0, 0.0) if force_resting else resolve_stop(v, end_velocity, deceleration, scene.eps)
        else:
            v, is_resting = resolve_impact(scene, hit, average, end_velocity, acceleration, net, duration)
            if is_resting or force_resting:
                v, num_contacts = make_resting(scene, hit, contacts, num_contacts, end_velocity, force_resting)
            else:
                num_contacts = 0
                _log_impact(log, bounces, clock + (scene.dt - time_left), p, hit.normal, hit.triangle_id)
                bounces += 1

        # Remove separating contacts, and project gravity onto what the others leave free.
        num_contacts = remove_separating(contacts, num_contacts, v)
        acceleration = project_onto_cone(contacts, num_contacts, scene.gravity)

    # The sub-steps are used up: the rest of the time is lost.
    v, _ = _constrain_to_touching(scene, scratch, p, v, scene.dt)
    return StepResult(p, v, 0.0, False, bounces, True, MAX_SUBSTEPS)


@device_function
def _log_impact(log: FloatArray, row: int, time: float, p: Vec3, n: Vec3, triangle: int) -> None:
    """Write a bounce to a row of the log, if it has that row."""
    if row < len(log):
        log[row, 0] = time
        log[row, 1], log[row, 2], log[row, 3] = p.x, p.y, p.z
        log[row, 4], log[row, 5], log[row, 6] = n.x, n.y, n.z
        log[row, 7] = triangle


@device_function
def _constrain_to_touching(scene: CompiledScene, scratch: Scratch, p: Vec3, x: Vec3, factor: float) -> tuple[Vec3, int]:
    """Project the vector x onto the cone of all contacts that touch the ball at p; return it and their number.

    The contacts are found one by one, by sweeping along the projected vector times ``factor``, a displacement: dt for a
    velocity, dt^2 / 2 for an acceleration.
    """
    contacts = scratch.contacts
    projected = x
    num_contacts = INT64_ZERO
    for _ in range(MAX_CONTACTS):
        if dot(projected, projected) == 0.0:
            break
        hit = sweep(scene, scratch.cache.traversal, p, scale(projected, factor))
        if hit.alpha > 0.0:
            break
        num_contacts = add_contact(contacts, num_contacts, hit.normal, surface_of(scene, hit)["rolling_coefficient"])
        projected = project_onto_cone(contacts, num_contacts, x)
    return projected, num_contacts


@device_function
def _record_path(path: FloatArray, row: int, p: Vec3, num_substeps: int) -> None:
    """Write position and number of sub-steps to a row of the path, if it has that row."""
    if row < len(path):
        path[row, 0], path[row, 1], path[row, 2] = p.x, p.y, p.z
        path[row, 3] = num_substeps


@device_function
def _is_within_bounds(p: Vec3, lower: Vec3, upper: Vec3) -> bool:
    """Return whether the centre p is within the world's bounds."""
    return lower.x <= p.x <= upper.x and lower.y <= p.y <= upper.y and lower.z <= p.z <= upper.z


@kernel
def simulate_range(
    first: int,
    last: int,
    scene: CompiledScene,
    scratch: Scratch,
    max_steps: int,
    runs: RunBatch,
    path: FloatArray,
    log: FloatArray,
) -> None:
    """Run balls first to last - 1, each until it rests, leaves the bounds, or ``max_steps`` are done.

    Balls on flat ground share the rolling batch, a slot each; all other steps are taken by one ball alone. To record a
    run, pass one ball, a ``path`` (T, 4) for the position and the sub-steps of each step (row 0 is the start), and a
    ``log`` for its bounces. The run is suspended with the status TIME_LIMIT when either is full; called again with
    larger ones it resumes.
    """
    slots = scratch.rolling_batch[0]
    num_slots = min(SIMD_WIDTH, last - first)
    for k in range(num_slots):
        slots["ball"][k] = -1
        slots["active"][k] = 0
        slots["steps_done"][k] = 0

    next_ball = first
    any_active = True
    while any_active:
        # Advance the ball of each inactive slot until it rolls on flat ground or its run ends; then take the next ball.
        any_active = False
        for k in range(num_slots):
            while slots["active"][k] == 0 and (slots["ball"][k] >= 0 or next_ball < last):
                if slots["ball"][k] < 0:
                    slots["ball"][k] = next_ball
                    next_ball += 1
                if not _advance_alone(scene, scratch, k, slots["ball"][k], max_steps, runs, path, log):
                    slots["ball"][k] = -1
            any_active |= slots["active"][k] != 0

        # Advance all active slots together.
        for _ in range(ROLLING_STEPS_PER_CHECK):
            if step_rolling(scene, scratch.rolling_batch, num_slots) == 0:
                break


@inlined_kernel
def _advance_alone(
    scene: CompiledScene,
    scratch: Scratch,
    k: int,
    i: int,
    max_steps: int,
    runs: RunBatch,
    path: FloatArray,
    log: FloatArray,
) -> bool:
    """Advance ball i alone until it enters slot k of the rolling batch or its run ends; return whether it entered."""
    slots = scratch.rolling_batch[0]
    cache = scratch.cache
    result = runs.results[i]
    p = vec3(runs.positions[i])
    v = vec3(runs.velocities[i])
    steps = result["steps"]
    bounces = result["bounces"]
    exhausted = result["exhausted"]

    # Take the ball back from the rolling batch.
    rolling_steps = INT64_ZERO  # Number of consecutive steps in which the ball did nothing but roll.
    if slots["steps_done"][k] > 0:
        p = column(slots["p"], k)
        v = column(slots["v"], k)
        rolling_steps = INT64_ONE
        steps += slots["steps_done"][k]
        slots["steps_done"][k] = 0

    status = STATUS_TIME_LIMIT
    time_left = 0.0
    entered = False
    while steps < max_steps and _has_room(path, log, steps, bounces):
        # Exponential back-off: try to enter the rolling batch after 1, 2, 4, 8, ... rolling steps.
        if rolling_steps > 0 and rolling_steps & (rolling_steps - 1) == 0 and len(path) == 0:
            entered = try_enter(scene, cache.traversal, scratch.contacts, scratch.rolling_batch, k, p, v)
        if entered:
            slots["max_steps"][k] = max_steps - steps
            break

        # Take a time step.
        ball = step(scene, scratch, p, v, log, bounces, steps * scene.dt)
        is_rolling = ball.num_substeps == 2 and ball.bounces == bounces and has_spare_capacity(cache)
        rolling_steps = rolling_steps + 1 if is_rolling else INT64_ZERO
        slots["support"][k] = cache.state[0]["last_hit"]
        p = ball.p
        v = ball.v
        bounces = ball.bounces
        exhausted += int(ball.exhausted)
        steps += 1
        _record_path(path, steps, p, ball.num_substeps)

        # End the run at rest or out of bounds.
        if ball.resting:
            status = STATUS_REST
            time_left = ball.time_left
            break
        if not _is_within_bounds(p, scene.lower, scene.upper):
            status = STATUS_OUT_OF_BOUNDS
            break

    store(runs.positions[i], p)
    store(runs.velocities[i], v)
    _store_result(result, scene.dt, status, steps, bounces, exhausted, time_left)
    return entered


@device_function
def _store_result(
    result: np.void, dt: float, status: int, steps: int, bounces: int, exhausted: int, time_left: float
) -> None:
    """Write how a run stands: a ball at rest did not need the last ``time_left`` of its steps."""
    result["status"] = status
    result["steps"] = steps
    result["bounces"] = bounces
    result["exhausted"] = exhausted
    result["time"] = (steps - 1) * dt + (dt - time_left) if status == STATUS_REST else steps * dt


@device_function
def _has_room(path: FloatArray, log: FloatArray, steps: int, bounces: int) -> bool:
    """Return whether one more step, with a bounce in each sub-step, fits in the record; always, if none is kept."""
    return len(path) == 0 or (steps + 1 < len(path) and bounces + MAX_SUBSTEPS <= len(log))
