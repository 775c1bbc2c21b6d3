"""Play putts in every direction and at every speed on all cores of a Ray cluster: where they end, and which hole out.

``python -m agents.putt_map --directions 20000 --speeds 5000`` plays 10^8 putts, on this machine alone or with
``--address auto`` on the cluster it is a node of. The same command goes on after an interruption. The folder then holds

- ``putts-FIRST-LAST.npz`` for each range of directions: "result" (D, S), numbers of ``minigolf_env.envs.task.Result``,
  "position" (D, S, 3), where the ball ended, m, float32, and "seconds", what it took a core to play them;
- ``map.npz``: how many putts had each result ("counts"), and how many balls came to rest in each cell of the course
  ("heat", its edges "x" and "y", m); ``map.png``: the same as a picture.
"""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from rich.console import Console
from tqdm import tqdm

from agents.cluster import connect
from minigolf_env import __version__
from minigolf_env._atomic_io import atomic_write, write_text
from minigolf_env.apps import putt_map as maps
from minigolf_env.courses import Course, load_course
from minigolf_env.envs.task import Result

Arrays = dict[str, Any]


@dataclass(frozen=True)
class Args:
    """The command line."""

    course: str = "dogleg"
    tee: tuple[float, float] | None = None
    """Where the ball lies, x, y, m; by default in the middle of the tee."""
    directions: int = 2_000
    speeds: int = 500
    """Up to the course's top speed."""
    shard: int = 100_000
    """Putts of a file, about: a minute's work of a core, and what an interruption loses on each."""
    cell: float = 0.01
    """Side of the cells of the heat map, m."""
    out: Path | None = None
    """Folder of the files; by default runs/COURSE-map. Files that are there already are not played again."""
    address: str | None = None
    """Of a Ray cluster: "auto" on one of its nodes, or HOST:PORT; by default Ray starts on this machine alone."""
    num_cpus: int | None = None
    """Cores that a Ray started here uses; by default all."""


def shards(args: Args) -> list[range]:
    """Return the ranges of directions that are played together."""
    rows = max(1, args.shard // args.speeds)
    return [range(first, min(first + rows, args.directions)) for first in range(0, args.directions, rows)]


def file_of(folder: Path, among: range) -> Path:
    """Return the file of a range of directions."""
    return folder / f"putts-{among.start:07d}-{among.stop:07d}.npz"


def play(course: Course, args: Args, among: range) -> Arrays:
    """Return what becomes of a range's putts; runs on any node."""
    began = time.process_time()
    outcome = maps.simulate_putts(course, args.tee, args.directions, args.speeds, direction_range=among).outcome
    seconds = np.array(time.process_time() - began)
    return {
        "result": outcome.result.astype(np.uint8),
        "position": outcome.position.astype(np.float32),
        "seconds": seconds,
    }


def save(path: Path, arrays: Arrays) -> None:
    """Write arrays so that the file is never half there."""
    with atomic_write(path) as part:
        np.savez_compressed(part, **arrays)


def describe(args: Args, course: Course) -> dict[str, Any]:
    """Return all that decides what becomes of a folder's putts, as JSON has it: numbers, and hashes of many numbers."""
    meshes = [part.mesh for part in course.parts]
    shape = hashlib.sha256(b"".join(mesh.triangles.tobytes() for mesh in meshes))
    surfaces = hashlib.sha256(repr([(mesh.surface, mesh.two_sided) for mesh in meshes]).encode())
    about: dict[str, Any] = {"course": course.name, "shape": shape.hexdigest(), "surfaces": surfaces.hexdigest()}
    about |= {"tee": [*(args.tee or course.tee.centre), course.tee.height], "cup": course.cup and asdict(course.cup)}
    about |= {name: getattr(course, name) for name in ("bounds", "top_speed", "ball_radius", "gravity")}
    about |= {name: getattr(args, name) for name in ("directions", "speeds", "shard")}
    return dict(json.loads(json.dumps(about | {"version": __version__})))


def claim(args: Args, course: Course, folder: Path) -> None:
    """Make the folder, or see that what is in it is of the same putts.

    Raises:
        SystemExit: it is not.
        OSError: it cannot be made.
    """
    mine, note = describe(args, course), folder / "putts.json"
    if note.is_file():
        theirs = json.loads(note.read_text())
        other = [key for key in mine if theirs.get(key) != mine[key]]
        if other:
            raise SystemExit(f"out: {folder} holds putts with another {', '.join(other)}; choose another folder.")
    else:
        write_text(note, json.dumps(mine, indent=2))


def play_all(course: Course, args: Args, folder: Path) -> None:
    """Play the ranges that have no file yet, as many at a time as the cluster has cores and as many again."""
    todo = [among for among in shards(args) if not file_of(folder, among).is_file()]
    if not todo:
        return
    ray = connect(args.address, args.num_cpus)
    # A task whose worker or node dies is played again, elsewhere if need be.
    remote, hole = ray.remote(play).options(num_cpus=1, max_retries=-1), ray.put(course)
    pending: dict[Any, range] = {}
    there = args.speeds * (args.directions - sum(map(len, todo)))
    try:
        with tqdm(total=args.speeds * args.directions, initial=there, unit=" putts", unit_scale=True) as bar:
            while todo or pending:
                while todo and len(pending) < 2 * ray.cluster_resources()["CPU"]:
                    among = todo.pop(0)
                    pending[remote.remote(hole, args, among)] = among
                done = ray.wait(list(pending))[0][0]
                arrays = ray.get(done)
                save(file_of(folder, pending.pop(done)), arrays)
                bar.update(arrays["result"].size)
    except KeyboardInterrupt:
        raise SystemExit(f"Interrupted; what is played is in {folder}. The same command goes on.") from None
    finally:
        ray.shutdown()


def merge(args: Args, course: Course, folder: Path) -> Arrays:
    """Return how many putts had each result, how many balls came to rest in each cell, and the cores' seconds."""
    corner, far = (np.array(point[:2]) for point in course.bounds)
    cells = np.ceil((far - corner) / args.cell).astype(np.int64)
    counts, heat, seconds = np.zeros(len(Result), np.int64), np.zeros(cells.prod(), np.int64), np.zeros(())
    for among in shards(args):
        with np.load(file_of(folder, among)) as file:
            result, position = file["result"], file["position"]
            seconds += file["seconds"]
        counts += np.bincount(result.ravel(), minlength=len(Result))
        rest = position[result == Result.REST][:, :2]
        column, row = np.clip(((rest - corner) / args.cell).astype(np.int64), 0, cells - 1).T
        heat += np.bincount(column * cells[1] + row, minlength=heat.size)
    x, y = (corner[k] + args.cell * np.arange(cells[k] + 1) for k in range(2))
    return {"counts": counts, "heat": heat.reshape(cells), "x": x, "y": y, "seconds": seconds}


def draw(course: Course, merged: Arrays, path: Path) -> None:
    """Draw how many balls came to rest where, on the course."""
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    axes = figure.subplots()
    maps.draw_course(axes, course)
    heat = np.ma.masked_equal(merged["heat"].T, 0)
    image = axes.pcolormesh(merged["x"], merged["y"], heat, cmap="inferno", norm=LogNorm(), rasterized=True)
    figure.colorbar(image, ax=axes, label="balls at rest in a cell")
    putts, holed = merged["counts"].sum(), merged["counts"][Result.HOLED]
    axes.set_title(f"{course.name}: {putts:,} putts, {holed / putts:.2%} of them holes in one")
    with atomic_write(path) as part:
        figure.savefig(part, dpi=120)


def main(args: Args) -> Arrays:
    """Play what is not there yet, merge, draw, and say what came of it."""
    if min(args.directions, args.speeds, args.shard) < 1 or args.cell <= 0.0:
        raise SystemExit("expected at least 1 direction, 1 speed and 1 putt a shard, and cells larger than 0.")
    try:
        course = load_course(args.course)
        # Report invalid arguments here, not on another node.
        maps.simulate_putts(course, args.tee, directions=1, speeds=1)
    except ValueError as error:
        raise SystemExit(str(error)) from None
    folder = args.out or Path("runs") / f"{course.name}-map"
    try:
        claim(args, course, folder)
    except OSError as error:
        raise SystemExit(f"out: expected a folder to write to, received {error}") from None
    play_all(course, args, folder)
    merged = merge(args, course, folder)
    save(folder / "map.npz", merged)
    draw(course, merged, folder / "map.png")
    ends = ", ".join(f"{Result(k).name.lower()} {count:,}" for k, count in enumerate(merged["counts"]))
    putts, seconds = merged["counts"].sum(), merged["seconds"]
    Console().print(f"{putts:,} putts: {ends}. It took {seconds:,.0f} s of a core, {putts / seconds:,.0f} putts/s.")
    Console().print(f"Map: {folder / 'map.png'}")
    return merged


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
