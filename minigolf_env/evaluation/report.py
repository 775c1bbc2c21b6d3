"""Reports of evaluations: tables in the terminal and JSON files."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from minigolf_env import __version__
from minigolf_env._atomic_io import write_text
from minigolf_env.courses.procedural import GENERATOR_VERSION
from minigolf_env.evaluation.benchmark import LevelSetResult
from minigolf_env.evaluation.evaluate import EvaluationResult
from minigolf_env.evaluation.statistics import Interval

INTERVAL_ROUNDOFF = 1e-9
"""Rounding error of the end of an interval, in units of its last digit, which must not move it to the next number."""

MIN_NAME_WIDTH = 10
"""Width of the names of policies with which a table fits into 80 columns; longer names are folded."""

NUMBERS_WIDTH = 80 - MIN_NAME_WIDTH
"""Width of the other columns of the table of evaluations."""


def write_json_report(path: Path, *libraries: str, **report: Any) -> None:
    """Write a report to a JSON file, with the versions of the libraries that made it.

    The file is written atomically and its folder is made. Ends of an interval that are infinite (those of a single
    episode) are null, as JSON has no infinity.

    Args:
        path: the file.
        libraries: libraries whose versions are written in addition to gymnasium, numpy and numba.
        report: the content.
    """
    versions = {name: metadata.version(name) for name in ("gymnasium", "numpy", "numba", *libraries)}
    versions |= {"minigolf_env": __version__, "levels": str(GENERATOR_VERSION), "python": platform.python_version()}
    text = json.dumps(_finite({**report, "versions": versions}), indent=2, allow_nan=False)
    write_text(path, text + "\n")


def _finite(value: Any) -> Any:
    """Return a copy of nested containers with None in place of numbers that are not finite."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_evaluations(results: Sequence[EvaluationResult]) -> None:
    """Print evaluations on the same course as one table, a row for each policy."""
    first = results[0]
    noise = "noise of {:g} degrees and {:.1%}, ".format(*first.putt_noise) if any(first.putt_noise) else ""
    course = first.course if first.difficulty is None else f"{first.course}, {first.difficulty}"
    table = _new_table(f"{course}: {noise}fixed seeds, [95 % confidence intervals]")
    name_width = max(MIN_NAME_WIDTH, Console().width - NUMBERS_WIDTH)
    table.add_column("policy", overflow="fold", max_width=name_width)
    for column in ("episodes", "mean strokes", "holed out", "hole-in-one"):
        table.add_column(column, justify="right")
    for result in results:
        table.add_row(
            result.policy,
            str(result.episodes),
            format_with_interval(result.strokes, result.strokes_interval),
            format_percentage(result.holed, result.holed_interval),
            format_percentage(result.hole_in_one, result.hole_in_one_interval),
        )
    print_table(table)


def print_benchmark(policy: str, results: Sequence[LevelSetResult]) -> None:
    """Print the benchmark of a policy as one table, a row for each set of levels."""
    count = results[0].num_levels
    table = _new_table(f"{policy} on {count} levels (v{GENERATOR_VERSION}) a row, [95 % confidence intervals]")
    for column in ("levels", "mean strokes", "relative to search", "holed out"):
        table.add_column(column, justify="left" if column == "levels" else "right")
    for result in results:
        table.add_row(
            f"{result.difficulty}, {result.level_set}",
            format_with_interval(result.strokes, result.strokes_interval),
            format_with_interval(result.relative, result.relative_interval),
            format_percentage(result.holed, result.holed_interval),
        )
    print_table(table)


class _Console(Console):
    """A console that raises BrokenPipeError when the reader closes the pipe, where rich's own exits with code 1."""

    def on_broken_pipe(self) -> None:
        """Raise the error again."""
        raise


def print_table(table: Table) -> None:
    """Print a table."""
    _Console().print(table)


def format_with_interval(value: float, interval: Interval) -> str:
    """Return a number and its interval, rounded outwards, as text: 2.50 [2.31, 2.70]."""
    low, high = _round_outwards(interval, 100.0)
    return f"{value:.2f} [{low / 100.0:.2f}, {high / 100.0:.2f}]"


def format_percentage(fraction: float, interval: Interval) -> str:
    """Return a fraction and its interval, rounded outwards, as text in percent: 91.0% [86, 95]."""
    low, high = _round_outwards(interval, 100.0)
    return f"{fraction:.1%} [{low:.0f}, {high:.0f}]"


def _round_outwards(interval: Interval, scale: float) -> Interval:
    """Return the smallest interval between whole numbers that contains ``scale`` times an interval."""
    low, high = (scale * end for end in interval)
    return float(np.floor(low + INTERVAL_ROUNDOFF)), float(np.ceil(high - INTERVAL_ROUNDOFF))


def _new_table(title: str) -> Table:
    """Return a table without lines between its columns: its rows fit into 80 columns."""
    return Table(title=title, box=box.SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
