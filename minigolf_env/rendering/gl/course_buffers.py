"""Buffers of one course on the graphics card: its mesh, the lawn around it, and its shadow maps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from minigolf_env.courses import Course
from minigolf_env.rendering import props
from minigolf_env.rendering.course_geometry import build_course_geometry
from minigolf_env.rendering.dirty_rect import project_aabbs
from minigolf_env.rendering.gl.buffers import MeshBuffer
from minigolf_env.rendering.gl.program import Program
from minigolf_env.rendering.gl.shadow_map import UP_DIRECTION, create_shadow_map, find_covered_cells

FloatArray = NDArray[np.float64]
TintedMaterial = tuple[str, tuple[float, float, float] | None]
"""Name of a material, and the colour that tints it."""
IndexRuns = list[tuple[int, int]]
"""Runs (first, count) of indices to draw."""

LAWN_CELLS = 40
"""Number of cells per side under the course; cells that the course hides are cut out of the lawn."""

LAWN_MARGIN = 40.0
"""Distance by which the lawn extends beyond the course, m."""

SUN_MAP_SIZE = 1024
"""Pixels per side of the sun's shadow map."""

SKY_MAP_SIZE = 512
"""Pixels per side of the sky's shadow map, whose light is straight above."""

SUN_BLUR = 0.012
"""Blur radius of the sun's map, m: the softness of its shadows."""

SKY_BLUR = 0.07
"""Blur radius of the sky's map, m: the width of the darkening near walls."""

FRAME_UNIFORMS_DTYPE = np.dtype(
    [
        *((name, "<f4", (4, 4)) for name in ("clip_from_world", "sun_from_world", "sky_from_world")),
        *((name, "<f4", (4,)) for name in ("eye", "ball", "flag", "cloth", "cup", "center", "ground")),
    ]
)
"""The uniform block FrameUniforms of common.glsl, which explains its fields (std140; matrices by columns)."""


class CourseBuffers:
    """The buffers of one course, made once and drawn in every image of it.

    Args:
        course: the course.
        depth_program: the program "depth", for the shadow maps.
    """

    def __init__(self, course: Course, depth_program: Program) -> None:
        self.geometry = geometry = build_course_geometry(course)
        self._mesh = MeshBuffer(geometry.vertices, geometry.indices)
        lower, upper = (np.array([getattr(chunk, side) for chunk in geometry.chunks]) for side in ("lower", "upper"))
        self._chunk_centers = 0.5 * (lower + upper)
        self._chunk_half_extents = 0.5 * (upper - lower)
        bounds = geometry.lower, geometry.upper
        self.sun_map = create_shadow_map(self._mesh, depth_program, bounds, props.SUN_DIRECTION, SUN_MAP_SIZE, SUN_BLUR)
        self.sky_map = create_shadow_map(self._mesh, depth_program, bounds, UP_DIRECTION, SKY_MAP_SIZE, SKY_BLUR)
        covered = find_covered_cells(self._mesh, depth_program, bounds, LAWN_CELLS)
        self.lawn = MeshBuffer(*props.lawn(covered, geometry.lower, geometry.upper, LAWN_MARGIN))
        self.uniforms = self._course_uniforms(course)
        """A record of FRAME_UNIFORMS_DTYPE; its fields that depend on the frame are set before each draw."""

    def visible_runs(self, clip: FloatArray, edges: FloatArray) -> list[tuple[TintedMaterial, IndexRuns]]:
        """Return the chunks that may be visible between edges (2, 2) of an image, by material and colour.

        Neighbouring chunks are merged into one run.
        """
        lower, upper = project_aabbs(self._chunk_centers, self._chunk_half_extents, clip)
        is_outside = ((upper < edges[0]) | (lower > edges[1])).any(axis=1)
        runs: dict[TintedMaterial, IndexRuns] = {}
        for chunk, is_culled in zip(self.geometry.chunks, is_outside.tolist(), strict=True):
            if is_culled:
                continue
            material_runs = runs.setdefault((chunk.material, chunk.color), [])
            if material_runs and sum(material_runs[-1]) == chunk.start:
                material_runs[-1] = (material_runs[-1][0], material_runs[-1][1] + chunk.size)
            else:
                material_runs.append((chunk.start, chunk.size))
        return list(runs.items())

    def draw(self, runs: IndexRuns) -> None:
        """Draw parts of the course."""
        self._mesh.draw_runs(runs)

    def delete(self) -> None:
        """Free the buffers."""
        self._mesh.delete()
        self.lawn.delete()
        GL.glDeleteTextures([self.sun_map.texture, self.sky_map.texture])

    def _course_uniforms(self, course: Course) -> NDArray[np.void]:
        """Return the uniforms that are the same in every frame of the course; the others are zero."""
        uniforms = np.zeros((), FRAME_UNIFORMS_DTYPE)
        lower, upper = self.geometry.lower, self.geometry.upper
        uniforms["sun_from_world"] = self.sun_map.from_world.T
        uniforms["sky_from_world"] = self.sky_map.from_world.T
        uniforms["center"][:3] = 0.5 * (lower + upper)
        course_radius = 0.5 * np.linalg.norm(upper - lower)
        uniforms["ground"] = lower[2], course_radius, self.sun_map.max_depth, self.sky_map.max_depth
        if course.cup is not None:
            uniforms["flag"][3] = props.POLE_HEIGHT
            uniforms["cloth"] = *props.CLOTH_DIRECTION, props.CLOTH_LENGTH, props.CLOTH_WIDTH
            uniforms["cup"] = *course.cup.position, course.cup.radius
        return uniforms
