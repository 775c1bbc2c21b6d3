"""Putt maps of a hole: where putts in every direction and at every speed end, and which of them hole out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from minigolf_env._atomic_io import atomic_write
from minigolf_env._validation import integer, one_of
from minigolf_env.courses import Course, load_course
from minigolf_env.envs.config import build_task, check_position
from minigolf_env.envs.task import Outcome, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

NUM_MAP_DIRECTIONS = 720
"""Default number of directions of a map: one every half degree."""

NUM_MAP_SPEEDS = 140
"""Default number of speeds of a map; with the default directions these are 100,800 putts."""

MAX_MAP_ROWS = 9_999_999
"""Largest number of directions, and of speeds: the names of the files of agents.putt_map have seven digits."""

PUTTS_PER_PROGRESS_UPDATE = 3600
"""Number of putts between two updates of the progress bar."""

DISTANCE_GREYS = ("#f2f2f2", "#595959")
"""Colours of a putt that ends where it started, and of the one that ends farthest away."""

MATERIAL_MAP_COLORS = {
    "felt": "#a9cf9a",
    "wood": "#b98d5a",
    "stone": "#a8a49c",
    "wall": "#d8d2c6",
    "cup": "#ffffff",
    "brick": "#a55b45",
    "paint": "#cfcac0",
    "water": "#7fb3d0",
}
"""Colour of each material on a map."""


class PuttOutcomes(NamedTuple):
    """The outcomes of putts in D directions and at S speeds."""

    start: NDArray[np.float64]
    """Start of the ball's centre, m, shape (3,)."""
    directions: NDArray[np.float64]
    """Directions, degrees counter-clockwise from x, shape (D,)."""
    speeds: NDArray[np.float64]
    """Speeds, m/s, shape (S,)."""
    outcome: Outcome
    """Outcomes; its fields have the shape (D, S, ...)."""


def simulate_putts(
    course: str | Path | Course,
    tee: Sequence[float] | None = None,
    directions: int = NUM_MAP_DIRECTIONS,
    speeds: int = NUM_MAP_SPEEDS,
    progress: bool = False,
    direction_range: range | None = None,
) -> PuttOutcomes:
    """Simulate putts in every direction and at every speed, and return their outcomes.

    Args:
        course: a name, a course file or a Course, with a cup.
        tee: x and y of the ball, m, at the height of the tee; None: the middle of the tee.
        directions: number of directions, at least 1.
        speeds: number of speeds up to the course's top speed, at least 1.
        progress: show a progress bar.
        direction_range: indices of the directions to simulate; None: all. The outcomes have the same bits, whether the
            directions are simulated together or in parts.

    Raises:
        ValueError: there is no such course, the ball cannot be placed there, or directions or speeds are not from 1
            to MAX_MAP_ROWS.
    """
    integer(directions, "directions", 1, MAX_MAP_ROWS)
    integer(speeds, "speeds", 1, MAX_MAP_ROWS)
    # Place the ball.
    loaded = load_course(course)
    task = build_task(loaded)
    x, y = loaded.tee.centre if tee is None else tee
    start = check_position(task, (x, y, loaded.tee.height + loaded.ball_radius))
    # Make the grid of putts.
    indices = np.array(range(directions) if direction_range is None else direction_range)
    degrees: NDArray[np.float64] = indices * (360.0 / directions)
    shares: NDArray[np.float64] = np.arange(1.0, speeds + 1.0) / speeds
    angle, share = (grid.ravel() for grid in np.meshgrid(np.radians(degrees), shares, indexing="ij"))
    actions = np.c_[share * np.cos(angle), share * np.sin(angle)]
    # Simulate the putts in chunks.
    outcomes = []
    with tqdm(total=len(actions), unit=" putts", disable=None if progress else True) as bar:
        for first in range(0, len(actions), PUTTS_PER_PROGRESS_UPDATE):
            chunk = actions[first : first + PUTTS_PER_PROGRESS_UPDATE]
            outcomes.append(task.play(np.tile(start, (len(chunk), 1)), chunk).outcome)
            bar.update(len(chunk))
    fields = (
        np.concatenate(field).reshape(len(degrees), speeds, *field[0].shape[1:])
        for field in zip(*outcomes, strict=True)
    )
    return PuttOutcomes(start, degrees, shares * task.top_speed, Outcome(*fields))


def draw_course(axes: Axes, course: Course) -> None:
    """Draw a course from above."""
    from matplotlib.collections import PolyCollection

    # Collect the triangles that face up.
    triangles = []
    heights = []
    colors = []
    for part in course.parts:
        corners = part.mesh.triangles
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        faces_up = normal[:, 2] > 0.05 * np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
        triangles.append(corners[faces_up][:, :, :2])
        heights.append(corners[faces_up][:, :, 2].max(axis=1))
        colors += [part.color or MATERIAL_MAP_COLORS[part.material]] * int(faces_up.sum())
    # Draw them from the lowest to the highest.
    order = np.argsort(np.concatenate(heights), kind="stable")
    collection = PolyCollection(
        list(np.concatenate(triangles)[order]),
        facecolors=[colors[k] for k in order],
        edgecolors="face",
        linewidths=0.2,
    )
    collection.set_rasterized(True)
    axes.add_collection(collection)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def draw_map(axes: Axes, course: Course, putts: PuttOutcomes) -> None:
    """Draw a course from above, and where putts end on it."""
    draw_course(axes, course)
    at_rest = putts.outcome.result == Result.REST
    ends = putts.outcome.position[at_rest]
    axes.plot(*ends[:, :2].T, ",", color="#1b3f8b", alpha=0.35, rasterized=True)
    axes.plot([], [], ".", color="#1b3f8b", label="where a putt ends")  # The points themselves are a pixel each.
    x, y = putts.start[:2]
    axes.plot(x, y, "o", color="white", markeredgecolor="black", markersize=6, label="ball")
    if course.cup is not None:
        axes.plot(*course.cup.position[:2], "o", color="#c22121", markersize=5, label="cup")
    # Below the label of the x axis, at the same distance for narrow and for wide courses.
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=4.5, ncols=3, frameon=False, fontsize=9)
    holed = float(putts.outcome.holed.mean())
    axes.set_title(f"{course.name}: {putts.outcome.result.size:,} putts, {holed:.2%} of them holes in one")


def draw_polar(axes: Axes, putts: PuttOutcomes) -> ScalarMappable:
    """Draw the outcomes over speed and direction: holed red, out of bounds blue, others by how far away they end.

    Returns:
        The greys of the distances, m, for a colour bar.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    result = putts.outcome.result
    ends = putts.outcome.position
    distance = np.hypot(ends[..., 0] - putts.start[0], ends[..., 1] - putts.start[1])
    colormap = LinearSegmentedColormap.from_list("distances", DISTANCE_GREYS)
    greys = ScalarMappable(Normalize(0.0, max(float(distance.max()), 1e-9)), colormap)
    image = greys.to_rgba(distance)[..., :3]
    image[result == Result.OUT_OF_BOUNDS] = 0.55, 0.72, 0.85
    image[result == Result.HOLED] = 0.85, 0.10, 0.10
    extent = (0.0, float(putts.speeds[-1]), 0.0, 360.0)
    axes.imshow(image, origin="lower", extent=extent, aspect="auto", interpolation="nearest")
    axes.set_xlabel("speed (m/s)")
    axes.set_ylabel("direction (degrees)")
    axes.set_title("red: holed, blue: out of bounds,\ngrey: the darker the farther", fontsize=9)
    return greys


def write_map(
    output: Path,
    course: str | Path | Course,
    tee: Sequence[float] | None = None,
    directions: int = NUM_MAP_DIRECTIONS,
    speeds: int = NUM_MAP_SPEEDS,
    progress: bool = False,
) -> PuttOutcomes:
    """Simulate putts, write the map as an image, and return the outcomes. The folder of the file is made.

    The other arguments and errors are those of ``simulate_putts``.

    Raises:
        ValueError: matplotlib does not write images of this file ending; nothing was simulated then.
        OSError: the file cannot be written; nothing was simulated then.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 5.0), layout="constrained")
    one_of(output.suffix[1:].lower(), tuple(figure.canvas.get_supported_filetypes()), "output: the file's ending")
    with atomic_write(output) as temp_path:
        loaded = load_course(course)
        putts = simulate_putts(loaded, tee, directions, speeds, progress)
        left, right = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
        draw_map(left, loaded, putts)
        greys = draw_polar(right, putts)
        figure.colorbar(greys, ax=right, label="distance from the ball to where the putt ends (m)")
        figure.savefig(temp_path, dpi=90)
    return putts
