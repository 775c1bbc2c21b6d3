"""Draws the energy error that exactness.py measures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.scenes import FloatArray
from minigolf_env._atomic_io import atomic_write

ENERGY_ERROR_BOUND = 1e-9
"""Bound of the relative energy error that the conservative mode guarantees."""
LINE_COLORS = ("#0072b2", "#009e73", "#d55e00", "#cc79a7", "#e69f00")
"""Colours that colour-blind readers can distinguish (M. Okabe and K. Ito, "Color Universal Design", 2008)."""
MIN_DRAWN_ERROR = 1e-16
"""Smallest error that is drawn, for smaller errors and zeros too: half the last bit of a double."""
FIRST_DRAWN_TIME = 1.0
"""Time at which the lines start, s; before it most balls have not hit anything."""
BAND_QUANTILES = (0.1, 0.5, 0.9)
"""Quantiles of the throws: lower edge of the band, line, upper edge."""


def draw_energy_error(errors: dict[str, FloatArray], seconds: float, path: Path) -> None:
    """Draw the absolute relative energy error against time and write the figure to a file.

    Args:
        errors: arrays (samples, throws) by the engine's name, NaN for balls that have left the room.
        seconds: time of the last sample, s.
        path: a .png or .svg file; its folder is created.

    Raises:
        ImportError: matplotlib is not installed.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(8.0, 5.0), dpi=120, layout="constrained")
    axes.axhline(ENERGY_ERROR_BOUND, color="0.35", lw=1.0, ls=(0, (5, 4)))
    axes.text(
        seconds, 1.6 * ENERGY_ERROR_BOUND, "bound of the conservative mode", ha="right", va="bottom", color="0.35"
    )
    for (name, error), color in zip(errors.items(), LINE_COLORS):
        times = np.linspace(0.0, seconds, len(error))
        low, middle, high = quantile_band(np.maximum(np.abs(error), MIN_DRAWN_ERROR)[times >= FIRST_DRAWN_TIME])
        times = times[times >= FIRST_DRAWN_TIME]
        axes.fill_between(times, low, high, color=color, alpha=0.18, lw=0)
        axes.plot(times, middle, color=color, lw=2.0, label=name)
    axes.set_yscale("log")
    axes.set(
        xlim=(0.0, seconds), ylim=(MIN_DRAWN_ERROR / 3, None), xlabel="time, s", ylabel="relative error of the energy"
    )
    axes.grid(axis="y", color="0.92")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    throws = next(iter(errors.values())).shape[1]
    axes.set_title(
        f"{throws} throws at 3 m/s in a room with a sphere and a torus, restitution 1, no friction", loc="left"
    )
    figure.legend(loc="outside lower center", ncols=3, frameon=False, title="median of the throws; band: 8 of 10")
    with atomic_write(path) as temporary_file:
        figure.savefig(temporary_file)
    plt.close(figure)


def quantile_band(errors: FloatArray) -> FloatArray:
    """Return BAND_QUANTILES (3, samples) of the balls that are still in the room, NaN where there is none."""
    inside = [row[~np.isnan(row)] for row in errors]
    return np.array([np.quantile(row, BAND_QUANTILES) if len(row) else np.full(3, np.nan) for row in inside]).T
