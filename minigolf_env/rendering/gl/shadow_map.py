"""Depth maps of a course: variance shadow maps of the sun and the sky, and the ground that the course covers.

Source: W. Donnelly and A. Lauritzen, "Variance Shadow Maps", 2006. A map stores mean and mean square of the depth below
a distant light, blurred; surface.frag bounds the share of light at a point by Chebyshev's inequality.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from minigolf_env.rendering.gl.buffers import MeshBuffer, create_texture, reset_gl_state
from minigolf_env.rendering.gl.program import Program

FloatArray = NDArray[np.float64]

UP_DIRECTION = np.array([0.0, 0.0, 1.0])
"""Unit vector (3,) upwards."""

BOUNDS_MARGIN = 0.1
"""Distance by which a map's volume extends beyond the course's bounding box, m."""

COVER_HEIGHT = 0.02
"""Height above the lawn up to which a surface counts as covering it, m."""

COVER_SAMPLES = 8
"""Number of depth samples per side of a cell of the lawn."""


class ShadowMap(NamedTuple):
    """A variance shadow map of a distant light."""

    from_world: FloatArray
    """Matrix (4, 4) from world coordinates to texture coordinates, 0 to 1, and depth, m."""
    texture: int
    """Texture with mean and mean square of the depth."""
    max_depth: float
    """Depth of the far plane, m: the depth where there is no occluder."""


def create_shadow_map(
    mesh: MeshBuffer,
    program: Program,
    bounds: tuple[FloatArray, FloatArray],
    to_light: FloatArray,
    size: int,
    blur: float,
) -> ShadowMap:
    """Render the shadow map of a mesh.

    Args:
        mesh: the occluders.
        program: the program "depth".
        bounds: lower and upper corner (3,) of the mesh's bounding box, m.
        to_light: unit vector (3,) to the light.
        size: pixels per side.
        blur: radius of the blur, m.
    """
    # Orthographic projection along the light that contains the bounding box.
    lower, upper = bounds[0] - BOUNDS_MARGIN, bounds[1] + BOUNDS_MARGIN
    reference = np.array([0.0, 1.0, 0.0]) if abs(to_light[2]) > 0.99 else UP_DIRECTION
    right = np.cross(reference, to_light)
    right = right / np.linalg.norm(right)
    axes = np.stack([right, np.cross(to_light, right), -to_light])
    center = 0.5 * (lower + upper)
    half_extent = 0.5 * np.abs(axes) @ (upper - lower)
    clip = np.eye(4)
    clip[:3, :3] = axes / half_extent[:, None]
    clip[:3, 3] = -clip[:3, :3] @ center
    # The same from [-1, 1] to [0, 1], with depth in metres.
    max_depth = float(2.0 * half_extent[2])
    from_world = np.eye(4)
    from_world[:3] = 0.5 * clip[:3]
    from_world[:3, 3] += 0.5
    from_world[2] *= max_depth
    # Mean and mean square of the depth.
    depths = _render_depth(mesh, program, clip, size) * max_depth
    radii = np.maximum(1, np.round(blur / (2.0 * half_extent[:2]) * size)).astype(int).tolist()
    moments = np.stack([_blur(depths, radii), _blur(depths**2, radii)], axis=-1)
    texture = create_texture(moments.astype(np.float32), wrap=GL.GL_CLAMP_TO_EDGE)
    return ShadowMap(from_world, texture, max_depth)


def find_covered_cells(
    mesh: MeshBuffer, program: Program, bounds: tuple[FloatArray, FloatArray], num_cells: int
) -> NDArray[np.bool_]:
    """Return a mask (num_cells, num_cells) of the cells of a box's base that a mesh at ground level covers completely.

    Args:
        mesh: the mesh.
        program: the program "depth".
        bounds: lower and upper corner (3,) of the mesh's bounding box, m.
        num_cells: cells per side.
    """
    # Orthographic projection upwards from the base of the box.
    lower, upper = bounds
    extent = np.maximum(upper - lower, 1e-6)
    clip = np.diag([*(2.0 / extent), 1.0])
    clip[:3, 3] = -(upper + lower) / extent
    depths = _render_depth(mesh, program, clip, num_cells * COVER_SAMPLES, both_sides=True) * extent[2]
    is_covered = (depths < COVER_HEIGHT).reshape(num_cells, COVER_SAMPLES, num_cells, COVER_SAMPLES)
    return np.asarray(is_covered.all(axis=(1, 3)))


def _render_depth(
    mesh: MeshBuffer, program: Program, clip: FloatArray, size: int, both_sides: bool = False
) -> FloatArray:
    """Return the depth (size, size), 0 to 1, of a mesh's front faces, or of both sides; 1 where there is none."""
    # A framebuffer with depth alone.
    previous = GL.glGetIntegerv(GL.GL_DRAW_FRAMEBUFFER_BINDING)
    framebuffer = GL.glGenFramebuffers(1)
    renderbuffer = GL.glGenRenderbuffers(1)
    GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, renderbuffer)
    GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, GL.GL_DEPTH_COMPONENT32F, size, size)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_RENDERBUFFER, renderbuffer)
    GL.glDrawBuffer(GL.GL_NONE)
    GL.glReadBuffer(GL.GL_NONE)
    # Draw.
    GL.glViewport(0, 0, size, size)
    reset_gl_state()
    if both_sides:
        GL.glDisable(GL.GL_CULL_FACE)
    GL.glFrontFace(GL.GL_CCW)
    GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
    program.use()
    program.set_model_matrix(clip)
    mesh.draw()
    # Read and clean up.
    depths = np.empty((size, size), np.float32)
    GL.glReadPixels(0, 0, size, size, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, depths)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, previous)
    GL.glDeleteFramebuffers(1, [framebuffer])
    GL.glDeleteRenderbuffers(1, [renderbuffer])
    return depths.astype(np.float64)


def _blur(values: FloatArray, radii: list[int]) -> FloatArray:
    """Return values (H, W) after two box filters of radii (along x, along y), which approximate a Gaussian blur."""
    for _ in range(2):
        for axis, radius in ((1, radii[0]), (0, radii[1])):
            # Each mean is the difference of two cumulative sums.
            padding = [(0, 0), (0, 0)]
            padding[axis] = (radius + 1, radius)
            sums = np.cumsum(np.pad(values, padding, mode="edge"), axis=axis)
            n = values.shape[axis]
            width = 2 * radius + 1
            values = (np.take(sums, range(width, width + n), axis) - np.take(sums, range(n), axis)) / width
    return values
