"""Maps of a hole: where putts in every direction and at every speed end, and which hole out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from minigolf_env._atomic_io import atomic_write
from minigolf_env._validation import one_of
from minigolf_env.courses import Course, load_course
from minigolf_env.envs.config import build_task, check_position
from minigolf_env.envs.task import Outcome, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DIRECTIONS, SPEEDS = 720, 140
"""Every half degree, and 140 shares of the top speed: 100,800 putts."""

CHUNK = 3600
"""Putts between two looks of the progress bar."""

INK = {
    "felt": "#a9cf9a",
    "wood": "#b98d5a",
    "stone": "#a8a49c",
    "wall": "#d8d2c6",
    "cup": "#ffffff",
    "brick": "#a55b45",
    "paint": "#cfcac0",
    "water": "#7fb3d0",
}
"""What materials are drawn in."""


class Putts(NamedTuple):
    """What became of putts in every direction (D) and at every speed (S)."""

    start: NDArray[np.float64]
    """(3,) the ball's centre, m."""
    directions: NDArray[np.float64]
    """(D,) degrees, counter-clockwise from x."""
    speeds: NDArray[np.float64]
    """(S,) m/s."""
    outcome: Outcome
    """Fields of shape (D, S, ...)."""


def simulate(
    course: str | Path | Course,
    tee: Sequence[float] | None = None,
    directions: int = DIRECTIONS,
    speeds: int = SPEEDS,
    progress: bool = False,
    among: range | None = None,
) -> Putts:
    """Return what becomes of putts in every direction, at every speed.

    Args:
        course: a name, a course file or a Course, with a cup.
        tee: x, y of the ball, m, on the tee's level; None: the middle of the tee.
        directions: how many.
        speeds: how many, up to the course's top speed.
        progress: whether a bar shows how far it is.
        among: which of the directions are played, by number; None: all. A map is the same bits, whole or in parts.

    Raises:
        ValueError: no such course, the ball cannot lie there, or directions or speeds below 1.
    """
    if directions < 1 or speeds < 1:
        raise ValueError(f"map: expected directions and speeds >= 1, received {(directions, speeds)}.")
    golf = load_course(course)
    task = build_task(golf)
    x, y = golf.tee.centre if tee is None else tee
    start = check_position(task, (x, y, golf.tee.height + golf.ball_radius))
    degrees: NDArray[np.float64] = np.array(range(directions) if among is None else among) * (360.0 / directions)
    shares: NDArray[np.float64] = np.arange(1.0, speeds + 1.0) / speeds
    turn, share = (grid.ravel() for grid in np.meshgrid(np.radians(degrees), shares, indexing="ij"))
    velocities = task.launch_velocity(np.c_[share * np.cos(turn), share * np.sin(turn)])
    done = []
    with tqdm(total=len(velocities), unit=" putts", disable=None if progress else True) as bar:
        for first in range(0, len(velocities), CHUNK):
            some = velocities[first : first + CHUNK]
            done.append(task.simulate(np.tile(start, (len(some), 1)), some))
            bar.update(len(some))
    whole = (
        np.concatenate(field).reshape(len(degrees), speeds, *field[0].shape[1:]) for field in zip(*done, strict=True)
    )
    return Putts(start, degrees, shares * task.top_speed, Outcome(*whole))


def draw_course(axes: Axes, course: Course) -> None:
    """Draw a course from above."""
    from matplotlib.collections import PolyCollection

    outlines, heights, inks = [], [], []
    for part in course.parts:
        corners = part.mesh.triangles
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        up = normal[:, 2] > 0.05 * np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
        outlines.append(corners[up][:, :, :2])
        heights.append(corners[up][:, :, 2].max(axis=1))
        inks += [part.color or INK[part.material]] * int(up.sum())
    order = np.argsort(np.concatenate(heights), kind="stable")
    triangles = PolyCollection(
        list(np.concatenate(outlines)[order]), facecolors=[inks[k] for k in order], edgecolors="face", linewidths=0.2
    )
    triangles.set_rasterized(True)
    axes.add_collection(triangles)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def draw_map(axes: Axes, course: Course, putts: Putts) -> None:
    """Draw a course from above, and where putts end on it."""
    draw_course(axes, course)
    rest = putts.outcome.result == Result.REST
    ends = putts.outcome.position[rest]
    axes.plot(*ends[:, :2].T, ",", color="#1b3f8b", alpha=0.35, rasterized=True)
    axes.plot(*putts.start[:2], "o", color="white", markeredgecolor="black", markersize=6)
    if course.cup is not None:
        axes.plot(*course.cup.position[:2], "o", color="#c22121", markersize=5)
    holed = float(putts.outcome.holed.mean())
    axes.set_title(f"{course.name}: {putts.outcome.result.size:,} putts, {holed:.2%} of them holes in one")


def draw_polar(axes: Axes, putts: Putts) -> None:
    """Draw what becomes of putts over direction and speed: holed red, out of bounds blue, others by where they end."""
    result, ends = putts.outcome.result, putts.outcome.position
    away = np.hypot(ends[..., 0] - putts.start[0], ends[..., 1] - putts.start[1])
    picture = np.repeat((0.95 - 0.6 * away / max(float(away.max()), 1e-9))[..., None], 3, axis=-1)
    picture[result == Result.OUT_OF_BOUNDS] = 0.55, 0.72, 0.85
    picture[result == Result.HOLED] = 0.85, 0.10, 0.10
    box = (0.0, float(putts.speeds[-1]), 0.0, 360.0)
    axes.imshow(picture, origin="lower", extent=box, aspect="auto", interpolation="nearest")
    axes.set_xlabel("speed (m/s)")
    axes.set_ylabel("direction (degrees)")
    axes.set_title("red: holed, blue: out of bounds,\ngrey: the darker the farther", fontsize=9)


def write_map(
    output: Path,
    course: str | Path | Course,
    tee: Sequence[float] | None = None,
    directions: int = DIRECTIONS,
    speeds: int = SPEEDS,
    progress: bool = False,
) -> Putts:
    """Simulate, draw and write the picture, and its folder; return the putts. Arguments and errors as ``simulate``.

    Raises:
        ValueError: matplotlib writes no such pictures; nothing was simulated then.
        OSError: the file cannot be written; nothing was simulated then.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 5.0), layout="constrained")
    one_of(output.suffix[1:].lower(), tuple(figure.canvas.get_supported_filetypes()), "output: the file's ending")
    with atomic_write(output) as part:
        putts = simulate(course, tee, directions, speeds, progress)
        left, right = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
        draw_map(left, load_course(course), putts)
        draw_polar(right, putts)
        figure.savefig(part, dpi=90)
    return putts
