"""Decorators that compile the physics, and a notice for a user who waits for the compiler.

``kernel`` is for functions that Python calls, ``device_function`` for those that only compiled code calls, and
``inlined_kernel`` for large functions with one caller. All compile to IEEE arithmetic without ``fastmath`` (the same
bits everywhere), release the GIL, and divide as numpy does (a sliver may divide by zero). Compiled code is cached on
disk. With NUMBA_DISABLE_JIT=1 Python runs the functions.
"""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, TypeVar, cast

import numba
import numpy as np

try:
    from minigolf_env.physics.numba_internals import compile_device_function, compile_kernel
except (
    ImportError,
    AttributeError,
    ValueError,
):  # A name is missing, an attribute is missing, or an option is refused: this numba's internals differ.
    # Fall back silently to its public API: same bits, slower, and nothing that a user has to act on.

    def compile_kernel(function: Callable[..., Any], **options: Any) -> Any:
        """Compile a function with numba's public options and its own cache."""
        return numba.njit(function, cache=True, **options)

    compile_device_function = compile_kernel

Function = TypeVar("Function", bound=Callable[..., Any])

NOTICE_DELAY = 1.5
"""Seconds of compilation before the user is notified."""

_used: set[str] = set()
"""The functions of the public API that were compiled or loaded in this process."""

_NO_NOTICE = nullcontext()
"""Context of a call whose kernels are ready: a generator would take 1 us, a fiftieth of a putt."""


def device_function(function: Function) -> Function:
    """Compile a function of numbers, arrays and NamedTuples that only compiled code can call."""
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    return cast(Function, compile_device_function(function, nogil=True, error_model="numpy"))


def kernel(function: Function) -> Function:
    """Compile a function of numbers, arrays and NamedTuples for Python, and for other kernels, to call."""
    return _compile(function)


def inlined_kernel(function: Function) -> Function:
    """Compile a kernel whose source is inlined into its only compiled caller; Python can call it, too."""
    return _compile(function, inline="always")


def _compile(function: Function, **options: Any) -> Function:
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return np.errstate(all="ignore")(function)  # Python would warn of the kernels' divisions by zero.
    return cast(Function, compile_kernel(function, nogil=True, error_model="numpy", **options))


def notify_if_compiling(api_call: str) -> AbstractContextManager[None]:
    """Print a notice if the first ``api_call`` of a process takes longer than NOTICE_DELAY: kernels are being compiled.

    Args:
        api_call: name of the function of the public API that is being called.
    """
    return _NO_NOTICE if api_call in _used else _notify_after_delay(api_call)


@contextmanager
def _notify_after_delay(api_call: str) -> Iterator[None]:
    """Print a notice unless the block ends within NOTICE_DELAY; without an error it counts as used."""
    timer = threading.Timer(NOTICE_DELAY, _print_notice)
    timer.daemon = True
    timer.start()
    try:
        yield
        _used.add(api_call)
    finally:
        timer.cancel()


@functools.cache
def _print_notice() -> None:
    """Print the notice to stderr, once per process."""
    print("minigolf_env: compiling the physics, once after each installation (about 15 s) ...", file=sys.stderr)
