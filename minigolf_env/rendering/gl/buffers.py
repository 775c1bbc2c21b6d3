"""Objects on the graphics card: meshes, line strips, framebuffers and textures.

Each works in the context that is current, and is freed by ``delete`` in the same.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from minigolf_env.rendering.course_geometry import VERTEX_DTYPE
from minigolf_env.rendering.dirty_rect import PixelRect
from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.scene_state import Line

LINE_VERTEX_DTYPE = np.dtype([("position", "<f4", (3,)), ("color", "<f4", (4,))])
"""A vertex of a line strip, as line.vert reads it: m; red, green, blue, opacity."""


class MeshBuffer:
    """Vertex and index buffers of a triangle mesh."""

    def __init__(self, vertices: NDArray[np.void], indices: NDArray[np.uint32]) -> None:
        self.num_indices = len(indices)
        self._vertex_array = GL.glGenVertexArrays(1)
        self._buffers = GL.glGenBuffers(2)
        GL.glBindVertexArray(self._vertex_array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffers[0])
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STATIC_DRAW)
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, self._buffers[1])
        GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, indices.nbytes, indices, GL.GL_STATIC_DRAW)
        _declare_attributes(VERTEX_DTYPE)

    def draw(self) -> None:
        """Draw all triangles."""
        self.draw_runs([(0, self.num_indices)])

    def draw_runs(self, runs: list[tuple[int, int]]) -> None:
        """Draw runs (first, count) of the indices."""
        GL.glBindVertexArray(self._vertex_array)
        for first, count in runs:
            GL.glDrawElements(GL.GL_TRIANGLES, count, GL.GL_UNSIGNED_INT, ctypes.c_void_p(4 * first))

    def delete(self) -> None:
        """Free the buffers."""
        GL.glDeleteVertexArrays(1, [self._vertex_array])
        GL.glDeleteBuffers(2, self._buffers)


class LineStrips:
    """A buffer for lines, which is filled again at each draw."""

    def __init__(self) -> None:
        self._vertex_array = GL.glGenVertexArrays(1)
        self._buffer = GL.glGenBuffers(1)
        GL.glBindVertexArray(self._vertex_array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffer)
        _declare_attributes(LINE_VERTEX_DTYPE)

    def draw(self, lines: tuple[Line, ...]) -> None:
        """Draw lines with depth test and alpha blending."""
        # All triangle strips in one upload.
        strips = []
        for line in lines:
            positions, colors = line.triangle_strip()
            strip = np.zeros(len(positions), LINE_VERTEX_DTYPE)
            strip["position"] = positions
            strip["color"] = colors
            strips.append(strip)
        vertices = np.concatenate(strips)
        GL.glBindVertexArray(self._vertex_array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffer)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STREAM_DRAW)
        # One draw call per strip.
        GL.glDisable(GL.GL_CULL_FACE)
        with alpha_blending():
            first = 0
            for strip in strips:
                GL.glDrawArrays(GL.GL_TRIANGLE_STRIP, first, len(strip))
                first += len(strip)
        GL.glEnable(GL.GL_CULL_FACE)


class Framebuffer:
    """A framebuffer with colour and depth, and a resolved copy of the colour if it is multisampled.

    Args:
        size: width and height, pixels.
        samples: samples per pixel of multisample anti-aliasing; 0: none.
        num_colors: number of colour buffers; a multisampled one has one.

    Raises:
        RenderingError: the driver has no framebuffer of this size.
    """

    def __init__(self, size: tuple[int, int], samples: int, num_colors: int = 1) -> None:
        self.size = size
        self._renderbuffers: list[int] = []
        self._resolved = GL.glGenFramebuffers(1)
        self._drawn = GL.glGenFramebuffers(1) if samples else self._resolved
        colors = [GL.GL_COLOR_ATTACHMENT0 + k for k in range(num_colors)]
        for attachment in colors:
            self._attach(self._drawn, attachment, GL.GL_RGBA8, samples)
        GL.glDrawBuffers(num_colors, colors)
        self._attach(self._drawn, GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT24, samples)
        if samples:
            self._attach(self._resolved, GL.GL_COLOR_ATTACHMENT0, GL.GL_RGBA8, 0)
        if GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) != GL.GL_FRAMEBUFFER_COMPLETE:
            raise RenderingError(f"rendering: the OpenGL driver has no framebuffer of {size} pixels.")

    def bind(self) -> None:
        """Make this the destination of draw calls."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._drawn)

    def resolve(self) -> None:
        """Average the samples of each pixel."""
        if self._drawn != self._resolved:
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._drawn)
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._resolved)
            rect = 0, 0, *self.size
            GL.glBlitFramebuffer(*rect, *rect, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)

    def read(self, rect: PixelRect | None = None, color: int = 0, channels: int = 3) -> NDArray[np.uint8]:
        """Return the resolved image (height, width, channels), or a rectangle of it, from one of the colour buffers."""
        left, top, right, bottom = rect or PixelRect(0, 0, *self.size)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._resolved)
        GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT0 + color)
        pixel_format = {3: GL.GL_RGB, 4: GL.GL_RGBA}[channels]
        image = np.empty((bottom - top, right - left, channels), np.uint8)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        GL.glReadPixels(left, top, right - left, bottom - top, pixel_format, GL.GL_UNSIGNED_BYTE, image)
        return image

    def read_depth(self) -> NDArray[np.float32]:
        """Return the depth buffer (height, width), 0 at the near clipping plane to 1 at the far one."""
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._resolved)
        depths = np.empty(self.size[::-1], np.float32)
        GL.glReadPixels(0, 0, *self.size, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, depths)
        return depths

    def blit_to_window(self, width: int, height: int) -> None:
        """Copy the resolved image to the window's framebuffer of (width, height) pixels."""
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._resolved)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, 0)
        flipped = 0, self.size[1], self.size[0], 0
        GL.glBlitFramebuffer(*flipped, 0, 0, width, height, GL.GL_COLOR_BUFFER_BIT, GL.GL_LINEAR)

    def delete(self) -> None:
        """Free the framebuffers."""
        GL.glDeleteFramebuffers(1, [self._resolved])
        if self._drawn != self._resolved:
            GL.glDeleteFramebuffers(1, [self._drawn])
        GL.glDeleteRenderbuffers(len(self._renderbuffers), self._renderbuffers)

    def _attach(self, framebuffer: int, attachment: int, pixel_format: int, samples: int) -> None:
        """Attach a new renderbuffer to a framebuffer."""
        renderbuffer = GL.glGenRenderbuffers(1)
        self._renderbuffers.append(renderbuffer)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, renderbuffer)
        GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, pixel_format, *self.size)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, renderbuffer)


@contextmanager
def alpha_blending() -> Iterator[None]:
    """Blend what is drawn within a ``with`` block by its opacity; it does not change the depth buffer."""
    GL.glEnable(GL.GL_BLEND)
    GL.glBlendFunc(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA)
    GL.glDepthMask(GL.GL_FALSE)
    yield
    GL.glDepthMask(GL.GL_TRUE)
    GL.glDisable(GL.GL_BLEND)


def reset_gl_state() -> None:
    """Set the state that every pass starts from, whatever an interrupted pass has left."""
    for capability in (GL.GL_SCISSOR_TEST, GL.GL_BLEND):
        GL.glDisable(capability)
    for capability in (GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
        GL.glEnable(capability)
    GL.glDepthMask(GL.GL_TRUE)
    GL.glDepthFunc(GL.GL_LESS)


def create_texture(image: NDArray[Any], wrap: int = GL.GL_REPEAT) -> int:
    """Return a texture of an image (H, W, C): bytes with mipmaps, or two channels of floats without."""
    # Pixel formats of the array and of the texture.
    height, width, channels = image.shape
    is_bytes = image.dtype == np.uint8
    pixel_format = {1: GL.GL_RED, 2: GL.GL_RG, 3: GL.GL_RGB, 4: GL.GL_RGBA}[channels]
    internal_format = {1: GL.GL_R8, 4: GL.GL_RGBA8}[channels] if is_bytes else GL.GL_RG32F
    component_type = GL.GL_UNSIGNED_BYTE if is_bytes else GL.GL_FLOAT
    # Upload.
    texture: int = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    texels = np.ascontiguousarray(image)
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal_format, width, height, 0, pixel_format, component_type, texels)
    # Wrapping and filters.
    for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
        GL.glTexParameteri(GL.GL_TEXTURE_2D, axis, wrap)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
    min_filter = GL.GL_LINEAR_MIPMAP_NEAREST if is_bytes else GL.GL_LINEAR
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, min_filter)
    if is_bytes:
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
    return texture


def create_cube_map(faces: NDArray[np.uint8]) -> int:
    """Return a cube map of six square images (6, S, S, 4)."""
    texture: int = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_CUBE_MAP, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    for k, face in enumerate(faces):
        size = len(face)
        target = GL.GL_TEXTURE_CUBE_MAP_POSITIVE_X + k
        texels = np.ascontiguousarray(face)
        GL.glTexImage2D(target, 0, GL.GL_RGBA8, size, size, 0, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, texels)
    GL.glTexParameteri(GL.GL_TEXTURE_CUBE_MAP, GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR)
    GL.glTexParameteri(GL.GL_TEXTURE_CUBE_MAP, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR)
    GL.glGenerateMipmap(GL.GL_TEXTURE_CUBE_MAP)
    return texture


def _declare_attributes(vertex_dtype: np.dtype[np.void]) -> None:
    """Declare the attributes of the bound vertex array: one per field of the dtype, in order."""
    from OpenGL.raw.GL.VERSION.GL_2_0 import glVertexAttribPointer  # PyOpenGL's own fails in a window's context.

    for k, name in enumerate(vertex_dtype.names or ()):
        field, offset = vertex_dtype.fields[name][:2]  # type: ignore[index]
        GL.glEnableVertexAttribArray(k)
        glVertexAttribPointer(k, field.shape[0], GL.GL_FLOAT, False, vertex_dtype.itemsize, ctypes.c_void_p(offset))
