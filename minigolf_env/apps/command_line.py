"""Parts of every program's command line: help that fits the terminal, and errors that name the option."""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import TextIO, TypeVar

Parsed = TypeVar("Parsed")

HELP_OPTIONS = frozenset({"-h", "--help"})
"""Options that print the help."""

ANSI_STYLE = re.compile(r"\x1b\[[\d;]*m")
"""Codes of colours and styles, which have no width."""

LINE_START = re.compile(r" *(- |\$ |usage: )?")
"""Start of a line: its indent, and the mark of a line that is continued with a deeper indent."""


def parse(
    f: Callable[..., Parsed], args: Sequence[str], *, prog: str | None = None, description: str | None = None
) -> Parsed:
    """Return what a function or a dataclass returns for the arguments of a command line, as ``tyro.cli`` does.

    Args:
        f: the function or dataclass; its parameters are the options.
        args: the arguments.
        prog: name of the program in the help; None: the file that was started.
        description: the help's text; None: the docstring of ``f``.

    Raises:
        SystemExit: the help was printed, or the arguments are not those of ``f``.
    """
    import tyro

    with _folded_output() if HELP_OPTIONS.intersection(args) else contextlib.nullcontext():
        return tyro.cli(f, prog=prog, description=description, args=args)


def name_option(message: str, options: Collection[str], renamed: Mapping[str, str] | None = None) -> str:
    """Return an error message that begins with the option which a user typed, where it begins with an argument.

    Args:
        message: the message, such as "seed: expected an integer, received 0.5".
        options: arguments that are options, such as "first_seed".
        renamed: options by the names of the arguments that they are passed on as, such as "first_seed" by "seed".
    """
    match = re.match(r"(\w+)(?=:| of | \()", message)
    name = match.group() if match else ""
    option = name
    while option not in options:
        if renamed is None or option not in renamed:
            return message
        option = renamed[option]
    return f"--{option.replace('_', '-')}{message[len(name) :]}"


class _HelpBuffer(io.TextIOWrapper):
    """Text that takes the place of a terminal; it has the same colours and characters."""

    def __init__(self, terminal: TextIO) -> None:
        super().__init__(io.BytesIO(), encoding=terminal.encoding, errors=terminal.errors, newline="\n")
        self._terminal = terminal

    def isatty(self) -> bool:
        return self._terminal.isatty()


@contextlib.contextmanager
def _folded_output() -> Iterator[None]:
    """Fold what is printed in the block to the width of the terminal: tyro folds the options of a help alone."""
    terminal = sys.stdout
    buffer = _HelpBuffer(terminal)
    try:
        with contextlib.redirect_stdout(buffer):
            yield
    finally:
        buffer.seek(0)
        terminal.write(_fold(buffer.read(), shutil.get_terminal_size().columns))


def _fold(text: str, width: int) -> str:
    """Return a text with its lines folded between words."""
    lines: list[str] = []
    for line in text.splitlines():
        if len(ANSI_STYLE.sub("", line)) <= width:
            lines.append(line)
            continue
        start = LINE_START.match(line)
        indent = " " * len(start.group() if start else "")
        lines += textwrap.wrap(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return "".join(f"{line}\n" for line in lines)
