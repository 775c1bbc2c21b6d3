"""How fast is it, beside the engines a user could pick instead? Run: python -m benchmarks.speed.

Rates are per second of CPU time on one core: medians of rounds in which all take their turns, so that a slow spell of
the machine hits all alike. benchmarks/scenes.py describes the scenes, benchmarks/peers/ how each engine is set up. With
``--json benchmarks/results/speed.json`` it stores the rates.
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
from benchmarks.report import Records, print_table, short, store
from benchmarks.scenes import CELLS, ROOM, SCENES, FloatArray, Scene, scene_l, scene_m
from minigolf_env.physics import World

LONGEST = 30.0
"""Putts are given up after so much time, s."""
STILL = 0.01
"""Peers' balls slower than this count as at rest, m/s: some creep for ever."""
SINGLES = 16
"""Putts of a peer with one ball a round, one after another."""
LOOK = 120
"""Peers' balls are looked at after so many steps: one second."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    putts: int = 1000
    """Putts of minigolf_env a round, a batch: the last of them leave lanes empty."""
    balls: int = 64
    """Balls of a batch in one world of a peer."""
    sweeps: int = 20_000
    """Sweeps of minigolf_env a round."""
    casts: int = 2_000
    """Sphere casts or rays of a peer a round."""
    rounds: int = 5
    triangles: int = 1_000_000
    """The largest world that is built; a half, a quarter and an eighth of it are too."""
    scenes: tuple[str, ...] = ("S", "M", "L", "T")
    peers: tuple[str, ...] = ("pybullet", "rapier3d", "mujoco")
    seed: int = 0
    json: Path | None = None
    """File of the results: the rates, versions, machine."""


@dataclass(frozen=True)
class Task:
    """One cell of the table: what runs, and its rates so far."""

    row: str
    column: str
    run: Callable[[], float]
    """Works and returns how much it did."""
    counts: bool = True
    """Whether the row's ratio may use it."""
    rates: list[float] = field(default_factory=list)

    def time(self) -> None:
        """Work once and note how much a second of CPU time gave."""
        began = time.process_time()
        work = self.run()
        self.rates.append(work / (time.process_time() - began))


def putting(scene: Scene, args: Args, peers: list[type[Engine]]) -> list[Task]:
    """Return the tasks that count steps and whole putts on a scene."""
    world = scene.world()
    places, velocities = scene.putts(np.random.default_rng(args.seed), args.putts)
    times = world.simulate_batch(places, velocities, LONGEST).time
    steps = float(np.sum(times)) / world.dt
    row, rest = f"steps/s while putting, {scene.name}", f"putts to rest/s, {scene.name}"
    tasks = [
        Task(row, "minigolf_env", partial(play, world, places, velocities, steps)),
        Task(rest, "minigolf_env", partial(play, world, places, velocities, args.putts)),
    ]
    for peer in peers:
        for balls in (1, args.balls):
            engine, name = peer(scene, balls), peer.name + (f", {balls} balls" if balls > 1 else "")
            start = scene.putts(np.random.default_rng(args.seed), max(SINGLES, balls))
            tasks.append(Task(row, name, partial(roll, engine, *start, round(steps / args.putts))))
            tasks.append(Task(rest, name, partial(putt, engine, *start)))
    return tasks


def play(world: World, places: FloatArray, velocities: FloatArray, work: float) -> float:
    """Run our balls until they rest and return what that counts for."""
    world.simulate_batch(places, velocities, LONGEST)
    return work


def roll(engine: Engine, places: FloatArray, velocities: FloatArray, steps: int) -> float:
    """Run an engine's balls from all starts, as long as an average putt of ours, and return the steps of all balls."""
    balls = len(engine.state()[0])
    for k in range(0, len(places), balls):
        engine.set(places[k : k + balls], velocities[k : k + balls])
        engine.step(steps)
    return steps * len(places)


def putt(engine: Engine, places: FloatArray, velocities: FloatArray) -> float:
    """Run an engine's balls from all starts until they rest or have left the room; return their number."""
    balls = len(engine.state()[0])
    for k in range(0, len(places), balls):
        engine.set(places[k : k + balls], velocities[k : k + balls])
        for _ in range(math.ceil(LONGEST)):
            engine.step(LOOK)
            p, v = engine.state()
            inside = ((p >= ROOM[0]) & (p <= ROOM[1])).all(axis=1)
            if (np.linalg.norm(v[inside], axis=1) < STILL).all():
                break
    return len(places)


def sweeping(scene: Scene, args: Args, peers: list[type[Engine]]) -> list[Task]:
    """Return the tasks that sweep spheres, 1 m from free points in all directions, through a scene."""
    world, row = scene.world(), f"sphere sweeps/s, {scene.name}"
    ways = scene.sweeps(np.random.default_rng(args.seed), args.sweeps)
    tasks = [Task(row, "minigolf_env", partial(sweep, world, *ways))]
    some = ways[0][: args.casts], ways[1][: args.casts]
    for peer in peers:
        counts = peer.cast_kind == "sphere"
        tasks.append(Task(row, peer.name, partial(cast, peer(scene), *some), counts))
    return tasks


def sweep(world: World, starts: FloatArray, ends: FloatArray) -> float:
    """Sweep our ball and return how often."""
    world.sweep_batch(starts, ends)
    return len(starts)


def cast(engine: Engine, starts: FloatArray, ends: FloatArray) -> float:
    """Cast an engine's sphere or ray and return how often."""
    engine.cast(starts, ends)
    return len(starts)


def measure(tasks: list[Task], rounds: int) -> None:
    """Run each task once to compile and warm up, then all in turn so many times."""
    for task in tasks:
        task.run()
    for _ in range(rounds):
        for task in tasks:
            task.time()


def print_rates(tasks: list[Task], rounds: int) -> Records:
    """Run all tasks in turn, and print a row for each row and each engine: its rate, and ours as a multiple of it.

    Returns:
        The rates, a second of CPU time, of each row by the engine's name.
    """
    measure(tasks, rounds)
    columns = list(dict.fromkeys(task.column for task in tasks))
    rows, found = [], {}
    for row in dict.fromkeys(task.row for task in tasks):
        cells = {task.column: task for task in tasks if task.row == row}
        rates = {column: statistics.median(task.rates) for column, task in cells.items()}
        found[row] = {c + ("" if cells[c].counts else " (rays)"): float(f"{rate:.4g}") for c, rate in rates.items()}
        best = max((rates[c] for c, task in cells.items() if c != columns[0] and task.counts), default=math.nan)
        shown = [short(rates[c]) + ("" if cells[c].counts else " rays") if c in cells else "" for c in columns]
        rows.append([row, *shown, "" if math.isnan(best) else f"{rates[columns[0]] / best:.1f}x"])
    print_table(["", *columns, "ours / best peer"], rows)
    return found


def print_scaling(args: Args, threads: int) -> None:
    """Print what the number of triangles changes, and a second thread if numba has as many."""
    pair = {sections: scene_l(sections) for sections in (22, CELLS)}
    ways = pair[CELLS].sweeps(np.random.default_rng(args.seed), args.sweeps)
    tasks = [Task(str(s.triangles), "", partial(sweep, s.world(), *ways)) for s in pair.values()]
    measure(tasks, args.rounds)
    few, many = (statistics.median(task.rates) for task in tasks)
    rows = [[f"sweeps among {tasks[1].row} triangles, time against {tasks[0].row}", f"{few / many:.2f}x"]]
    if threads >= 2:
        rows.append(["two threads against one, wall clock, putts on M", f"{two_threads(args):.2f}x"])
    else:
        print("Two threads are left out: numba was started with one (NUMBA_NUM_THREADS).\n")
    print_table(["", "minigolf_env"], rows)


def two_threads(args: Args) -> float:
    """Return how much faster a batch of putts is on two threads; leaves numba with one."""
    world = scene_m().world()
    walls: dict[int, list[float]] = {1: [], 2: []}
    start = scene_m().putts(np.random.default_rng(args.seed), 4 * args.putts)
    for _ in range(args.rounds):
        for threads, seconds in walls.items():
            numba.set_num_threads(threads)
            began = time.perf_counter()
            world.simulate_batch(*start, LONGEST)
            seconds.append(time.perf_counter() - began)
    numba.set_num_threads(1)
    return statistics.median(walls[1]) / statistics.median(walls[2])


def print_building(args: Args) -> None:
    """Print how long worlds with a bumpy torus take to build, and what they keep.

    A quadratic step would double the time a triangle from row to row.
    """
    rows = []
    for triangles in (min(100_000, args.triangles), *(args.triangles // part for part in (8, 4, 2, 1))):
        scene = scene_l(round(math.sqrt(triangles / 2)))
        began = time.process_time()
        scene.world()
        seconds = time.process_time() - began
        kept, peak = memory(scene.world)
        n = scene.triangles
        cells = f"{seconds:.2f}", f"{1e6 * seconds / n:.2f}", f"{kept / n:.0f}", f"{peak / n:.0f}"
        rows.append([f"{n:,}", *cells])
    print_table(["triangles", "build, CPU s", "us a triangle", "bytes kept a triangle", "at most while building"], rows)


def memory(build: Callable[[], World]) -> tuple[int, int]:
    """Return the bytes that a world keeps, with its meshes, and the most that its building holds."""
    gc.collect()
    tracemalloc.start()
    world = build()
    gc.collect()
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del world
    return kept, peak


def main(args: Args) -> None:
    """Print the tables, store the rates if asked."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    peers = load_peers(args.peers)
    scenes = {name: SCENES[name]() for name in args.scenes}
    tasks = [task for scene in scenes.values() for task in putting(scene, args, peers)]
    tasks += [task for name in ("M", "L") if name in scenes for task in sweeping(scenes[name], args, peers)]
    rates = print_rates(tasks, args.rounds)
    if args.json is not None:
        store(args.json, args, args.peers, rates=rates)
    print_scaling(args, threads)
    print_building(args)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
