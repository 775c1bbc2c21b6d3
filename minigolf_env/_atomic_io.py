"""Atomic file writes: a file is written under a temporary name in its folder, and renamed when it is complete.

A reader finds the old file or the new one, never a part; a program that is interrupted leaves the old one.
"""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
import uuid
from collections.abc import Iterator
from pathlib import Path

from minigolf_env._validation import quote

NUM_SUFFIX_DIGITS = 8
"""Number of random hexadecimal digits in the name of a temporary file: .checkpoint-0a1b2c3d.zip for checkpoint.zip."""

DISK_FULL_ERRNOS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Numbers of the errors of a full disk, of a user's quota on it, and of a limit on the size of a file."""

DISK_FULL_HINT = "free space on the disk, or choose another folder."
"""Remedy for a full disk, the end of error messages."""


@contextlib.contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Yield a new, empty temporary file to write to; it becomes ``path`` when the block ends.

    After an exception in the block, Ctrl-C included, the temporary file is removed and a file at ``path`` is unchanged.

    Args:
        path: the file; its folder is created.

    Raises:
        OSError: the file cannot be written. It is raised before the block is entered if the folder is not writable, and
            after the block if flushing or renaming fails. If the block raises it because the disk is full, its message
            says so.
    """
    target = check_output(path)
    temporary = create_temp_sibling(target)
    try:
        yield temporary
        commit(temporary, target)
    except OSError as error:
        if error.errno not in DISK_FULL_ERRNOS:
            raise
        raise OSError(f"{target}: cannot be written: {_reason(error)}; {DISK_FULL_HINT}") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file atomically; its folder is created.

    Raises:
        OSError: the file cannot be written.
    """
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check_output(path: str | Path, what: str = "output") -> Path:
    """Return the absolute path at which a file can be written, or raise an OSError that says what to do.

    Args:
        path: the file; neither it nor its folder need to exist.
        what: name of the argument in error messages.
    """
    path = _resolve(path, what)
    if path.exists() and not path.is_file():
        raise OSError(
            f"{what}: expected a file to replace or a new name, {path} is something else of that name; choose another."
        )
    _check_writable(path.parent, path, what)
    return path


def check_output_folder(path: str | Path, what: str = "output") -> Path:
    """Return the absolute path of a folder in which files can be written, or raise an OSError that says what to do.

    Args:
        path: the folder; it need not exist.
        what: name of the argument in error messages.
    """
    path = _resolve(path, what)
    _check_writable(path, path, what)
    return path


def _resolve(path: str | Path, what: str) -> Path:
    """Return a path as absolute path without links, or raise an OSError."""
    try:
        resolved = Path(path).expanduser().resolve()
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            resolved.stat()
    except (OSError, RuntimeError, ValueError) as error:  # A loop of links, an unknown user, a zero byte, a long name.
        raise OSError(
            f"{what}: expected a path, received {quote(str(path))}: {_reason(error)}; choose another."
        ) from error
    return resolved


def _check_writable(folder: Path, path: Path, what: str) -> None:
    """Raise an OSError unless files can be written in a folder, or in a new folder of this path.

    Args:
        folder: the folder.
        path: the file or folder of the error message.
        what: name of the argument in error messages.
    """
    existing = next(parent for parent in (folder, *folder.parents) if parent.exists())
    if not existing.is_dir():
        raise NotADirectoryError(f"{what}: cannot write {path}: {existing} is not a folder; choose another folder.")
    try:
        # Permissions alone do not tell: the administrator has all, and no one can write to a read-only disk.
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise OSError(
            f"{what}: cannot write {path}: no file can be made in {existing}: {_reason(error)}; choose another folder."
        ) from error


def _reason(error: Exception) -> str:
    """Return the reason of an error in the system's words, without number and path."""
    return (isinstance(error, OSError) and error.strerror) or str(error)


def create_temp_sibling(path: Path) -> Path:
    """Create an empty temporary file next to ``path`` and return it; it has the same suffix, and its folder is created.

    In the same folder it can be renamed to ``path`` in one step.
    """
    temporary = path.with_name(f".{path.stem[:40]}-{uuid.uuid4().hex[:NUM_SUFFIX_DIGITS]}{path.suffix}")
    try:
        temporary.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise OSError(f"{path}: cannot be written: {_reason(error)}; choose another folder.") from error
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
