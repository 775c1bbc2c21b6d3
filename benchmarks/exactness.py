"""Measure the errors of the physics next to other engines: ``python -m benchmarks.exactness``.

The same putts and throws run in every engine. Measured are tunnelling, penetration, energy drift, and the error of
contact positions. ``--figure docs/figures/energy.png`` draws the energy, ``--json benchmarks/results/exactness.json``
stores the results.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numba
import numpy as np
import tyro
from numpy.typing import NDArray

from benchmarks.energy_figure import BAND_QUANTILES, draw_energy_error, quantile_band
from benchmarks.peers import load_peers
from benchmarks.peers.engine import GRAVITY_ACCELERATION, Conservative, Engine, Minigolf
from benchmarks.report import check_files, print_table, store_results, table_records
from benchmarks.scenes import (
    BALL_RADIUS,
    ROOM_BOUNDS,
    FloatArray,
    Scene,
    directions,
    scene_d,
    scene_m,
    scene_s,
    scene_t,
    scene_w,
)
from minigolf_env.physics import Surface

WALL_POSITIONS = (-1.0, 1.0)
"""x of the walls of scene W, m; balls must stay on their side."""
ELASTIC_SURFACE = Surface(damping=1.0, rolling=0.0)
"""Surface that keeps all energy."""
BALLS_PER_WORLD = 100
"""Largest number of balls in one world of an engine; more balls get more worlds."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    putts: int = 2_000
    """Number of putts on W at 30 m/s with a dt of 1/60 s."""
    slow_putts: int = 200
    """Number of putts on D and T at 0.5 to 8 m/s with a dt of 1/120 s."""
    throws: int = 50
    """Number of throws at 3 m/s whose energy is measured."""
    seconds: float = 60.0
    """Duration of the throws, s."""
    sweeps: int = 10_000
    """Number of sweeps whose contact position is measured."""
    figure: Path | None = None
    """File for the figure of the energy, .png or .svg."""
    json: Path | None = None
    """File for the table, the energy error over time, versions and machine."""
    peers: tuple[str, ...] = ("pybullet", "rapier3d", "mujoco")
    """Packages of the other engines."""
    seed: int = 0
    """RNG seed of the putts, throws and sweeps."""


def left_room(positions: FloatArray, starts: FloatArray, walls: Sequence[float]) -> NDArray[np.bool_]:
    """Return a mask of the balls (N, 3) that are outside the room or behind a wall at x = walls."""
    outside = ~((positions >= ROOM_BOUNDS[0]) & (positions <= ROOM_BOUNDS[1])).all(axis=1)
    return np.asarray(outside | (np.digitize(positions[:, 0], walls) != np.digitize(starts[:, 0], walls)))


def measure_containment(
    engine: type[Engine], scene: Scene, putts: tuple[FloatArray, FloatArray], dt: float, seconds: float
) -> tuple[int, float]:
    """Return the number of putts that end behind a wall, and the largest penetration of a surface, m.

    minigolf_env measures the penetration for all engines after every step, as radius minus the distance of the ball's
    centre to the nearest triangle. It is at most one radius, where the centre passes through the surface.
    """
    reference_world = scene.world()
    num_lost = 0
    deepest = 0.0
    walls = WALL_POSITIONS if scene.name == "W" else ()
    for k in range(0, len(putts[0]), BALLS_PER_WORLD):
        starts, velocities = (values[k : k + BALLS_PER_WORLD] for values in putts)
        balls = engine(scene, len(starts), dt)
        balls.set(starts, velocities)
        for _ in range(round(seconds / dt)):
            balls.step(1)
            positions = balls.state()[0]
            lost = left_room(positions, starts, walls)
            deepest = max(deepest, -reference_world.clearance(positions[~lost]).min(initial=0.0))
        num_lost += int(lost.sum())
        balls.close()
    return num_lost, deepest


def measure_energy_error(engine: type[Engine], args: Args, interval: float = 0.25) -> FloatArray:
    """Return the relative energy error (samples, throws) of elastic throws through M; NaN for lost balls.

    The energy is kinetic plus potential energy, which is 0 for a ball on the floor.
    """
    scene = replace(scene_m(), surface=ELASTIC_SURFACE)
    rng = np.random.default_rng(args.seed)
    starts = scene.free_points(rng, args.throws)
    velocities = 3.0 * directions(rng, args.throws)
    balls = engine(scene, args.throws)
    balls.set(starts, velocities)
    energies = [total_energy(starts, velocities)]
    lost = [np.zeros(args.throws, bool)]
    for _ in range(math.ceil(args.seconds / interval)):
        balls.step(round(interval * 120))
        positions, speeds = balls.state()
        lost.append(left_room(positions, starts, ()))
        energies.append(total_energy(positions, speeds))
    balls.close()
    # A ball is lost from the moment after which it stays outside.
    is_lost = np.logical_and.accumulate(lost[::-1])[::-1]
    return np.where(is_lost, np.nan, np.array(energies) / energies[0] - 1.0)


def total_energy(positions: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return the energies (N,) of balls of 1 kg, J."""
    return np.asarray(0.5 * np.sum(velocities**2, axis=1) + GRAVITY_ACCELERATION * (positions[:, 2] - BALL_RADIUS))


def largest_contact_error(engine: type[Engine], args: Args) -> float | None:
    """Return the largest error of the contact position of sweeps to the walls of S, m; None without sphere casts.

    The centre stays in a box that is one radius smaller than the room, so the exact hit fraction is a quotient.
    """
    if engine.cast_kind != "sphere":
        return None
    rng = np.random.default_rng(args.seed)
    length = 5.0
    scene = scene_s()
    starts, ends = scene.sweeps(rng, args.sweeps, length)
    deltas = ends - starts
    sides = np.where(deltas > 0.0, ROOM_BOUNDS[1] - BALL_RADIUS, ROOM_BOUNDS[0] + BALL_RADIUS)
    exact = ((sides - starts) / deltas).min(axis=1)
    return float(np.abs(engine(scene).cast(starts, ends) - np.minimum(exact, 1.0)).max() * length)


def containment_rows(engines: list[type[Engine]], args: Args) -> list[list[str]]:
    """Return a row of lost balls and a row of penetrations for each scene."""
    rng = np.random.default_rng(args.seed)
    fast = scene_w().putts(rng, args.putts, 30.0, 30.0)
    rows = []
    for scene, putts, dt, settings in (
        (scene_w(), fast, 1 / 60, "30 m/s, dt 1/60 s"),
        (scene_d(), scene_d().putts(rng, args.slow_putts), 1 / 120, "0.5-8 m/s, dt 1/120 s"),
        (scene_t(), scene_t().putts(rng, args.slow_putts), 1 / 120, "0.5-8 m/s, dt 1/120 s"),
    ):
        results = [measure_containment(engine, scene, putts, dt, seconds=1.0) for engine in engines]
        case = f"{scene.name}, {settings}, {len(putts[0]):,} putts:"
        rows.append([f"{case} behind a wall", *(f"{lost}" for lost, _ in results)])
        rows.append([f"{case} deepest in a surface, mm", *(f"{1e3 * deep:.2g}" for _, deep in results)])
    return rows


def energy_rows(errors: list[FloatArray], args: Args) -> list[list[str]]:
    """Return rows with the energy change at the end, and with the largest gain and error during the throws."""
    case = f"M, e = 1, {args.throws} throws, {args.seconds:g} s:"
    ends = [error[-1][~np.isnan(error[-1])] for error in errors]
    return [
        [f"{case} balls that left the room", *(str(args.throws - len(end)) for end in ends)],
        [f"{case} median relative change of energy", *(f"{np.median(end):+.1e}" if len(end) else "" for end in ends)],
        [f"{case} largest gain on the way", *(f"{np.nanmax(error):+.1e}" for error in errors)],
        [f"{case} largest error on the way", *(f"{np.nanmax(np.abs(error)):.1e}" for error in errors)],
    ]


def errors_by_second(error: FloatArray, args: Args) -> dict[str, list[float | None]]:
    """Return BAND_QUANTILES of the absolute error (samples, throws) for each second; None where no ball is left."""
    per_second = round((len(error) - 1) / args.seconds)
    columns: dict[str, list[float | None]] = {"seconds": [k / per_second for k in range(0, len(error), per_second)]}
    for quantile, row in zip(BAND_QUANTILES, quantile_band(np.abs(error[::per_second]))):
        columns[f"quantile {quantile:g}"] = [None if np.isnan(value) else float(f"{value:.3g}") for value in row]
    return columns


def main(args: Args) -> None:
    """Print the table; store it and draw the figure if files are given."""
    check_files(args)
    numba.set_num_threads(1)
    engines: list[type[Engine]] = [Minigolf, Conservative, *load_peers(args.peers)]
    errors = [measure_energy_error(engine, args) for engine in engines]
    contact_errors = [largest_contact_error(engine, args) for engine in engines]
    rows = containment_rows(engines, args) + energy_rows(errors, args)
    contact_row = f"S, {args.sweeps:,} sweeps of 5 m: largest error of the place of contact, mm"
    rows.append(
        [contact_row, *("no sphere cast" if error is None else f"{1e3 * error:.1e}" for error in contact_errors)]
    )
    header = ["", *(engine.name for engine in engines)]
    print_table(header, rows)
    if args.json is not None:
        errors_by_engine = {engine.name: errors_by_second(error, args) for engine, error in zip(engines, errors)}
        store_results(args.json, args, args.peers, table=table_records(header, rows), energy_error=errors_by_engine)
    if args.figure is not None:
        draw_energy_error({engine.name: error for engine, error in zip(engines, errors)}, args.seconds, args.figure)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
