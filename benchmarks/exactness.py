"""How exact is it, beside the engines a user could pick instead? Run: python -m benchmarks.exactness.

Plays the same putts and throws in every engine and measures what must not happen: balls through walls, balls in
surfaces, energy lost or won, late contacts. With ``--figure docs/figures/energy.png`` it also draws the energy, with
``--json benchmarks/results/exactness.json`` it stores what it found.
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

from benchmarks.energy_figure import SHARES, draw, spread
from benchmarks.peers import load_peers
from benchmarks.peers.engine import GRAVITY, Conservative, Engine, Minigolf
from benchmarks.report import as_records, print_table, store
from benchmarks.scenes import RADIUS, ROOM, FloatArray, Scene, directions, scene_d, scene_m, scene_s, scene_t, scene_w
from minigolf_env.physics import Surface

WALLS = (-1.0, 1.0)
"""Where scene W has its walls, m along x: balls stay on their side."""
ELASTIC = Surface(damping=1.0, rolling=0.0)
"""Keeps all energy."""
BATCH = 100
"""Balls in one world at a time: as many worlds as it takes, each fresh."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    putts: int = 2_000
    """Putts through W at 30 m/s with steps of 1/60 s."""
    slow_putts: int = 200
    """Putts on D and T at 0.5 to 8 m/s with steps of 1/120 s."""
    throws: int = 50
    """Throws of 3 m/s whose energy is followed."""
    seconds: float = 60.0
    """How long, s."""
    sweeps: int = 10_000
    figure: Path | None = None
    """File of the figure of the energy, .png or .svg."""
    json: Path | None = None
    """File of the results: the table, the error of the energy over time, versions, machine."""
    peers: tuple[str, ...] = ("pybullet", "rapier3d", "mujoco")
    seed: int = 0


def outside(positions: FloatArray, starts: FloatArray, walls: Sequence[float]) -> NDArray[np.bool_]:
    """Return for each ball (N, 3) whether it has left the room, or the side of the walls where it started."""
    left = ~((positions >= ROOM[0]) & (positions <= ROOM[1])).all(axis=1)
    return np.asarray(left | (np.digitize(positions[:, 0], walls) != np.digitize(starts[:, 0], walls)))


def containment(
    engine: type[Engine], scene: Scene, putts: tuple[FloatArray, FloatArray], dt: float, seconds: float
) -> tuple[int, float]:
    """Return how many putts end behind a wall, and how deep balls were in a surface at most, m.

    minigolf_env measures the depth for all engines, after every step, from a ball's centre to the nearest triangle: the
    measure ends at one radius, where the centre passes through the surface.
    """
    judge, lost, deepest = scene.world(), 0, 0.0
    walls = WALLS if scene.name == "W" else ()
    for k in range(0, len(putts[0]), BATCH):
        places, velocities = (values[k : k + BATCH] for values in putts)
        balls = engine(scene, len(places), dt)
        balls.set(places, velocities)
        for _ in range(round(seconds / dt)):
            balls.step(1)
            positions = balls.state()[0]
            out = outside(positions, places, walls)
            deepest = max(deepest, -judge.clearance(positions[~out]).min(initial=0.0))
        lost += int(out.sum())
        balls.close()
    return lost, deepest


def energy(engine: type[Engine], args: Args, interval: float = 0.25) -> FloatArray:
    """Return the relative error (samples, throws) of the energy of elastic throws through M; NaN for lost balls.

    The energy is kinetic, and potential above a ball on the floor.
    """
    scene = replace(scene_m(), surface=ELASTIC)
    rng = np.random.default_rng(args.seed)
    places, velocities = scene.free_points(rng, args.throws), 3.0 * directions(rng, args.throws)
    balls = engine(scene, args.throws)
    balls.set(places, velocities)
    energies, out = [total(places, velocities)], [np.zeros(args.throws, bool)]
    for _ in range(math.ceil(args.seconds / interval)):
        balls.step(round(interval * 120))
        positions, speeds = balls.state()
        out.append(outside(positions, places, ()))
        energies.append(total(positions, speeds))
    balls.close()
    gone = np.logical_and.accumulate(out[::-1])[::-1]  # From here to the end it is outside.
    return np.where(gone, np.nan, np.array(energies) / energies[0] - 1.0)


def total(positions: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return the energies (N,) of balls of 1 kg, J."""
    return np.asarray(0.5 * np.sum(velocities**2, axis=1) + GRAVITY * (positions[:, 2] - RADIUS))


def lateness(engine: type[Engine], args: Args) -> float | None:
    """Return the largest error of the place of contact of sweeps to the walls of S, m; None if it casts no spheres.

    The centre stays in a box that is one radius smaller than the room: the way to its first side is a quotient.
    """
    if engine.cast_kind != "sphere":
        return None
    rng, length = np.random.default_rng(args.seed), 5.0
    scene = scene_s()
    starts, ends = scene.sweeps(rng, args.sweeps, length)
    ways = ends - starts
    sides = np.where(ways > 0.0, ROOM[1] - RADIUS, ROOM[0] + RADIUS)
    exact = ((sides - starts) / ways).min(axis=1)
    return float(np.abs(engine(scene).cast(starts, ends) - np.minimum(exact, 1.0)).max() * length)


def containment_rows(engines: list[type[Engine]], args: Args) -> list[list[str]]:
    """Return a row of lost balls and one of depths for each scene."""
    rng = np.random.default_rng(args.seed)
    fast = scene_w().putts(rng, args.putts, 30.0, 30.0)
    rows = []
    for scene, putts, dt, what in (
        (scene_w(), fast, 1 / 60, "30 m/s, dt 1/60 s"),
        (scene_d(), scene_d().putts(rng, args.slow_putts), 1 / 120, "0.5-8 m/s, dt 1/120 s"),
        (scene_t(), scene_t().putts(rng, args.slow_putts), 1 / 120, "0.5-8 m/s, dt 1/120 s"),
    ):
        found = [containment(engine, scene, putts, dt, seconds=1.0) for engine in engines]
        case = f"{scene.name}, {what}, {len(putts[0]):,} putts:"
        rows.append([f"{case} behind a wall", *(f"{lost}" for lost, _ in found)])
        rows.append([f"{case} deepest in a surface, mm", *(f"{1e3 * deep:.2g}" for _, deep in found)])
    return rows


def energy_rows(errors: list[FloatArray], args: Args) -> list[list[str]]:
    """Return what became of the energy at the end, and the largest error on the way."""
    case = f"M, e = 1, {args.throws} throws, {args.seconds:g} s:"
    ends = [error[-1][~np.isnan(error[-1])] for error in errors]
    return [
        [f"{case} balls that left the room", *(str(args.throws - len(end)) for end in ends)],
        [f"{case} median relative change of energy", *(f"{np.median(end):+.1e}" if len(end) else "" for end in ends)],
        [f"{case} largest gain on the way", *(f"{np.nanmax(error):+.1e}" for error in errors)],
        [f"{case} largest error on the way", *(f"{np.nanmax(np.abs(error)):.1e}" for error in errors)],
    ]


def over_time(error: FloatArray, args: Args) -> dict[str, list[float | None]]:
    """Return how large errors (samples, throws) are, second by second: SHARES of the balls still there, or None."""
    each = round((len(error) - 1) / args.seconds)
    found: dict[str, list[float | None]] = {"seconds": [k / each for k in range(0, len(error), each)]}
    for share, row in zip(SHARES, spread(np.abs(error[::each]))):
        found[f"quantile {share:g}"] = [None if np.isnan(size) else float(f"{size:.3g}") for size in row]
    return found


def main(args: Args) -> None:
    """Print the table, store it and draw the figure if asked."""
    numba.set_num_threads(1)
    engines: list[type[Engine]] = [Minigolf, Conservative, *load_peers(args.peers)]
    errors = [energy(engine, args) for engine in engines]
    late = [lateness(engine, args) for engine in engines]
    rows = containment_rows(engines, args) + energy_rows(errors, args)
    row = f"S, {args.sweeps:,} sweeps of 5 m: largest error of the place of contact, mm"
    rows.append([row, *("no sphere cast" if error is None else f"{1e3 * error:.1e}" for error in late)])
    header = ["", *(engine.name for engine in engines)]
    print_table(header, rows)
    if args.json is not None:
        energies = {engine.name: over_time(error, args) for engine, error in zip(engines, errors)}
        store(args.json, args, args.peers, table=as_records(header, rows), energy_error=energies)
    if args.figure is not None:
        draw({engine.name: error for engine, error in zip(engines, errors)}, args.seconds, args.figure)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
