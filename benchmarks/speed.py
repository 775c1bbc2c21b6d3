"""Measure the speed of the physics next to other engines: ``python -m benchmarks.speed``.

Rates are per second of CPU time on one core. Each is the median of rounds in which all engines take turns, so that a
slow period of the machine affects all of them. benchmarks/scenes.py describes the scenes, benchmarks/peers/ the set-up
of each engine. ``--json benchmarks/results/speed.json`` stores the rates.
"""

from __future__ import annotations

import gc
import math
import statistics
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numba
import numpy as np
import tyro

from benchmarks.peers import load_peers
from benchmarks.peers.engine import Engine
from benchmarks.report import TableRecords, check_files, format_rate, print_table, store_results
from benchmarks.scenes import GREEN_CELLS, ROOM_BOUNDS, SCENE_BUILDERS, FloatArray, Scene, scene_l, scene_m
from minigolf_env.physics import World

MAX_SIMULATED_TIME = 30.0
"""Longest simulated time of a putt, s."""
REST_SPEED = 0.01
"""Speed below which a peer's ball counts as at rest, m/s; some never stop completely."""
NUM_SINGLE_PUTTS = 16
"""Number of putts per round of a peer with one ball."""
STEPS_PER_REST_CHECK = 120
"""Number of steps between two checks whether a peer's balls rest: one second."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command line."""

    putts: int = 1000
    """Number of putts of minigolf_env per round, in one batch; the last of them do not fill a SIMD batch."""
    balls: int = 64
    """Number of balls in one world of a peer."""
    sweeps: int = 20_000
    """Number of sweeps of minigolf_env per round."""
    casts: int = 2_000
    """Number of sphere casts or rays of a peer per round."""
    rounds: int = 5
    """Number of rounds."""
    triangles: int = 1_000_000
    """Number of triangles of the largest world that is built; a half, a quarter and an eighth of it are built too."""
    scenes: tuple[str, ...] = ("S", "M", "L", "T")
    """Names of the scenes."""
    peers: tuple[str, ...] = ("pybullet", "rapier3d", "mujoco")
    """Packages of the other engines."""
    seed: int = 0
    """RNG seed of the putts and sweeps."""
    json: Path | None = None
    """File for the rates, versions and machine."""


@dataclass(frozen=True)
class Measurement:
    """One cell of the table: the work, and its rates so far."""

    row: str
    column: str
    run: Callable[[], float]
    """Function that does the work and returns its amount."""
    is_comparable: bool = True
    """False if the row's ratio must not use the rate."""
    rates: list[float] = field(default_factory=list)

    def time(self) -> None:
        """Do the work once and record its rate for a second of CPU time."""
        start = time.process_time()
        work = self.run()
        self.rates.append(work / (time.process_time() - start))


def putt_measurements(scene: Scene, args: Args, peers: list[type[Engine]]) -> list[Measurement]:
    """Return the measurements of steps and whole putts on a scene."""
    world = scene.world()
    positions, velocities = scene.putts(np.random.default_rng(args.seed), args.putts)
    times = world.simulate_batch(positions, velocities, MAX_SIMULATED_TIME).time
    steps = float(np.sum(times)) / world.dt
    step_row = f"steps/s while putting, {scene.name}"
    putt_row = f"putts to rest/s, {scene.name}"
    measurements = [
        Measurement(step_row, "minigolf_env", partial(simulate_putts, world, positions, velocities, steps)),
        Measurement(putt_row, "minigolf_env", partial(simulate_putts, world, positions, velocities, args.putts)),
    ]
    for peer in peers:
        for balls in (1, args.balls):
            engine = peer(scene, balls)
            name = peer.name + (f", {balls} balls" if balls > 1 else "")
            putts = scene.putts(np.random.default_rng(args.seed), max(NUM_SINGLE_PUTTS, balls))
            measurements.append(
                Measurement(step_row, name, partial(step_peer, engine, *putts, round(steps / args.putts)))
            )
            measurements.append(Measurement(putt_row, name, partial(simulate_peer_putts, engine, *putts)))
    return measurements


def simulate_putts(world: World, positions: FloatArray, velocities: FloatArray, work: float) -> float:
    """Simulate our putts until they rest; return the given amount of work."""
    world.simulate_batch(positions, velocities, MAX_SIMULATED_TIME)
    return work


def step_peer(engine: Engine, positions: FloatArray, velocities: FloatArray, steps: int) -> float:
    """Step a peer's balls from all starts, as long as our average putt; return the number of steps of all balls."""
    balls = len(engine.state()[0])
    for k in range(0, len(positions), balls):
        engine.set(positions[k : k + balls], velocities[k : k + balls])
        engine.step(steps)
    return steps * len(positions)


def simulate_peer_putts(engine: Engine, positions: FloatArray, velocities: FloatArray) -> float:
    """Step a peer's balls from all starts until they rest or have left the room; return their number."""
    balls = len(engine.state()[0])
    for k in range(0, len(positions), balls):
        engine.set(positions[k : k + balls], velocities[k : k + balls])
        for _ in range(math.ceil(MAX_SIMULATED_TIME)):
            engine.step(STEPS_PER_REST_CHECK)
            ball_positions, ball_velocities = engine.state()
            inside = ((ball_positions >= ROOM_BOUNDS[0]) & (ball_positions <= ROOM_BOUNDS[1])).all(axis=1)
            if (np.linalg.norm(ball_velocities[inside], axis=1) < REST_SPEED).all():
                break
    return len(positions)


def sweep_measurements(scene: Scene, args: Args, peers: list[type[Engine]]) -> list[Measurement]:
    """Return the measurements of sphere sweeps: 1 m long, from free points in all directions."""
    world = scene.world()
    row = f"sphere sweeps/s, {scene.name}"
    starts, ends = scene.sweeps(np.random.default_rng(args.seed), args.sweeps)
    measurements = [Measurement(row, "minigolf_env", partial(sweep_balls, world, starts, ends))]
    for peer in peers:
        casts = partial(cast_peer, peer(scene), starts[: args.casts], ends[: args.casts])
        measurements.append(Measurement(row, peer.name, casts, is_comparable=peer.cast_kind == "sphere"))
    return measurements


def sweep_balls(world: World, starts: FloatArray, ends: FloatArray) -> float:
    """Sweep our ball; return the number of sweeps."""
    world.sweep_batch(starts, ends)
    return len(starts)


def cast_peer(engine: Engine, starts: FloatArray, ends: FloatArray) -> float:
    """Cast a peer's sphere or ray; return the number of casts."""
    engine.cast(starts, ends)
    return len(starts)


def measure(measurements: list[Measurement], rounds: int) -> None:
    """Do each measurement once to compile and warm up, then all in turn for a number of rounds."""
    for measurement in measurements:
        measurement.run()
    for _ in range(rounds):
        for measurement in measurements:
            measurement.time()


def print_rates(measurements: list[Measurement], rounds: int) -> TableRecords:
    """Measure, and print a table of the rates of each engine and the ratio of our rate to the best peer's.

    Returns:
        Rates for a second of CPU time, by row and engine.
    """
    measure(measurements, rounds)
    columns = list(dict.fromkeys(measurement.column for measurement in measurements))
    rows = []
    all_rates = {}
    for row in dict.fromkeys(measurement.row for measurement in measurements):
        cells = {measurement.column: measurement for measurement in measurements if measurement.row == row}
        rates = {column: statistics.median(measurement.rates) for column, measurement in cells.items()}
        all_rates[row] = {
            column + ("" if cells[column].is_comparable else " (rays)"): float(f"{rate:.4g}")
            for column, rate in rates.items()
        }
        peer_rates = [rates[column] for column, cell in cells.items() if column != columns[0] and cell.is_comparable]
        texts = [
            format_rate(rates[column]) + ("" if cells[column].is_comparable else " rays") if column in cells else ""
            for column in columns
        ]
        rows.append([row, *texts, f"{rates[columns[0]] / max(peer_rates):.1f}x" if peer_rates else ""])
    print_table(["", *columns, "ours / best peer"], rows)
    return all_rates


def print_scaling(args: Args, threads: int) -> None:
    """Print the effect of the number of triangles, and of a second thread if numba has one."""
    small, large = scene_l(22), scene_l(GREEN_CELLS)
    starts, ends = large.sweeps(np.random.default_rng(args.seed), args.sweeps)
    measurements = [
        Measurement(str(scene.triangles), "", partial(sweep_balls, scene.world(), starts, ends))
        for scene in (small, large)
    ]
    measure(measurements, args.rounds)
    small_rate, large_rate = (statistics.median(measurement.rates) for measurement in measurements)
    rows = [
        [
            f"sweeps among {measurements[1].row} triangles, time against {measurements[0].row}",
            f"{small_rate / large_rate:.2f}x",
        ]
    ]
    if threads >= 2:
        rows.append(["two threads against one, wall clock, putts on M", f"{two_threads(args):.2f}x"])
    else:
        print("Two threads are not measured: numba was started with one (NUMBA_NUM_THREADS).\n")
    print_table(["", "minigolf_env"], rows)


def two_threads(args: Args) -> float:
    """Return the speed-up of a batch of putts on two threads; numba is left with one thread."""
    world = scene_m().world()
    wall_times: dict[int, list[float]] = {1: [], 2: []}
    positions, velocities = scene_m().putts(np.random.default_rng(args.seed), 4 * args.putts)
    for _ in range(args.rounds):
        for threads, seconds in wall_times.items():
            numba.set_num_threads(threads)
            start = time.perf_counter()
            world.simulate_batch(positions, velocities, MAX_SIMULATED_TIME)
            seconds.append(time.perf_counter() - start)
    numba.set_num_threads(1)
    return statistics.median(wall_times[1]) / statistics.median(wall_times[2])


def print_build_times(args: Args) -> None:
    """Print build times and memory of worlds with a bumpy torus.

    If a part of the build took quadratic time, the time for a triangle would double from row to row.
    """
    rows = []
    for triangles in (min(100_000, args.triangles), *(args.triangles // divisor for divisor in (8, 4, 2, 1))):
        scene = scene_l(round(math.sqrt(triangles / 2)))
        start = time.process_time()
        scene.world()
        seconds = time.process_time() - start
        kept, peak = measure_memory(scene.world)
        n = scene.triangles
        time_cells = [f"{seconds:.2f}", f"{1e6 * seconds / n:.2f}"]
        memory_cells = [f"{kept / n:.0f}", f"{peak / n:.0f}"]
        rows.append([f"{n:,}", *time_cells, *memory_cells])
    print_table(
        ["triangles", "build, CPU s", "us per triangle", "bytes kept per triangle", "peak bytes per triangle"], rows
    )


def measure_memory(build: Callable[[], World]) -> tuple[int, int]:
    """Return the memory of a world and its meshes, and the peak while it is built, bytes."""
    gc.collect()
    tracemalloc.start()
    world = build()
    gc.collect()
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del world
    return kept, peak


def main(args: Args) -> None:
    """Print the tables; store the rates if a file is given."""
    check_files(args)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    peers = load_peers(args.peers)
    scenes = {name: SCENE_BUILDERS[name]() for name in args.scenes}
    measurements = []
    for scene in scenes.values():
        measurements += putt_measurements(scene, args, peers)
    for name in ("M", "L"):
        if name in scenes:
            measurements += sweep_measurements(scenes[name], args, peers)
    rates = print_rates(measurements, args.rounds)
    if args.json is not None:
        store_results(args.json, args, args.peers, rates=rates)
    print_scaling(args, threads)
    print_build_times(args)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
