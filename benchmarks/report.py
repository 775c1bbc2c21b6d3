"""Tables in Markdown, and results in files."""

from __future__ import annotations

import dataclasses
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from minigolf_env.evaluation.report import write_json_report

Records = dict[str, dict[str, Any]]
"""What a table holds: its rows by name, their cells by the column's name."""


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table, its columns aligned, and an empty line."""
    widths = [max(map(len, column)) for column in zip(header, *rows)]
    for row in (header, ["-" * width for width in widths], *rows):
        print("| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths)) + " |")
    print()


def short(number: float) -> str:
    """Return a positive number to three digits: 1.23M, 45.6k, 789, 0.0123."""
    for size, letter in ((1e6, "M"), (1e3, "k")):
        if number >= size:
            digits = max(0, 3 - len(str(int(number / size))))
            return f"{number / size:.{digits}f}{letter}"
    return f"{number:.3g}"


def as_records(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Records:
    """Return a table's rows by name; the first column has the names."""
    return {row[0]: dict(zip(header[1:], row[1:])) for row in rows}


def store(path: Path, args: Any, packages: Sequence[str], **results: Any) -> None:
    """Write results to a JSON file with the script's arguments, the versions and the machine.

    Args:
        path: of the file; its folder is made.
        args: the dataclass of the command line; its paths are left out.
        packages: those besides this one that were measured.
        results: what was found.
    """
    settings = {name: value for name, value in dataclasses.asdict(args).items() if not isinstance(value, Path)}
    write_json_report(path, *packages, settings=settings, machine=machine(), **results)


def machine() -> dict[str, str | int | None]:
    """Return what the results were measured on."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def _processor() -> str:
    """Return the processor's name; Linux tells it in a file, other systems as a rule by ``platform``."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")
