"""How the physics is compiled: one decorator, and one line for the user when compiling takes a while."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast

import numba
from numba.extending import register_jitable

try:
    from minigolf_env.physics.cache import KernelCache
except ImportError:  # This numba lacks what it is made of, or names it otherwise: its own cache has to do.
    KernelCache = None  # type: ignore[assignment,misc]

Function = TypeVar("Function", bound=Callable[..., Any])

PATIENCE = 1.5
"""Seconds of silence before the user is told that the physics is being compiled."""

_ready = False


def kernel(function: Function) -> Function:
    """Compile a function of floats, arrays and NamedTuples: cached on disk, IEEE arithmetic, without the GIL.

    ``fastmath`` stays off (the same bits everywhere) and division follows numpy (a sliver may divide by zero). Kernels
    allocate nothing, and the compiler holds them to it: with numba's memory manager every call would count references
    to all the scene's arrays, which took two thirds of the time.
    """
    return _compile(function, allocates=False)


def inlined_kernel(function: Function) -> Function:
    """Compile a function as ``kernel`` does and put it into its callers: for work shorter than passing the arguments.

    Half the time of a rolling ball was spent on passing scenes by value, hundreds of bytes a call.
    """
    return _compile(function, allocates=False, forceinline=True)


def allocating_kernel(function: Function) -> Function:
    """Compile a function that makes arrays of its own, and otherwise is as ``kernel``."""
    return _compile(function, allocates=True)


def for_kernels(function: Function) -> Function:
    """Return a function that is plain Python when Python calls it, and a part of the kernels that call it."""
    jitable: Function = register_jitable(function)
    return jitable


def _compile(function: Function, *, allocates: bool, **options: Any) -> Function:
    # Nothing passes kernels to kernels, which is what the wrapper for C would be for.
    options |= {"error_model": "numpy", "fastmath": False, "no_cfunc_wrapper": True, "_nrt": allocates}
    compiled: Any = numba.njit(function, nogil=True, **options)
    if KernelCache is not None and hasattr(compiled, "_cache"):
        compiled._cache = KernelCache(function)
    elif hasattr(compiled, "enable_caching"):
        compiled.enable_caching()
    return cast(Function, compiled)


@contextmanager
def announced_compilation() -> Iterator[None]:
    """Say on stderr that kernels are being compiled if the first use in a process takes longer than ``PATIENCE``."""
    global _ready
    if _ready:
        yield
        return
    message = "minigolf_env: compiling the physics, once after each installation (about 20 s) ...\n"
    timer = threading.Timer(PATIENCE, sys.stderr.write, [message])
    timer.daemon = True
    timer.start()
    try:
        yield
        _ready = True
    finally:
        timer.cancel()
