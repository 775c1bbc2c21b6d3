"""Simulate putts in every direction and at every speed on all cores of a Ray cluster, and map where they end.

Directions of 20000 and speeds of 5000 are 10^8 putts, on this machine alone or with ``--address auto`` on the cluster
that it is a node of. After an interruption the same command resumes. The folder contains

- ``putts-FIRST-LAST.npz`` for each range of directions: "result" (D, S),
  numbers of ``minigolf_env.envs.task.Result``, "position" (D, S, 3), where the
  ball ended, m, float32, and "seconds", the CPU time of the simulation;
- ``map.npz``: the number of putts with each result ("counts"), and the number
  of balls that came to rest in each cell of the course ("heat", with the cell
  edges "x" and "y", m); ``map.png``: an image of it;
- ``putts.json``: everything that the putts depend on.
"""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from rich.console import Console
from tqdm import tqdm

from agents.cluster import connect, import_ray
from agents.command_line import run_program
from agents.config_check import check_ranges, one_line_errors
from minigolf_env import __version__
from minigolf_env._atomic_io import atomic_write, check_output_folder, write_text
from minigolf_env.apps import putt_map as maps
from minigolf_env.courses import Course, load_course
from minigolf_env.envs.task import Result

Arrays = dict[str, Any]


@dataclass(frozen=True)
class PuttMapConfig:
    """Command-line arguments of this program."""

    course: str = "dogleg"
    tee: tuple[float, float] | None = None
    """Position of the ball, x, y, m; by default the middle of the tee."""
    directions: int = 2_000
    """Number of directions."""
    speeds: int = 500
    """Number of speeds, up to the course's top speed."""
    shard_size: int = 100_000
    """Approximate number of putts in a file. An interruption loses at most one unfinished file on each core."""
    cell_size: float = 0.01
    """Side of a cell of the heat map, m."""
    out: Path | None = None
    """Folder of the files; by default runs/COURSE-map. Putts of files that exist are not simulated again."""
    address: str | None = None
    """Ray cluster: "auto" on one of its nodes, or HOST:PORT; by default Ray starts on this machine alone."""
    num_cpus: int | None = None
    """Number of cores for a Ray started here; by default all."""


MAX_CELLS = 100_000_000
"""Largest number of cells of the heat map, 800 MB."""


def shard_ranges(config: PuttMapConfig) -> list[range]:
    """Return the range of directions in each shard."""
    num_rows = max(1, config.shard_size // config.speeds)
    starts = range(0, config.directions, num_rows)
    return [range(start, min(start + num_rows, config.directions)) for start in starts]


def shard_path(folder: Path, direction_range: range) -> Path:
    """Return the file of a shard."""
    return folder / f"putts-{direction_range.start:07d}-{direction_range.stop:07d}.npz"


def simulate_shard(course: Course, config: PuttMapConfig, direction_range: range) -> Arrays:
    """Return results and end positions of a shard's putts; runs on any node."""
    started = time.process_time()
    outcome = maps.simulate_putts(
        course, config.tee, config.directions, config.speeds, direction_range=direction_range
    ).outcome
    seconds = np.array(time.process_time() - started)
    return {
        "result": outcome.result.astype(np.uint8),
        "position": outcome.position.astype(np.float32),
        "seconds": seconds,
    }


def save_arrays(path: Path, arrays: Arrays) -> None:
    """Write arrays to a file atomically."""
    with atomic_write(path) as temporary_file:
        np.savez_compressed(temporary_file, **arrays)


def describe_inputs(config: PuttMapConfig, course: Course) -> dict[str, Any]:
    """Return everything that the putts depend on, as JSON values; large arrays as their hashes."""
    meshes = [part.mesh for part in course.parts]
    shape = hashlib.sha256(b"".join(mesh.triangles.tobytes() for mesh in meshes))
    surfaces = hashlib.sha256(repr([(mesh.surface, mesh.two_sided) for mesh in meshes]).encode())
    inputs: dict[str, Any] = {"course": course.name, "shape": shape.hexdigest(), "surfaces": surfaces.hexdigest()}
    inputs |= {"tee": [*(config.tee or course.tee.centre), course.tee.height]}
    inputs |= {"cup": course.cup and asdict(course.cup)}
    inputs |= {name: getattr(course, name) for name in ("bounds", "top_speed", "ball_radius", "gravity")}
    inputs |= {name: getattr(config, name) for name in ("directions", "speeds", "shard_size")}
    return dict(json.loads(json.dumps(inputs | {"version": __version__})))


def create_or_check_folder(config: PuttMapConfig, course: Course, folder: Path) -> None:
    """Create the folder with putts.json, or check that an existing folder has the same putts.

    Raises:
        SystemExit: the folder has files of other putts.
        OSError: the folder cannot be created.
    """
    inputs = describe_inputs(config, course)
    path = folder / "putts.json"
    if not path.exists():
        write_text(path, json.dumps(inputs, indent=2))
        return
    with one_line_errors(f"out: expected the arguments of a putt map in {path}"):
        stored = json.loads(path.read_text())
        different = [key for key in inputs if stored.get(key) != inputs[key]]
    if different:
        raise SystemExit(f"out: {folder} holds putts with another {', '.join(different)}; choose another folder.")


def missing_shards(config: PuttMapConfig, folder: Path) -> list[range]:
    """Return the shards that have no file yet."""
    return [shard for shard in shard_ranges(config) if not shard_path(folder, shard).is_file()]


def simulate_missing_shards(course: Course, config: PuttMapConfig, folder: Path) -> None:
    """Simulate the shards that have no file yet; Ray queues twice as many as the cluster has cores."""
    missing = missing_shards(config, folder)
    if not missing:
        return
    ray = connect(config.address, config.num_cpus)
    # Ray runs a task again, on another node if need be, when its worker or node dies.
    remote_simulate = ray.remote(simulate_shard).options(num_cpus=1, max_retries=-1)
    remote_course = ray.put(course)
    pending: dict[Any, range] = {}
    num_putts = config.speeds * config.directions
    num_done = num_putts - config.speeds * sum(map(len, missing))
    try:
        with tqdm(total=num_putts, initial=num_done, unit=" putts", unit_scale=True) as bar:
            while missing or pending:
                while missing and len(pending) < 2 * ray.cluster_resources()["CPU"]:
                    shard = missing.pop(0)
                    pending[remote_simulate.remote(remote_course, config, shard)] = shard
                finished = ray.wait(list(pending))[0][0]
                arrays = ray.get(finished)
                save_arrays(shard_path(folder, pending.pop(finished)), arrays)
                bar.update(arrays["result"].size)
    except KeyboardInterrupt:
        raise SystemExit(f"Interrupted; the finished putts are in {folder}. The same command resumes.") from None
    finally:
        ray.shutdown()


def merge_shards(config: PuttMapConfig, course: Course, folder: Path) -> Arrays:
    """Return the number of putts with each result, the heat map with its cell edges, and the CPU time."""
    lower, upper = (np.array(point[:2]) for point in course.bounds)
    num_cells = np.ceil((upper - lower) / config.cell_size).astype(np.int64)
    counts = np.zeros(len(Result), np.int64)
    heat = np.zeros(num_cells.prod(), np.int64)
    seconds = np.zeros(())
    for shard in shard_ranges(config):
        path = shard_path(folder, shard)
        with (
            one_line_errors(f"out: expected the putts of a map in {path}"),
            path.open("rb") as content,
            np.load(content) as file,
        ):
            result = file["result"]
            position = file["position"]
            seconds += file["seconds"]
        counts += np.bincount(result.ravel(), minlength=len(Result))
        rest = position[result == Result.REST][:, :2]
        column, row = np.clip(((rest - lower) / config.cell_size).astype(np.int64), 0, num_cells - 1).T
        heat += np.bincount(column * num_cells[1] + row, minlength=heat.size)
    x, y = (lower[k] + config.cell_size * np.arange(num_cells[k] + 1) for k in range(2))
    return {"counts": counts, "heat": heat.reshape(num_cells), "x": x, "y": y, "seconds": seconds}


def draw_heat_map(course: Course, merged: Arrays, path: Path) -> None:
    """Draw the number of balls at rest in each cell over the course."""
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    axes = figure.subplots()
    maps.draw_course(axes, course)
    heat = np.ma.masked_equal(merged["heat"].T, 0)
    image = axes.pcolormesh(merged["x"], merged["y"], heat, cmap="inferno", norm=LogNorm(), rasterized=True)
    figure.colorbar(image, ax=axes, label="balls at rest in a cell")
    num_putts = merged["counts"].sum()
    num_holed = merged["counts"][Result.HOLED]
    axes.set_title(f"{course.name}: {num_putts:,} putts, {num_holed / num_putts:.2%} of them holes in one")
    with atomic_write(path) as temporary_file:
        figure.savefig(temporary_file, dpi=120)


def main(config: PuttMapConfig) -> Arrays:
    """Simulate the missing putts, merge all, draw the map, and print a summary.

    Raises:
        SystemExit: an argument is invalid, or the program was interrupted; the message is one line.
    """
    # Check the arguments and the course here rather than on another node.
    try:
        check_ranges(config)
        course = load_course(config.course)
        maps.simulate_putts(course, config.tee, directions=1, speeds=1)
        num_cells = float(np.prod(np.ptp(course.bounds, axis=0)[:2] / config.cell_size))
        if num_cells > MAX_CELLS:
            raise ValueError(f"cell_size: expected at most {MAX_CELLS:,} cells, received {num_cells:,.0f}.")
    except (OSError, ValueError) as error:
        raise SystemExit(str(error)) from None
    folder = config.out or Path("runs") / f"{course.name}-map"
    try:
        check_output_folder(folder, "out")
        if missing_shards(config, folder):
            import_ray(config.address)  # Fails here where Ray is missing, before a folder is created.
        create_or_check_folder(config, course, folder)
    except OSError as error:
        raise SystemExit(str(error)) from None

    simulate_missing_shards(course, config, folder)
    merged = merge_shards(config, course, folder)
    save_arrays(folder / "map.npz", merged)
    draw_heat_map(course, merged, folder / "map.png")

    counts = ", ".join(f"{Result(k).name.lower()} {count:,}" for k, count in enumerate(merged["counts"]))
    num_putts = merged["counts"].sum()
    seconds = merged["seconds"]
    Console().print(f"{num_putts:,} putts: {counts}. CPU time {seconds:,.0f} s, {num_putts / seconds:,.0f} putts/s.")
    Console().print(f"Map: {folder / 'map.png'}")
    return merged


if __name__ == "__main__":
    run_program(main, PuttMapConfig, __doc__)
