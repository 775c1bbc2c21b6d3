"""What the graphics card holds of one course."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from minigolf_env.courses import Course
from minigolf_env.rendering import props as models
from minigolf_env.rendering.dirty_rect import CLOTH, SUN, seen_between
from minigolf_env.rendering.gl.objects import Mesh, Program, start_afresh, texture
from minigolf_env.rendering.scene import build_scene

FloatArray = NDArray[np.float64]
Paint = tuple[str, tuple[float, float, float] | None]
"""A material, and the colour it is dyed."""
Runs = list[tuple[int, int]]
"""(first, count) of indices to draw."""

UP = np.array([0.0, 0.0, 1.0])

LAWN_CELLS, LAWN_REACH = 40, 40.0
"""The lawn under the course is left out by cells, this many a side; around it the lawn goes on for so many metres."""

SUN_MAP, SKY_MAP = 1024, 512
"""Pixels a side of the maps of what is below the sun, and below the open sky."""

SUN_BLUR, SKY_BLUR = 0.012, 0.07
"""How wide the edges of the sun's shadows and of the dimmer light near walls are, m."""


FRAME_BLOCK = np.dtype(
    [
        *((name, "<f4", (4, 4)) for name in ("clip_from_world", "sun_from_world", "sky_from_world")),
        *((name, "<f4", (4,)) for name in ("eye", "sun", "ball", "flag", "cloth", "cup", "middle", "ground")),
    ]
)
"""The uniform block Frame of common.glsl (std140; matrices by columns)."""


class DepthMap(NamedTuple):
    """How deep below a far light the course lies: mean and mean square, blurred, for soft shadows."""

    from_world: FloatArray
    """(4, 4) from world coordinates to the map's, 0 to 1, and the depth, m."""
    texture: int
    depth: float
    """The greatest, where there is nothing, m."""


class CourseBuffers:
    """A course's mesh, the lawn around it, and the maps of what of it the sun and the sky see.

    Args:
        course: the course.
        program: draws depths.
    """

    def __init__(self, course: Course, program: Program) -> None:
        self.scene = scene = build_scene(course)
        self._mesh = Mesh(scene.vertices, scene.indices)
        lower, upper = (np.array([getattr(chunk, side) for chunk in scene.chunks]) for side in ("lower", "upper"))
        self._boxes = 0.5 * (lower + upper), 0.5 * (upper - lower)
        self.sun = self._depth_map(program, SUN, SUN_MAP, SUN_BLUR)
        self.sky = self._depth_map(program, UP, SKY_MAP, SKY_BLUR)
        self.lawn = Mesh(*models.lawn(self._lies_on_ground(program), scene.lower, scene.upper, LAWN_REACH))

        self.frame = self._frame_block(course)
        """A record of FRAME_BLOCK with what is the same in every picture of the course."""

    def visible(self, clip: FloatArray, edges: FloatArray) -> list[tuple[Paint, Runs]]:
        """Return what may be seen between edges (2, 2) of a picture, by material and colour."""
        lower, upper = seen_between(*self._boxes, clip)
        outside = (upper < edges[0]) | (lower > edges[1])
        runs: dict[Paint, Runs] = {}
        for chunk, hidden in zip(self.scene.chunks, outside.any(axis=1).tolist(), strict=True):
            if not hidden:
                known = runs.setdefault((chunk.material, chunk.color), [])
                if known and sum(known[-1]) == chunk.start:
                    known[-1] = (known[-1][0], known[-1][1] + chunk.size)
                else:
                    known.append((chunk.start, chunk.size))
        return list(runs.items())

    def draw(self, runs: Runs) -> None:
        """Draw parts of the course."""
        self._mesh.draw_runs(runs)

    def delete(self) -> None:
        """Free everything."""
        self._mesh.delete()
        self.lawn.delete()
        GL.glDeleteTextures([self.sun.texture, self.sky.texture])

    def _frame_block(self, course: Course) -> NDArray[np.void]:
        block, lower, upper = np.zeros((), FRAME_BLOCK), self.scene.lower, self.scene.upper
        block["sun_from_world"], block["sky_from_world"] = self.sun.from_world.T, self.sky.from_world.T
        block["sun"][:3], block["middle"][:3] = SUN, 0.5 * (lower + upper)
        block["ground"] = lower[2], 0.5 * np.linalg.norm(upper - lower), self.sun.depth, self.sky.depth
        if course.cup is not None:
            block["flag"][3] = models.POLE_HEIGHT
            block["cloth"] = *CLOTH, models.CLOTH_LENGTH, models.CLOTH_WIDTH
            block["cup"] = *course.cup.position, course.cup.radius
        return block

    def _depth_map(self, program: Program, toward: FloatArray, size: int, blur: float) -> DepthMap:
        """Return the map (size, size) as a light far away in a direction sees it, blurred by some metres."""
        lower, upper = self.scene.lower - 0.1, self.scene.upper + 0.1
        above = np.array([0.0, 1.0, 0.0]) if abs(toward[2]) > 0.99 else UP
        right = np.cross(above, toward)
        right = right / np.linalg.norm(right)
        axes = np.stack([right, np.cross(toward, right), -toward])
        middle, spread = 0.5 * (lower + upper), 0.5 * np.abs(axes) @ (upper - lower)
        clip = np.eye(4)
        clip[:3, :3] = axes / spread[:, None]
        clip[:3, 3] = -clip[:3, :3] @ middle
        depth = float(2.0 * spread[2])
        from_world = np.eye(4)
        from_world[:3] = 0.5 * clip[:3]
        from_world[:3, 3] += 0.5
        from_world[2] *= depth
        depths = _depths(self._mesh, program, clip, size) * depth
        radii = np.maximum(1, np.round(blur / (2.0 * spread[:2]) * size)).astype(int).tolist()
        moments = np.stack([_blurred(depths, radii), _blurred(depths**2, radii)], axis=-1)
        return DepthMap(from_world, texture(moments.astype(np.float32), wrap=GL.GL_CLAMP_TO_EDGE), depth)

    def _lies_on_ground(self, program: Program) -> NDArray[np.bool_]:
        """Return for cells in plan (LAWN_CELLS, LAWN_CELLS) whether they are all covered at the ground's level."""
        lower, upper = self.scene.lower, self.scene.upper
        spread = np.maximum(upper - lower, 1e-6)
        clip = np.diag([*(2.0 / spread), 1.0])
        clip[:3, 3] = -(upper + lower) / spread
        fine = 8
        depths = _depths(self._mesh, program, clip, LAWN_CELLS * fine, both_sides=True) * spread[2]
        lies = (depths < 0.02).reshape(LAWN_CELLS, fine, LAWN_CELLS, fine)
        return np.asarray(lies.all(axis=(1, 3)))


def _depths(mesh: Mesh, program: Program, clip: FloatArray, size: int, both_sides: bool = False) -> FloatArray:
    """Return the depths (size, size), 0 to 1, of a mesh's faces towards the eye, or of all; 1 where there is none."""
    before = GL.glGetIntegerv(GL.GL_DRAW_FRAMEBUFFER_BINDING)
    buffer, store = GL.glGenFramebuffers(1), GL.glGenRenderbuffers(1)
    GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, store)
    GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, GL.GL_DEPTH_COMPONENT32F, size, size)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, buffer)
    GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_RENDERBUFFER, store)
    GL.glDrawBuffer(GL.GL_NONE)
    GL.glReadBuffer(GL.GL_NONE)
    GL.glViewport(0, 0, size, size)
    start_afresh()
    if both_sides:
        GL.glDisable(GL.GL_CULL_FACE)
    GL.glFrontFace(GL.GL_CCW)
    GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
    GL.glUseProgram(program.name)
    program.place(clip)
    mesh.draw()
    depths = np.empty((size, size), np.float32)
    GL.glReadPixels(0, 0, size, size, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, depths)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, before)
    GL.glDeleteFramebuffers(1, [buffer])
    GL.glDeleteRenderbuffers(1, [store])
    return depths.astype(np.float64)


def _blurred(values: FloatArray, radii: list[int]) -> FloatArray:
    """Return values (H, W) averaged twice over boxes of radii (along x, along y), which is a round enough filter."""
    for _ in range(2):
        for axis, r in ((1, radii[0]), (0, radii[1])):
            width = [(0, 0), (0, 0)]
            width[axis] = (r + 1, r)
            sums = np.cumsum(np.pad(values, width, mode="edge"), axis=axis)
            n = values.shape[axis]
            values = (np.take(sums, range(2 * r + 1, 2 * r + 1 + n), axis) - np.take(sums, range(n), axis)) / (
                2 * r + 1
            )
    return values
