"""All uses of numba's private API: options of the compiler, and an on-disk cache that is never stale.

jit.py imports this module. If a numba lacks any of the names used here, the import fails, and jit.py falls back to
plain ``numba.njit(cache=True)``: the same results, slower, with numba's own cache.

numba's own cache does not notice a change in a callee from another file, though the callee's machine code is part of
the caller's. It also keeps an index of numbered files, which two processes that fill it at once can mix up. The cache
here has a file for each compiled signature, whose name changes with any source file that the code may depend on.
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
from numba.core.cpu import CPUTargetOptions
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps, loads

DIGEST_SIZE = 32
"""Number of bytes of a SHA-256 digest: a file starts with the digest of the rest, so that a damaged one is not run."""

PACKAGE_FOLDER = Path(__file__).parents[1]
"""Folder of the package."""

INSTALL_FOLDERS = {"site-packages", "dist-packages"}
"""Names of the folders that packages are installed to."""

PRIVATE_OPTIONS: dict[str, Any] = {
    # Inline every kernel into its callers: passing scenes by value, hundreds of bytes a call, costs more than the work.
    # Without this option numba decides once, for the caller compiled first: the speed would depend on a user's first
    # call.
    "forceinline": True,
    # Compile no C wrapper: it serves only to pass a kernel as an argument to another, which nothing does.
    "no_cfunc_wrapper": True,
    # No reference counts: with numba's memory manager every call would count references to all arrays of the scene,
    # two thirds of the time. The compiler then refuses kernels that allocate memory.
    "_nrt": False,
}
"""Options of ``numba.njit`` that numba does not document."""

for _name in ("no_cpython_wrapper", *PRIVATE_OPTIONS):
    if not hasattr(CPUTargetOptions, _name):
        raise ImportError(f"numba {numba.__version__} has no option {_name}.")
for _name in ("_insert", "_compile_for_args", "enable_caching"):
    if not hasattr(Dispatcher, _name):
        raise ImportError(f"numba {numba.__version__} has no Dispatcher.{_name}.")


def compile_kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function with numba's public and the private options, cached on disk in a KernelCache."""
    compiled: Any = numba.njit(function, **options, **PRIVATE_OPTIONS)
    compiled._cache = KernelCache(function)
    return compiled


def compile_device_function(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function as ``compile_kernel`` does, for kernels alone: a call from Python raises a TypeError.

    It has no Python wrapper, which takes a tenth of the compilation time. Without one, a call would crash the process.
    """
    compiled = compile_kernel(function, no_cpython_wrapper=True, **options)

    def refuse(*_: object, **__: object) -> None:
        raise TypeError(f"{function.__name__} is a device function: decorate it with kernel to call it from Python.")

    compiled._insert = lambda *_: None
    compiled._compile_for_args = refuse
    return compiled


class _UserCacheImpl(CompileResultCacheImpl):
    """Cache of an installed package: keeps nothing next to the sources, as pip removes only files that it installed."""

    _locator_classes = [*CompileResultCacheImpl._locator_classes]  # noqa: RUF012 (numba types it so)
    _locator_classes.remove(InTreeCacheLocator)


class KernelCache(NullCache):
    """The compiled code of one function on disk, as numba's dispatchers load and save it.

    Each signature has a file of its own, named after all that the code depends on. All processes write the same content
    to it, so that concurrent writers need no lock. The folder is NUMBA_CACHE_DIR, else ``__pycache__`` next to the
    sources of a checkout, else numba's folder in the user's cache. Without a folder, or with a full disk,
    kernels work, and one warning is issued.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        # Read at import: an editor may have changed the sources when the function is compiled.
        self._sources = source_digest(Path(inspect.getfile(function)).parent)

    @functools.cached_property
    def _impl(self) -> Any:
        """Numba's implementation: where the cache is, and how compiled code is serialised.

        Raises:
            OSError: there is no folder that can be written to.
        """
        try:
            is_installed = not INSTALL_FOLDERS.isdisjoint(Path(inspect.getfile(self._function)).parts)
            return (_UserCacheImpl if is_installed else CompileResultCacheImpl)(self._function)  # type: ignore[no-untyped-call]
        except RuntimeError as error:
            raise OSError(str(error)) from error

    @property
    def _folder(self) -> Path:
        return Path(self._impl.locator.get_cache_path())

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
        digest, code = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
        if hashlib.sha256(code).digest() != digest:
            return None
        return self._impl.rebuild(target_context, loads(code))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the code for a signature, and remove the files of other versions of the sources."""
        try:
            if self._impl.check_cachable(data):
                code: bytes = dumps(self._impl.reduce(data))  # type: ignore[no-untyped-call]
                _write_atomically(self._path(sig, data.codegen), hashlib.sha256(code).digest() + code)
                for file in self._folder.glob("kernel-*"):
                    if not file.name.startswith(f"kernel-{self._sources}-"):
                        file.unlink(missing_ok=True)
        except OSError:
            _warn_no_cache()

    def flush(self) -> None:
        """Remove the function's code for all signatures."""
        with contextlib.suppress(OSError):
            for file in self._folder.glob(f"kernel-*-{self._function.__name__}-*"):
                file.unlink(missing_ok=True)

    def _path(self, sig: Any, codegen: Any) -> Path:
        """Return the file for a signature; its name has all properties by which numba distinguishes machine code."""
        f = self._function
        place = (f.__module__, f.__qualname__, f.__code__.co_firstlineno)
        compiler = (numba.__version__, sys.implementation.cache_tag, codegen.magic_tuple())
        stamp = (
            self._impl.locator.get_source_stamp()
        )  # Identifies the version in an application frozen into one file, which has no source files.
        key = hashlib.sha256(repr((place, compiler, stamp, sig)).encode()).hexdigest()[:16]
        return self._folder / f"kernel-{self._sources}-{f.__name__}-{key}.nbc"


@functools.cache
def source_digest(folder: Path) -> str:
    """Return a digest of the sources that the kernels of a folder may depend on.

    These are the files of the physics, of the folder, and of the folders above it up to the package's: kernels call
    those of the layers below. Their contents count, as tools may leave their times and sizes unchanged.
    """
    above = [parent for parent in folder.parents if parent.is_relative_to(PACKAGE_FOLDER) and parent != PACKAGE_FOLDER]
    digest = hashlib.sha256()
    for source_folder in sorted({PACKAGE_FOLDER / "physics", folder, *above}):
        for file in sorted(source_folder.glob("*.py")):
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]


def _write_atomically(path: Path, content: bytes) -> None:
    """Write a file to a temporary name and rename it: a reader finds the whole file or none.

    Unlike ``_atomic_io`` it does not flush to disk: for hundreds of cache files that would take longer than it is
    worth, as the digest in a file reveals damage.
    """
    temporary = path.with_name(f"{path.name}.{uuid.uuid4().hex}")
    try:
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


@functools.cache
def _warn_no_cache() -> None:
    warnings.warn(
        "minigolf_env: there is no folder to keep the compiled physics in, so that every process compiles it again "
        "(about 15 s); set NUMBA_CACHE_DIR to a folder that can be written to, on a disk with 10 MB to spare.",
        RuntimeWarning,
        stacklevel=2,
    )
