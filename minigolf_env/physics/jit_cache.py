"""Where compiled kernels are kept: on disk, in files whose names change with any source of the physics.

numba's own cache does not notice a change in a callee from another file, though its machine code is part of the
caller's. It also keeps an index of numbered files, which two processes that fill it at once can mix up.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import sys
import uuid
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, InTreeCacheLocator, NullCache
from numba.core.serialize import dumps, loads

DIGEST = 32
"""Bytes of a SHA-256 digest: a file starts with that of the rest, so that a damaged one is not run."""

PACKAGES = {"site-packages", "dist-packages"}
"""Names of folders that packages are installed to."""


class _Installed(CompileResultCacheImpl):
    """Keeps nothing beside the sources of an installed package: pip removes no more than it brought."""

    _locator_classes = [*CompileResultCacheImpl._locator_classes]  # noqa: RUF012 (numba types it so)
    _locator_classes.remove(InTreeCacheLocator)


class KernelCache(NullCache):
    """The compiled code of one function, as numba's dispatchers load and save it.

    Every signature has a file of its own, named after all that the code depends on. Whoever writes it writes the same,
    so writers need no order. The folder is NUMBA_CACHE_DIR, else ``__pycache__`` beside the sources of a checkout, else
    numba's in the user's cache. Without a folder, or with a full disk, kernels work and a warning says so once.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        # As they are imported: when the function is compiled, an editor may have changed them.
        self._sources = sources(Path(inspect.getfile(function)).parent)

    @functools.cached_property
    def _numba(self) -> Any:
        """What numba knows of keeping a function: where, and how compiled code becomes bytes.

        Raises:
            OSError: there is no folder that can be written to.
        """
        try:
            installed = not PACKAGES.isdisjoint(Path(inspect.getfile(self._function)).parts)
            return (_Installed if installed else CompileResultCacheImpl)(self._function)  # type: ignore[no-untyped-call]
        except RuntimeError as error:
            raise OSError(str(error)) from error

    @property
    def _folder(self) -> Path:
        return Path(self._numba.locator.get_cache_path())

    @property
    def cache_path(self) -> str | None:
        """The folder; None if there is none that can be written to."""
        try:
            return str(self._folder)
        except OSError:
            return None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for a signature; None if there is none, or it is damaged."""
        target_context.refresh()
        try:
            content = self._path(sig, target_context.codegen()).read_bytes()
        except OSError:
            return None
        digest, code = content[:DIGEST], content[DIGEST:]
        if hashlib.sha256(code).digest() != digest:
            return None
        return self._numba.rebuild(target_context, loads(code))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature, and remove what is left of other versions of the sources."""
        try:
            if self._numba.check_cachable(data):
                code: bytes = dumps(self._numba.reduce(data))  # type: ignore[no-untyped-call]
                _write(self._path(sig, data.codegen), hashlib.sha256(code).digest() + code)
                for file in self._folder.glob("kernel-*"):
                    if not file.name.startswith(f"kernel-{self._sources}-"):
                        file.unlink(missing_ok=True)
        except OSError:
            _warn()

    def flush(self) -> None:
        """Forget the function's code for all signatures."""
        with contextlib.suppress(OSError):
            for file in self._folder.glob(f"kernel-*-{self._function.__name__}-*"):
                file.unlink(missing_ok=True)

    def _path(self, sig: Any, codegen: Any) -> Path:
        """Return the file for a signature; numba names machine code with the same words for types."""
        f = self._function
        where = (f.__module__, f.__qualname__, f.__code__.co_firstlineno)
        how = (numba.__version__, sys.implementation.cache_tag, codegen.magic_tuple())
        stamp = self._numba.locator.get_source_stamp()  # An application frozen into one file has no sources but this.
        key = hashlib.sha256(repr((where, how, stamp, sig)).encode()).hexdigest()[:16]
        return self._folder / f"kernel-{self._sources}-{f.__name__}-{key}.nbc"


@functools.cache
def sources(folder: Path) -> str:
    """Return a digest of the sources in a folder: of their contents, since tools may leave time and size alone."""
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.py")):
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]


def _write(path: Path, content: bytes) -> None:
    """Write a file all at once: whoever reads finds it whole or not at all."""
    part = path.with_name(f"{path.name}.{uuid.uuid4().hex}")
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise


@functools.cache
def _warn() -> None:
    warnings.warn(
        "minigolf_env: there is no folder to keep the compiled physics in, so that every process compiles it again "
        "(about 15 s); set NUMBA_CACHE_DIR to a folder that can be written to, on a disk with 10 MB to spare.",
        RuntimeWarning,
        stacklevel=2,
    )
