"""OpenGL without a window: one EGL context a process, made when first needed.

This module is imported before any other of OpenGL's, because PyOpenGL chooses its platform when it is imported.
"""

from __future__ import annotations

import ctypes
import functools
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Any, Protocol

from minigolf_env.rendering.errors import RenderingError

DEVICE_VARIABLE = "MINIGOLF_EGL_DEVICE"
"""Environment variable: the number of the EGL device to draw on; unset, the first that works."""

PLATFORM_DEVICE, PLATFORM_SURFACELESS = 0x313F, 0x31DD
"""EGL_PLATFORM_DEVICE_EXT and EGL_PLATFORM_SURFACELESS_MESA, from the extensions EGL_EXT_platform_device and
EGL_MESA_platform_surfaceless."""

INSTALL = "On Debian or Ubuntu: apt-get install libegl1 libgl1 (libgl1 brings the drivers that draw without a GPU)."


if sys.platform == "linux":
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")


class Context(Protocol):
    """An OpenGL context to draw in."""

    def current(self) -> AbstractContextManager[None]:
        """Make it current within a ``with`` block."""
        ...


class HeadlessContext:
    """An OpenGL 3.3 core context with no surface, to draw into framebuffer objects.

    Use it as ``with context.current():``; whatever context was current in the thread before is so again afterwards, and
    threads take turns.

    Raises:
        RenderingError: there is no EGL here, or none of its displays can draw.
    """

    def __init__(self) -> None:
        self._egl = _load_egl()
        self._process = os.getpid()
        self._lock = threading.RLock()
        self._display, self._context = self._create()

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the context current within a ``with`` block.

        Raises:
            RenderingError: in a process that was forked from the one that made the context.
        """
        check_process(self._process)
        egl = self._egl
        with self._lock:
            before = (
                egl.eglGetCurrentDisplay() or self._display,
                egl.eglGetCurrentSurface(egl.EGL_DRAW),
                egl.eglGetCurrentSurface(egl.EGL_READ),
                egl.eglGetCurrentContext(),
            )
            with _glx_released():
                egl.eglMakeCurrent(self._display, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, self._context)
                try:
                    yield
                finally:
                    egl.eglMakeCurrent(*before)

    def _create(self) -> tuple[Any, Any]:
        """Return the first display that can draw, and a context on it."""
        tried = []
        for name, find in self._displays():
            try:
                display = find()
                return display, self._context_on(display)
            except Exception as error:
                tried.append(f"{name}: {_reason(error)}")
        raise RenderingError(f"rendering: no EGL display can draw. Tried {'; '.join(tried) or 'none'}. {INSTALL}")

    def _displays(self) -> Iterator[tuple[str, Callable[[], Any]]]:
        """Yield what finds the displays to try: hardware first, then Mesa's without a surface, then the default one."""
        egl = self._egl
        extensions = (egl.eglQueryString(egl.EGL_NO_DISPLAY, egl.EGL_EXTENSIONS) or b"").decode()
        if "EGL_EXT_platform_device" in extensions and "EGL_EXT_device_enumeration" in extensions:
            devices = _devices(egl)
            chosen = os.environ.get(DEVICE_VARIABLE)
            if chosen is not None:
                if not chosen.isdigit() or int(chosen) >= len(devices):
                    raise RenderingError(
                        f"{DEVICE_VARIABLE}: expected a number below {len(devices)}, received {chosen!r}; unset it to "
                        "take the first device that works."
                    )
                yield f"device {chosen}", partial(_platform_display, PLATFORM_DEVICE, devices[int(chosen)])
                return
            for k, device in enumerate(devices):
                yield f"device {k}", partial(_platform_display, PLATFORM_DEVICE, device)
        if "EGL_MESA_platform_surfaceless" in extensions:
            yield "surfaceless", partial(_platform_display, PLATFORM_SURFACELESS, egl.EGL_DEFAULT_DISPLAY)
        yield "default", partial(egl.eglGetDisplay, egl.EGL_DEFAULT_DISPLAY)

    def _context_on(self, display: Any) -> Any:
        egl = self._egl
        major, minor = egl.EGLint(), egl.EGLint()
        egl.eglInitialize(display, major, minor)
        egl.eglBindAPI(egl.EGL_OPENGL_API)
        wanted = [egl.EGL_SURFACE_TYPE, 0, egl.EGL_RENDERABLE_TYPE, egl.EGL_OPENGL_BIT, egl.EGL_NONE]
        config, count = (egl.EGLConfig * 1)(), egl.EGLint()
        egl.eglChooseConfig(display, (egl.EGLint * len(wanted))(*wanted), config, 1, count)
        if count.value == 0:
            raise RenderingError("it has no configuration for OpenGL")
        version = [egl.EGL_CONTEXT_MAJOR_VERSION, 3, egl.EGL_CONTEXT_MINOR_VERSION, 3]
        profile = [egl.EGL_CONTEXT_OPENGL_PROFILE_MASK, egl.EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, egl.EGL_NONE]
        attributes = (egl.EGLint * 7)(*version, *profile)
        context = egl.eglCreateContext(display, config[0], egl.EGL_NO_CONTEXT, attributes)
        if not context:
            raise RenderingError("it has no OpenGL 3.3 core context")
        return context


def check_process(process: int) -> None:
    """Raise a RenderingError unless this is the process (an id) that made a context: in its forks OpenGL hangs."""
    if os.getpid() != process:
        raise RenderingError(
            "rendering: expected the process that first rendered, received a fork of it, where OpenGL would hang; "
            "start workers with the 'spawn' or 'forkserver' method, or render in the parent only after forking."
        )


def _load_egl() -> Any:
    """Return PyOpenGL's EGL module."""
    try:
        from OpenGL import EGL, platform
    except Exception as error:  # PyOpenGL raises ImportError, AttributeError or TypeError where the library is missing.
        raise RenderingError(f"rendering: libEGL cannot be used: {_reason(error)}. {INSTALL}") from error
    chosen = type(platform.PLATFORM).__name__
    if "EGL" not in chosen:
        raise RenderingError(
            f"rendering: expected PyOpenGL on EGL, received {chosen}, because it was imported or set up first; "
            "import minigolf_env.rendering.gl.context before OpenGL, or set PYOPENGL_PLATFORM=egl."
        )
    return EGL


def _devices(egl: Any) -> list[Any]:
    """Return the EGL devices of this machine; none where asking fails."""
    from OpenGL.EGL.EXT.device_enumeration import eglQueryDevicesEXT
    from OpenGL.raw.EGL._types import EGLDeviceEXT

    count = egl.EGLint()
    try:
        eglQueryDevicesEXT(0, None, count)
        devices = (EGLDeviceEXT * count.value)()
        eglQueryDevicesEXT(count.value, devices, count)
    except egl.EGLError:
        return []
    return list(devices)


def _platform_display(platform: int, native: Any) -> Any:
    from OpenGL.EGL.EXT.platform_base import eglGetPlatformDisplayEXT

    return eglGetPlatformDisplayEXT(platform, native, None)


@contextmanager
def _glx_released() -> Iterator[None]:
    """Take away this thread's current GLX context (a window's) for a while: EGL makes none current beside it."""
    glx = _load_glx()
    context = glx.glXGetCurrentContext() if glx is not None else None
    if glx is None or not context:
        yield
        return
    display = glx.glXGetCurrentDisplay()
    surfaces = glx.glXGetCurrentDrawable(), glx.glXGetCurrentReadDrawable()
    glx.glXMakeContextCurrent(display, 0, 0, None)
    try:
        yield
    finally:
        glx.glXMakeContextCurrent(display, *surfaces, context)


@contextmanager
def for_windows() -> Iterator[None]:
    """Let windows have their contexts current within a ``with`` block; an EGL context that was before is so after it.

    GLX makes none current beside EGL's, such as one that another library has left current.
    """
    try:
        egl = _load_egl() if sys.platform == "linux" else None
    except RenderingError:
        egl = None  # Nobody uses it then.
    context = egl.eglGetCurrentContext() if egl is not None else None
    if egl is None or not context:
        yield
        return
    display = egl.eglGetCurrentDisplay()
    surfaces = egl.eglGetCurrentSurface(egl.EGL_DRAW), egl.eglGetCurrentSurface(egl.EGL_READ)
    egl.eglMakeCurrent(display, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, egl.EGL_NO_CONTEXT)
    try:
        yield
    finally:
        glx = _load_glx()
        if glx is not None and glx.glXGetCurrentContext():
            glx.glXMakeContextCurrent(glx.glXGetCurrentDisplay(), 0, 0, None)
        egl.eglMakeCurrent(display, *surfaces, context)


@functools.cache
def _load_glx() -> Any:
    """Return GLX's library, or None where there is none."""
    if sys.platform != "linux":
        return None
    try:
        glx: Any = ctypes.CDLL("libGLX.so.0")
    except OSError:
        return None
    for name in ("glXGetCurrentContext", "glXGetCurrentDisplay"):
        getattr(glx, name).restype = ctypes.c_void_p
    for name in ("glXGetCurrentDrawable", "glXGetCurrentReadDrawable"):
        getattr(glx, name).restype = ctypes.c_ulong
    glx.glXMakeContextCurrent.argtypes = [ctypes.c_void_p, ctypes.c_ulong, ctypes.c_ulong, ctypes.c_void_p]
    return glx


def _reason(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
