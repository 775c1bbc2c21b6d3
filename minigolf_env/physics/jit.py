"""How the physics is compiled: a decorator for each kind of caller, and a line for the user who waits for it."""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast

import numba
import numpy as np

try:
    from minigolf_env.physics.jit_cache import KernelCache
except ImportError:  # This numba lacks what it is made of, or names it otherwise: its own cache has to do.
    KernelCache = None  # type: ignore[assignment,misc]

Function = TypeVar("Function", bound=Callable[..., Any])

SILENCE = 1.5
"""Seconds before the user is told that the physics is being compiled."""

_ready: set[str] = set()
"""The uses of the physics that were compiled or loaded in this process."""


def kernel(function: Function) -> Function:
    """Compile a function of floats, arrays and NamedTuples that other kernels call; Python cannot.

    Cached on disk, IEEE arithmetic, without the GIL. ``fastmath`` stays off (the same bits everywhere) and division
    follows numpy (a sliver may divide by zero). Kernels allocate nothing, and the compiler holds them to it: with
    numba's memory manager every call would count references to all the scene's arrays, two thirds of the time.
    """
    compiled: Any = _compile(function, no_cpython_wrapper=True)

    def refuse(*_: object, **__: object) -> None:
        raise TypeError(f"{function.__name__} is a kernel for kernels: decorate it with entry_kernel to call it here.")

    # Without a wrapper, which takes a tenth of the time to compile, a call from Python would crash the process.
    compiled._insert = lambda *_: None
    compiled._compile_for_args = refuse
    return cast(Function, compiled)


def entry_kernel(function: Function) -> Function:
    """Compile a function as ``kernel`` does, for Python to call."""
    return _callable(function)


def merged_kernel(function: Function) -> Function:
    """Merge a function into the source of its only caller, so that it is compiled once; Python may call it, too."""
    return _callable(function, inline="always")


def _callable(function: Function, **options: Any) -> Function:
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return np.errstate(all="ignore")(function)  # Kernels divide by zero, too, where Python would warn of it.
    return _compile(function, **options)


def _compile(function: Function, **options: Any) -> Function:
    # Every kernel is put into its callers: passing scenes by value, hundreds of bytes a call, costs more than the work.
    # Without a word numba does as it did for the caller it compiles first: speed would hang on what a user asks first.
    options["forceinline"] = True
    # Nothing passes kernels to kernels, which is what the wrapper for C would be for.
    options |= {"error_model": "numpy", "fastmath": False, "no_cfunc_wrapper": True, "_nrt": False}
    compiled: Any = numba.njit(function, nogil=True, **options)
    if KernelCache is not None and hasattr(compiled, "_cache"):
        compiled._cache = KernelCache(function)
    elif hasattr(compiled, "enable_caching"):
        compiled.enable_caching()
    return cast(Function, compiled)


@contextmanager
def announced_compilation(use: str) -> Iterator[None]:
    """Say on stderr that kernels are being compiled if the first ``use`` in a process takes longer than ``SILENCE``."""
    if use in _ready:
        yield
        return
    timer = threading.Timer(SILENCE, _say)
    timer.daemon = True
    timer.start()
    try:
        yield
        _ready.add(use)
    finally:
        timer.cancel()


@functools.cache
def _say() -> None:
    """Tell the user, once a process."""
    print("minigolf_env: compiling the physics, once after each installation (about 15 s) ...", file=sys.stderr)
