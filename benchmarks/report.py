"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence


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
