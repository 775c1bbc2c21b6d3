"""Prints Markdown tables and stores results in JSON files."""

from __future__ import annotations

import dataclasses
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from minigolf_env._atomic_io import check_output
from minigolf_env.evaluation.report import write_json_report

TableRecords = dict[str, dict[str, Any]]
"""The cells of a table by row name and column name."""


def check_files(args: Any) -> None:
    """End the program with one line if a file of its arguments, a dataclass, cannot be written."""
    for name, value in vars(args).items():
        if isinstance(value, Path):
            try:
                check_output(value, name)
            except OSError as error:
                raise SystemExit(str(error)) from None


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a Markdown table with aligned columns, and an empty line."""
    widths = [max(map(len, column)) for column in zip(header, *rows)]
    for row in (header, ["-" * width for width in widths], *rows):
        print("| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths)) + " |")
    print()


def format_rate(number: float) -> str:
    """Return a positive number with three digits: 1.23M, 45.6k, 789, 0.0123."""
    for unit, letter in ((1e6, "M"), (1e3, "k")):
        if number >= unit:
            digits = max(0, 3 - len(str(int(number / unit))))
            return f"{number / unit:.{digits}f}{letter}"
    return f"{number:.3g}"


def table_records(header: Sequence[str], rows: Sequence[Sequence[str]]) -> TableRecords:
    """Return the cells of a table whose first column holds the row names."""
    return {row[0]: dict(zip(header[1:], row[1:])) for row in rows}


def store_results(path: Path, args: Any, packages: Sequence[str], **results: Any) -> None:
    """Write results to a JSON file, with the script's arguments, the versions and the machine.

    Args:
        path: the file; its folder is created.
        args: arguments of the command line, a dataclass; paths are left out.
        packages: the other measured packages.
        results: values by key.
    """
    settings = {name: value for name, value in dataclasses.asdict(args).items() if not isinstance(value, Path)}
    write_json_report(path, *packages, settings=settings, machine=machine_info(), **results)


def machine_info() -> dict[str, str | int | None]:
    """Return the processor, the number of cores and the operating system."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def _processor() -> str:
    """Return the processor's name, on Linux from /proc/cpuinfo, elsewhere from ``platform``."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")
