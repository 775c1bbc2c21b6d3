"""Files appear whole: they are written beside their place and moved there at the end, over what was there before."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

DIGITS = 8
"""Random hexadecimal digits in the name of a file that is being written, behind its own: .checkpoint-0a1b2c3d.zip."""


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Yield a new, empty file to write to; it becomes ``path`` when the block ends.

    An exception in the block, Ctrl-C included, leaves no trace: what was at ``path`` stays.

    Args:
        path: the file; its folder is made.

    Raises:
        OSError: it cannot be written; the block was not entered then.
    """
    place = check_output(path)
    part = create_temp_sibling(place)
    try:
        yield part
        commit(part, place)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, whole or not at all; its folder is made.

    Raises:
        OSError: it cannot be written.
    """
    with atomic_write(path) as part:
        part.write_text(text, encoding="utf-8")


def check_output(path: str | Path) -> Path:
    """Return where a file can be written, absolute, or raise an OSError that names the remedy."""
    path = Path(path).expanduser().resolve()
    if path.exists() and not path.is_file():
        raise OSError(f"{path}: expected a file to replace or a new name, there is something else of that name.")
    folder = next(folder for folder in path.parents if folder.exists())
    if not folder.is_dir():
        raise NotADirectoryError(f"{path}: {folder} is not a folder; choose another folder.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{path}: no permission to write in {folder}; choose another folder.")
    return path


def create_temp_sibling(path: Path) -> Path:
    """Return a new empty file in the same folder, which is made, and with the same ending: a rename is one step."""
    part = path.with_name(f".{path.stem[:40]}-{uuid.uuid4().hex[:DIGITS]}{path.suffix}")
    try:
        part.parent.mkdir(parents=True, exist_ok=True)
        part.touch(exist_ok=False)
    except OSError as error:
        raise OSError(f"{path}: cannot be written: {error}; choose another folder.") from error
    return part


def remove_stale_temps(folder: Path) -> None:
    """Remove what was being written in a folder when a process was killed. No other may be writing there."""
    for part in folder.glob(f".*-{'[0-9a-f]' * DIGITS}*"):
        part.unlink(missing_ok=True)


def commit(part: Path, path: Path) -> None:
    """Put a file, or a new folder of files, into its place once it is wholly on the disk."""
    for file in part.rglob("*") if part.is_dir() else [part]:
        if file.is_file():
            with file.open("rb") as content:
                os.fsync(content.fileno())
    part.replace(path)
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Make a rename last through a power cut, where a folder can be opened (not on Windows)."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
