"""OpenGL contexts without a window, through EGL, and their coexistence with the contexts of windows (GLX).

This module is imported before any module of PyOpenGL, which chooses its platform when it is imported.
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

from minigolf_env._validation import quote
from minigolf_env.rendering.errors import ContextLostError, RenderingError

DEVICE_VARIABLE = "MINIGOLF_EGL_DEVICE"
"""Environment variable with the number of the EGL device to draw on; unset: the first device that works."""

PLATFORM_DEVICE = 0x313F
"""Enumerant EGL_PLATFORM_DEVICE_EXT of the extension EGL_EXT_platform_device."""

PLATFORM_SURFACELESS = 0x31DD
"""Enumerant EGL_PLATFORM_SURFACELESS_MESA of the extension EGL_MESA_platform_surfaceless."""

INSTALL_HINT = (
    "On Debian or Ubuntu: apt-get install libegl1 libgl1 (libgl1 brings the drivers that draw without a GPU)."
)
"""Remedy for missing libraries, the end of error messages."""

PLATFORM_VARIABLE = "PYOPENGL_PLATFORM"
"""Environment variable by which PyOpenGL chooses its platform."""

if sys.platform == "linux" and not os.environ.get(PLATFORM_VARIABLE):
    os.environ[PLATFORM_VARIABLE] = "egl"


class Context(Protocol):
    """An OpenGL context to draw in."""

    def current(self) -> AbstractContextManager[None]:
        """Make the context current within a ``with`` block."""
        ...


class EGLContext:
    """An OpenGL 3.3 core context without a surface, to draw into framebuffer objects.

    Use it as ``with context.current():``. Afterwards the context that was current in the thread before is current
    again. A lock lets one thread draw at a time.

    Raises:
        RenderingError: EGL is not available, or none of its displays can draw.
    """

    def __init__(self) -> None:
        self._egl = _load_egl()
        self._process_id = os.getpid()
        self._lock = threading.RLock()
        self._display, self._context = self._create()

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the context current within a ``with`` block.

        Raises:
            RenderingError: this process was forked from the one that made the context.
            ContextLostError: another library has ended the context or its display.
        """
        check_process(self._process_id)
        egl = self._egl
        with self._lock:
            previous = (
                egl.eglGetCurrentDisplay() or self._display,
                egl.eglGetCurrentSurface(egl.EGL_DRAW),
                egl.eglGetCurrentSurface(egl.EGL_READ),
                egl.eglGetCurrentContext(),
            )
            with _glx_released():
                try:
                    egl.eglMakeCurrent(self._display, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, self._context)
                except egl.EGLError as error:
                    raise ContextLostError(
                        f"rendering: the OpenGL context has ended: {_describe(error)}; another library, such as "
                        "pygame, may have ended the display. Render in a process of its own."
                    ) from error
                try:
                    yield
                finally:
                    try:
                        egl.eglMakeCurrent(*previous)
                    except egl.EGLError:  # Its owner has ended the context that was current before: leave none.
                        egl.eglMakeCurrent(self._display, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, egl.EGL_NO_CONTEXT)

    def _create(self) -> tuple[Any, Any]:
        """Return the first display that can draw, and a context on it."""
        failures = []
        for name, open_display in self._displays():
            try:
                display = open_display()
                return display, self._create_context(display)
            except Exception as error:
                failures.append(f"{name}: {_describe(error)}")
        tried = "; ".join(failures) or "none"
        raise RenderingError(f"rendering: no EGL display can draw. Tried {tried}. {INSTALL_HINT}")

    def _displays(self) -> Iterator[tuple[str, Callable[[], Any]]]:
        """Yield name and factory of each display to try: devices first, then Mesa's surfaceless, then the default."""
        egl = self._egl
        extensions = (egl.eglQueryString(egl.EGL_NO_DISPLAY, egl.EGL_EXTENSIONS) or b"").decode()
        if "EGL_EXT_platform_device" in extensions and "EGL_EXT_device_enumeration" in extensions:
            devices = _devices(egl)
            chosen = os.environ.get(DEVICE_VARIABLE)
            if chosen is not None:
                if chosen not in map(str, range(len(devices))):
                    raise RenderingError(
                        f"{DEVICE_VARIABLE}: expected a number below {len(devices)}, received {quote(chosen)}; "
                        "unset it to take the first device that works."
                    )
                yield f"device {chosen}", partial(_platform_display, PLATFORM_DEVICE, devices[int(chosen)])
                return
            for k, device in enumerate(devices):
                yield f"device {k}", partial(_platform_display, PLATFORM_DEVICE, device)
        if "EGL_MESA_platform_surfaceless" in extensions:
            yield "surfaceless", partial(_platform_display, PLATFORM_SURFACELESS, egl.EGL_DEFAULT_DISPLAY)
        yield "default", partial(egl.eglGetDisplay, egl.EGL_DEFAULT_DISPLAY)

    def _create_context(self, display: Any) -> Any:
        """Return an OpenGL 3.3 core context on a display."""
        egl = self._egl
        major, minor = egl.EGLint(), egl.EGLint()
        egl.eglInitialize(display, major, minor)
        egl.eglBindAPI(egl.EGL_OPENGL_API)
        # Choose a configuration.
        required = [egl.EGL_SURFACE_TYPE, 0, egl.EGL_RENDERABLE_TYPE, egl.EGL_OPENGL_BIT, egl.EGL_NONE]
        config = (egl.EGLConfig * 1)()
        count = egl.EGLint()
        egl.eglChooseConfig(display, (egl.EGLint * len(required))(*required), config, 1, count)
        if count.value == 0:
            raise RenderingError("it has no configuration for OpenGL")
        # Create the context.
        version = [egl.EGL_CONTEXT_MAJOR_VERSION, 3, egl.EGL_CONTEXT_MINOR_VERSION, 3]
        profile = [egl.EGL_CONTEXT_OPENGL_PROFILE_MASK, egl.EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, egl.EGL_NONE]
        attributes = (egl.EGLint * 7)(*version, *profile)
        context = egl.eglCreateContext(display, config[0], egl.EGL_NO_CONTEXT, attributes)
        if not context:
            raise RenderingError("it has no OpenGL 3.3 core context")
        return context


def check_process(process_id: int) -> None:
    """Raise a RenderingError unless this process has an id: OpenGL hangs in forks of the process with the context."""
    if os.getpid() != process_id:
        raise RenderingError(
            "rendering: this process was forked from the one that first rendered, and OpenGL would hang in it; "
            "start workers with the 'spawn' or 'forkserver' method, or render in the parent only after forking."
        )


def _load_egl() -> Any:
    """Return PyOpenGL's EGL module."""
    wanted = os.environ.get(PLATFORM_VARIABLE, "egl")
    if wanted.lower() != "egl":
        raise RenderingError(
            f"rendering: expected {PLATFORM_VARIABLE}=egl or none, received {quote(wanted)}; unset it. EGL draws "
            "without a screen and without a GPU, too."
        )
    try:
        from OpenGL import EGL, platform
    except Exception as error:  # PyOpenGL raises ImportError, AttributeError or TypeError where the library is missing.
        raise RenderingError(f"rendering: libEGL cannot be used: {_describe(error)}. {INSTALL_HINT}") from error
    chosen = type(platform.PLATFORM).__name__
    if "EGL" not in chosen:
        raise RenderingError(
            f"rendering: expected PyOpenGL on EGL, received {chosen}, because it was imported or set up first; "
            "import minigolf_env.rendering.gl.context before OpenGL, or set PYOPENGL_PLATFORM=egl."
        )
    return EGL


def _devices(egl: Any) -> list[Any]:
    """Return the EGL devices of this machine; none if the query fails."""
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
    """Return the EGL display of a native display on a platform."""
    from OpenGL.EGL.EXT.platform_base import eglGetPlatformDisplayEXT

    return eglGetPlatformDisplayEXT(platform, native, None)


@contextmanager
def _glx_released() -> Iterator[None]:
    """Release this thread's current GLX context (a window's) within a ``with`` block, and restore it afterwards.

    EGL cannot make a context current while a GLX context is.
    """
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
def egl_released() -> Iterator[None]:
    """Release this thread's current EGL context within a ``with`` block, and restore it afterwards.

    GLX (a window) cannot make a context current while an EGL context is, such as one that another library has left.
    """
    try:
        egl = _load_egl() if sys.platform == "linux" else None
    except RenderingError:
        egl = None  # Without EGL no EGL context can be current.
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
    """Return the GLX library, or None if there is none."""
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


def _describe(error: Exception) -> str:
    """Return type and message of an exception on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
