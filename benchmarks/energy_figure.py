"""The figure of the energy that exactness.py measures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.scenes import FloatArray

BOUND = 1e-9
"""What the conservative mode promises: the relative error of the energy."""
COLOURS = ("#0072b2", "#009e73", "#d55e00", "#cc79a7", "#e69f00")
"""Told apart by the colour-blind (M. Okabe and K. Ito, "Color Universal Design", 2008)."""
FLOOR = 1e-16
"""Smaller errors, exact zeros among them, are drawn here: half the last bit of a double."""
START = 1.0
"""Where the lines start, s: before, most balls have not met anything."""
SHARES = (0.1, 0.5, 0.9)
"""Of the throws: the lower edge of the band, the line, the upper edge."""


def draw(errors: dict[str, FloatArray], seconds: float, path: Path) -> None:
    """Draw the size of the relative error of the energy against time, and write it to a file.

    Args:
        errors: (samples, throws) by the engine's name, NaN for balls that have left the room.
        seconds: the time of the last sample, s.
        path: .png or .svg; its folder is made.

    Raises:
        ImportError: matplotlib is not installed.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(8.0, 5.0), dpi=120, layout="constrained")
    axes.axhline(BOUND, color="0.35", lw=1.0, ls=(0, (5, 4)))
    axes.text(seconds, 1.6 * BOUND, "bound of the conservative mode", ha="right", va="bottom", color="0.35")
    for (name, error), colour in zip(errors.items(), COLOURS):
        times = np.linspace(0.0, seconds, len(error))
        low, middle, high = spread(np.maximum(np.abs(error), FLOOR)[times >= START])
        times = times[times >= START]
        axes.fill_between(times, low, high, color=colour, alpha=0.18, lw=0)
        axes.plot(times, middle, color=colour, lw=2.0, label=name)
    axes.set_yscale("log")
    axes.set(xlim=(0.0, seconds), ylim=(FLOOR / 3, None), xlabel="time, s", ylabel="relative error of the energy")
    axes.grid(axis="y", color="0.92")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    throws = next(iter(errors.values())).shape[1]
    axes.set_title(
        f"{throws} throws at 3 m/s in a room with a sphere and a torus, restitution 1, no friction", loc="left"
    )
    figure.legend(loc="outside lower center", ncols=3, frameon=False, title="median of the throws; band: 8 of 10")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    plt.close(figure)


def spread(sizes: FloatArray) -> FloatArray:
    """Return SHARES (3, samples) of the balls that are still there, NaN where none is."""
    there = [row[~np.isnan(row)] for row in sizes]
    return np.array([np.quantile(row, SHARES) if len(row) else np.full(3, np.nan) for row in there]).T
