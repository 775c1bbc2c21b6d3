"""Atomic file writes: a file is written under a temporary name in its folder, and renamed when it is complete.

A reader finds the old file or the new one, never a part; a program that is interrupted leaves the old one.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NUM_SUFFIX_DIGITS = 8
"""Number of random hexadecimal digits in the name of a temporary file: .checkpoint-0a1b2c3d.zip for checkpoint.zip."""


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Yield a new, empty temporary file to write to; it becomes ``path`` when the block ends.

    After an exception in the block, Ctrl-C included, the temporary file is removed and a file at ``path`` is unchanged.

    Args:
        path: the file; its folder is created.

    Raises:
        OSError: the file cannot be written. It is raised before the block is entered if the folder is not writable, and
            after the block if flushing or renaming fails.
    """
    target = check_output(path)
    temporary = create_temp_sibling(target)
    try:
        yield temporary
        commit(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file atomically; its folder is created.

    Raises:
        OSError: the file cannot be written.
    """
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check_output(path: str | Path) -> Path:
    """Return the absolute path at which a file can be written, or raise an OSError that says what to do."""
    try:
        path = Path(path).expanduser().resolve()
    except (RuntimeError, ValueError) as error:  # A loop of symbolic links, an unknown home folder, a zero byte.
        raise OSError(f"{str(path)!r}: expected the path of a file to write, {error}; choose another.") from error
    if path.exists() and not path.is_file():
        raise OSError(f"{path}: expected a file to replace or a new name, there is something else of that name.")
    folder = next(folder for folder in path.parents if folder.exists())
    if not folder.is_dir():
        raise NotADirectoryError(f"{path}: {folder} is not a folder; choose another folder.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{path}: no permission to write in {folder}; choose another folder.")
    return path


def create_temp_sibling(path: Path) -> Path:
    """Create an empty temporary file next to ``path`` and return it; it has the same suffix, and its folder is created.

    In the same folder it can be renamed to ``path`` in one step.
    """
    temporary = path.with_name(f".{path.stem[:40]}-{uuid.uuid4().hex[:NUM_SUFFIX_DIGITS]}{path.suffix}")
    try:
        temporary.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise OSError(f"{path}: cannot be written: {error}; choose another folder.") from error
    return temporary


def remove_stale_temps(folder: Path) -> None:
    """Remove the temporary files that killed processes left in a folder; no other process may be writing there.

    Folders of such names are left.
    """
    for temporary in folder.glob(f".*-{'[0-9a-f]' * NUM_SUFFIX_DIGITS}*"):
        if not temporary.is_dir():
            temporary.unlink(missing_ok=True)


def commit(temporary: Path, path: Path) -> None:
    """Flush a temporary file, or a new folder of files, to disk and rename it to ``path``."""
    for file in temporary.rglob("*") if temporary.is_dir() else [temporary]:
        if file.is_file():
            with file.open("rb") as content:
                os.fsync(content.fileno())
    temporary.replace(path)
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Flush a folder to disk, so that a rename survives a power cut; not on Windows, where folders cannot be opened."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
