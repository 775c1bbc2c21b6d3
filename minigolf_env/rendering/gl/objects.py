"""What lives on the graphics card: programs, meshes, lines, textures and framebuffers.

Each works in the context that is current, and is freed by ``delete`` in the same.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from minigolf_env.rendering.dirty_rect import Box
from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.scene import VERTEX
from minigolf_env.rendering.scene_state import Line

Picture = NDArray[np.uint8]

MATERIALS = (
    "felt",
    "lawn",
    "wood",
    "stone",
    "wall",
    "cup",
    "brick",
    "paint",
    "water",
    "cloth",
    "pole",
    "ball",
    "ghost",
)
"""What surface.frag knows how to paint: a program each."""

FRAME_SLOT = 5
"""Uniform buffer binding of common.glsl's Frame; pyglet counts its own from 0."""


class Program:
    """A linked shader program: "depth", "line", or the name of a material; ``fast``: with less light on it."""

    def __init__(self, name: str, fast: bool = False) -> None:
        stem = "surface" if name in MATERIALS else name
        defines = "".join(f"#define {m.upper()} {k}\n" for k, m in enumerate(MATERIALS))
        defines += "#define FAST\n" if fast else ""
        defines += f"#define MATERIAL {name.upper()}\n" if name in MATERIALS else ""
        self.name = GL.glCreateProgram()
        for kind, ending in ((GL.GL_VERTEX_SHADER, "vert"), (GL.GL_FRAGMENT_SHADER, "frag")):
            shader = GL.glCreateShader(kind)
            GL.glShaderSource(shader, source("common.glsl") + defines + source(f"{stem}.{ending}"))
            GL.glCompileShader(shader)
            if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
                log = GL.glGetShaderInfoLog(shader).decode(errors="replace")
                raise RenderingError(f"rendering: the graphics library does not take {stem}.{ending} ({name}): {log}")
            GL.glAttachShader(self.name, shader)
            GL.glDeleteShader(shader)
        GL.glLinkProgram(self.name)
        if not GL.glGetProgramiv(self.name, GL.GL_LINK_STATUS):
            log = GL.glGetProgramInfoLog(self.name).decode(errors="replace")
            raise RenderingError(f"rendering: the graphics library does not link {name}: {log}")
        GL.glUseProgram(self.name)
        block = GL.glGetUniformBlockIndex(self.name, "Frame")
        if block != GL.GL_INVALID_INDEX:
            GL.glUniformBlockBinding(self.name, block, FRAME_SLOT)
        self._model = GL.glGetUniformLocation(self.name, "model")
        self._dye = GL.glGetUniformLocation(self.name, "dye")
        self.place(np.eye(4))
        self.dye(None)
        for unit, sampler in enumerate(("sun_map", "sky_map", "detail", "dimples")):
            GL.glUniform1i(GL.glGetUniformLocation(self.name, sampler), unit)

    def place(self, model: NDArray[np.float64]) -> None:
        """Put what it draws from now on where a matrix (4, 4) says; the program is in use."""
        GL.glUniformMatrix4fv(self._model, 1, GL.GL_TRUE, model.astype(np.float32))

    def dye(self, color: tuple[float, float, float] | None) -> None:
        """Dye what it draws from now on with sRGB shares, or not; the program is in use."""
        if self._dye >= 0:
            GL.glUniform4f(self._dye, *((*color, 1.0) if color is not None else (0.0, 0.0, 0.0, 0.0)))


def source(name: str) -> str:
    """Return the text of a shader."""
    return (files("minigolf_env.rendering.gl") / "shaders" / name).read_text(encoding="utf-8")


class Mesh:
    """Vertices and indices on the graphics card."""

    def __init__(self, vertices: NDArray[np.void], indices: NDArray[np.uint32]) -> None:
        self.count = len(indices)
        self._array = GL.glGenVertexArrays(1)
        self._buffers = GL.glGenBuffers(2)
        GL.glBindVertexArray(self._array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffers[0])
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STATIC_DRAW)
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, self._buffers[1])
        GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, indices.nbytes, indices, GL.GL_STATIC_DRAW)
        _attributes(VERTEX)

    def draw(self) -> None:
        """Draw everything."""
        self.draw_runs([(0, self.count)])

    def draw_runs(self, runs: list[tuple[int, int]]) -> None:
        """Draw runs (first, count) of the indices."""
        GL.glBindVertexArray(self._array)
        for first, count in runs:
            GL.glDrawElements(GL.GL_TRIANGLES, count, GL.GL_UNSIGNED_INT, ctypes.c_void_p(4 * first))

    def delete(self) -> None:
        """Free everything."""
        GL.glDeleteVertexArrays(1, [self._array])
        GL.glDeleteBuffers(2, self._buffers)


def _attributes(record: np.dtype[np.void]) -> None:
    """Tell the bound vertex array what its vertices hold: one attribute a field, in order."""
    from OpenGL.raw.GL.VERSION.GL_2_0 import glVertexAttribPointer  # PyOpenGL's own fails in a window's context.

    for k, name in enumerate(record.names or ()):
        field, offset = record.fields[name][:2]  # type: ignore[index]
        GL.glEnableVertexAttribArray(k)
        glVertexAttribPointer(k, field.shape[0], GL.GL_FLOAT, False, record.itemsize, ctypes.c_void_p(offset))


class Lines:
    """Bands of changing shape and colour."""

    VERTEX = np.dtype([("position", "<f4", (3,)), ("tint", "<f4", (4,))])

    def __init__(self) -> None:
        self._array, self._buffer = GL.glGenVertexArrays(1), GL.glGenBuffers(1)
        GL.glBindVertexArray(self._array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffer)
        _attributes(self.VERTEX)

    def draw(self, lines: tuple[Line, ...]) -> None:
        """Draw lines over what is there, hidden by what is in front of them."""
        strips = []
        for line in lines:
            positions, tints = line.band()
            strip = np.zeros(len(positions), self.VERTEX)
            strip["position"], strip["tint"] = positions, tints
            strips.append(strip)
        vertices = np.concatenate(strips)
        GL.glBindVertexArray(self._array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffer)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STREAM_DRAW)
        GL.glDisable(GL.GL_CULL_FACE)
        with blended():
            first = 0
            for strip in strips:
                GL.glDrawArrays(GL.GL_TRIANGLE_STRIP, first, len(strip))
                first += len(strip)
        GL.glEnable(GL.GL_CULL_FACE)


@contextmanager
def blended() -> Iterator[None]:
    """Mix what is drawn within a ``with`` block into what is there, by its opacity."""
    GL.glEnable(GL.GL_BLEND)
    GL.glBlendFunc(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA)
    GL.glDepthMask(GL.GL_FALSE)
    yield
    GL.glDepthMask(GL.GL_TRUE)
    GL.glDisable(GL.GL_BLEND)


def start_afresh() -> None:
    """Set what every drawing relies on, whatever one that was interrupted has left."""
    for switch in (GL.GL_SCISSOR_TEST, GL.GL_BLEND):
        GL.glDisable(switch)
    for switch in (GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
        GL.glEnable(switch)
    GL.glDepthMask(GL.GL_TRUE)
    GL.glDepthFunc(GL.GL_LESS)


class Target:
    """A framebuffer of a size, with several samples a pixel or one, and the picture made of it."""

    def __init__(self, size: tuple[int, int], samples: int) -> None:
        self.size = size
        self.resolved = GL.glGenFramebuffers(1)
        self._stores: list[int] = []
        self._drawn = GL.glGenFramebuffers(1) if samples else self.resolved
        self._attach(self._drawn, GL.GL_COLOR_ATTACHMENT0, GL.GL_RGBA8, samples)
        self._attach(self._drawn, GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT24, samples)
        if samples:
            self._attach(self.resolved, GL.GL_COLOR_ATTACHMENT0, GL.GL_RGBA8, 0)
        if GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) != GL.GL_FRAMEBUFFER_COMPLETE:
            raise RenderingError(f"rendering: the graphics library has no framebuffer of {size} pixels.")

    def bind(self) -> None:
        """Make it what is drawn to."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._drawn)

    def resolve(self) -> None:
        """Make one colour of each pixel's samples."""
        if self._drawn != self.resolved:
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._drawn)
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self.resolved)
            box = 0, 0, *self.size
            GL.glBlitFramebuffer(*box, *box, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)

    def read(self, part: Box | None = None) -> Picture:
        """Return the picture (height, width, 3), or a part of it."""
        left, top, right, bottom = part or Box(0, 0, *self.size)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.resolved)
        picture = np.empty((bottom - top, right - left, 3), np.uint8)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        GL.glReadPixels(left, top, right - left, bottom - top, GL.GL_RGB, GL.GL_UNSIGNED_BYTE, picture)
        return picture

    def show(self, width: int, height: int) -> None:
        """Copy the picture to the window's framebuffer of (width, height) pixels."""
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.resolved)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, 0)
        source = 0, self.size[1], self.size[0], 0
        GL.glBlitFramebuffer(*source, 0, 0, width, height, GL.GL_COLOR_BUFFER_BIT, GL.GL_LINEAR)

    def delete(self) -> None:
        """Free everything."""
        GL.glDeleteFramebuffers(1, [self.resolved])
        if self._drawn != self.resolved:
            GL.glDeleteFramebuffers(1, [self._drawn])
        GL.glDeleteRenderbuffers(len(self._stores), self._stores)

    def _attach(self, framebuffer: int, point: int, kind: int, samples: int) -> None:
        store = GL.glGenRenderbuffers(1)
        self._stores.append(store)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, store)
        GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, kind, *self.size)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, point, GL.GL_RENDERBUFFER, store)


def texture(image: NDArray[Any], wrap: int = GL.GL_REPEAT) -> int:
    """Return a texture of an image (H, W, C): bytes with mipmaps, or floats without."""
    height, width, channels = image.shape
    small = image.dtype == np.uint8
    form = {1: GL.GL_RED, 2: GL.GL_RG, 3: GL.GL_RGB, 4: GL.GL_RGBA}[channels]
    inner = {1: GL.GL_R8, 4: GL.GL_RGBA8}[channels] if small else GL.GL_RG32F
    texture: int = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    kind = GL.GL_UNSIGNED_BYTE if small else GL.GL_FLOAT
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, inner, width, height, 0, form, kind, np.ascontiguousarray(image))
    for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
        GL.glTexParameteri(GL.GL_TEXTURE_2D, axis, wrap)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
    smaller = GL.GL_LINEAR_MIPMAP_NEAREST if small else GL.GL_LINEAR
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, smaller)
    if small:
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
    return texture


def cube_map(faces: Picture) -> int:
    """Return a cube map of six images (6, S, S, 4)."""
    texture: int = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_CUBE_MAP, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    for k, face in enumerate(faces):
        size = len(face)
        side = GL.GL_TEXTURE_CUBE_MAP_POSITIVE_X + k
        GL.glTexImage2D(
            side, 0, GL.GL_RGBA8, size, size, 0, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, np.ascontiguousarray(face)
        )
    GL.glTexParameteri(GL.GL_TEXTURE_CUBE_MAP, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
    GL.glTexParameteri(GL.GL_TEXTURE_CUBE_MAP, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR)
    GL.glGenerateMipmap(GL.GL_TEXTURE_CUBE_MAP)
    return texture
