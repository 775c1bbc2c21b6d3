"""Draws courses with OpenGL 3.3; owns no context and knows no window.

Pictures are drawn upside down for OpenGL, so that the first row that is read is the top one.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from minigolf_env.courses import Course
from minigolf_env.rendering import props as models
from minigolf_env.rendering import textures
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.dirty_rect import CLOTH, Box, flag_at_rest, seen_between
from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.gl.course_buffers import FRAME_BLOCK, UP, CourseBuffers
from minigolf_env.rendering.gl.objects import (
    FRAME_SLOT,
    MATERIALS,
    Lines,
    Mesh,
    Program,
    Target,
    blended,
    cube_map,
    start_afresh,
    texture,
)
from minigolf_env.rendering.scene_state import Frame

FloatArray = NDArray[np.float64]
Picture = NDArray[np.uint8]
Kept = TypeVar("Kept")

SAMPLES = {"high": 4, "fast": 0}
"""Samples a pixel of each profile, for smooth edges; 0: a single one, without."""

KEPT = 8
"""Courses, and sizes of pictures, whose buffers are kept; the least recently used are freed."""

SMALL = 4.0
"""Radius below which the ball is drawn with fewer triangles, pixels."""

NOWHERE = np.array([0.0, 0.0, -1e3])
"""Where a ball throws no shadow, m."""

UPSIDE_DOWN = np.diag([1.0, -1.0, 1.0, 1.0])

BACKGROUND = 0.62, 0.72, 0.80
"""Of the sky, where the lawn ends: common.glsl's HAZE."""


class Renderer:
    """Draws into framebuffers of its own, in the context that is current when its methods are called.

    Programs, courses and framebuffers are made when first used and kept (the latter two within bounds).
    """

    def __init__(self) -> None:
        self._largest = int(GL.glGetIntegerv(GL.GL_MAX_RENDERBUFFER_SIZE))
        self._programs: dict[tuple[str, bool], Program] = {}
        self._fast = False
        self._courses: OrderedDict[Course, CourseBuffers] = OrderedDict()
        self._targets: OrderedDict[tuple[tuple[int, int], int], Target] = OrderedDict()
        self._frame = GL.glGenBuffers(1)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._frame)
        GL.glBufferData(GL.GL_UNIFORM_BUFFER, FRAME_BLOCK.itemsize, None, GL.GL_DYNAMIC_DRAW)
        felt, wood, stone = (texture(image) for image in (textures.felt(), textures.wood(), textures.stone()))
        self._paint = {"felt": felt, "lawn": felt, "wood": wood, "stone": stone, "brick": stone, "water": stone}
        self._dimples = cube_map(textures.ball())
        self._ball, self._small_ball = Mesh(*models.sphere(16, 32)), Mesh(*models.sphere(6, 12))
        self._pole = Mesh(*models.pole())
        self._cloth = Mesh(*models.cloth(CLOTH))
        self._lines = Lines()

    def draw(
        self,
        course: Course,
        camera: Camera,
        frame: Frame | None,
        size: tuple[int, int],
        profile: str,
        part: Box | None = None,
    ) -> Target:
        """Draw a picture of (width, height) pixels, or a part of it, and return what it was drawn to.

        Without a frame: the course with its flag, and no ball.
        """
        self._fast = profile == "fast"
        buffers = self._keep(self._courses, course, lambda: CourseBuffers(course, self._program("depth")))
        target = self._target(size, SAMPLES[profile])
        part = part or Box(0, 0, *size)
        clip = UPSIDE_DOWN @ camera.clip_from_world(size[0] / size[1])
        self._fill_frame(course, buffers, clip, camera, frame)
        self._begin(target, part)
        self._bind(buffers)
        edges = _edges(part, size)
        for (material, color), runs in buffers.visible(clip, edges):
            self._use(material, color=color)
            buffers.draw(runs)
        self._use("lawn")
        buffers.lawn.draw()
        foot = flag_at_rest(course) if frame is None else frame.flag
        if course.cup is not None and self._is_flag_seen(foot, clip, edges):
            self._draw_flag(foot)
        if frame is not None:
            self._draw_ball(course, camera, frame, clip, size[1])
            if frame.lines:
                GL.glUseProgram(self._program("line").name)
                self._lines.draw(frame.lines)
        GL.glDisable(GL.GL_SCISSOR_TEST)
        target.resolve()
        return target

    def _begin(self, target: Target, part: Box) -> None:
        target.bind()
        GL.glViewport(0, 0, *target.size)
        start_afresh()
        GL.glEnable(GL.GL_SCISSOR_TEST)
        GL.glScissor(part.left, part.top, part.right - part.left, part.bottom - part.top)
        GL.glFrontFace(GL.GL_CW)  # Upside down.
        GL.glClearColor(*BACKGROUND, 1.0)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)

    def _bind(self, buffers: CourseBuffers) -> None:
        """Make the textures of a course known; unit 2, for the paint of the material, stays the active one."""
        for unit, kind, name in (
            (0, GL.GL_TEXTURE_2D, buffers.sun.texture),
            (1, GL.GL_TEXTURE_2D, buffers.sky.texture),
            (3, GL.GL_TEXTURE_CUBE_MAP, self._dimples),
        ):
            GL.glActiveTexture(GL.GL_TEXTURE0 + unit)
            GL.glBindTexture(kind, name)
        GL.glActiveTexture(GL.GL_TEXTURE2)

    def _use(
        self, material: str, model: FloatArray | None = None, color: tuple[float, float, float] | None = None
    ) -> None:
        program = self._program(material)
        GL.glUseProgram(program.name)
        if model is not None:
            program.place(model)
        program.dye(color)
        if material in self._paint:
            GL.glBindTexture(GL.GL_TEXTURE_2D, self._paint[material])

    def _is_flag_seen(self, foot: FloatArray, clip: FloatArray, edges: FloatArray) -> bool:
        half = np.array([models.CLOTH_LENGTH, models.CLOTH_LENGTH, 0.5 * models.POLE_HEIGHT])
        lower, upper = seen_between((foot + UP * half)[None], half[None], clip)
        return bool((upper >= edges[0]).all() and (lower <= edges[1]).all())

    def _draw_flag(self, foot: FloatArray) -> None:
        model = _model(foot, 1.0)
        self._use("pole", model)
        self._pole.draw()
        GL.glDisable(GL.GL_CULL_FACE)
        self._use("cloth", model)
        self._cloth.draw()
        GL.glEnable(GL.GL_CULL_FACE)

    def _draw_ball(self, course: Course, camera: Camera, frame: Frame, clip: FloatArray, height: int) -> None:
        """Draw the ball, and a ghost of it where something hides it."""
        model = _model(frame.ball, frame.size * course.ball_radius, frame.turn)
        distance = float(clip[3] @ np.append(frame.ball, 1.0))
        radius = frame.size * course.ball_radius * camera.pixels_a_metre(distance, height)
        ball = self._small_ball if radius < SMALL else self._ball
        self._use("ball", model)
        ball.draw()
        self._use("ghost", model)
        with blended():
            GL.glDepthFunc(GL.GL_GREATER)
            ball.draw()
            GL.glDepthFunc(GL.GL_LESS)

    def _fill_frame(
        self, course: Course, buffers: CourseBuffers, clip: FloatArray, camera: Camera, frame: Frame | None
    ) -> None:
        block = buffers.frame
        block["clip_from_world"] = clip.T
        block["eye"][:3] = camera.eye
        block["ball"][:3] = NOWHERE if frame is None else frame.ball
        block["ball"][3] = course.ball_radius * (1.0 if frame is None else frame.size)
        block["flag"][:3] = flag_at_rest(course) if frame is None else frame.flag
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._frame)
        GL.glBufferSubData(GL.GL_UNIFORM_BUFFER, 0, block.nbytes, block)
        GL.glBindBufferBase(GL.GL_UNIFORM_BUFFER, FRAME_SLOT, self._frame)

    def _program(self, name: str) -> Program:
        key = name, self._fast and name in MATERIALS  # The others know no light.
        if key not in self._programs:
            self._programs[key] = Program(*key)
        return self._programs[key]

    def _target(self, size: tuple[int, int], samples: int) -> Target:
        if max(size) > self._largest:
            raise RenderingError(
                f"render_size: expected at most {self._largest} pixels a side, the graphics library's limit, "
                f"received {size}."
            )
        return self._keep(self._targets, (size, samples), lambda: Target(size, samples))

    def _keep(self, kept: OrderedDict[Any, Kept], key: Hashable, make: Callable[[], Kept]) -> Kept:
        """Return what is kept under a key, or make it; forget the least recently used."""
        if key not in kept:
            kept[key] = make()
            if len(kept) > KEPT:
                kept.popitem(last=False)[1].delete()  # type: ignore[attr-defined]
        kept.move_to_end(key)
        return kept[key]


def renderer_name() -> str:
    """Return what the graphics library calls itself."""
    name = GL.glGetString(GL.GL_RENDERER)
    return name.decode(errors="replace") if name else ""


def _edges(part: Box, size: tuple[int, int]) -> FloatArray:
    """Return the lower and upper edges (2, 2) of a part of a picture in x and y, -1 to 1."""
    pixels = np.array([[part.left, part.top], [part.right, part.bottom]])
    return np.asarray(2.0 * pixels / size - 1.0)


def _model(place: FloatArray, size: float, turn: FloatArray | None = None) -> FloatArray:
    """Return the matrix (4, 4) that turns, scales and places a model."""
    model = np.eye(4)
    model[:3, :3] = size * (np.eye(3) if turn is None else turn)
    model[:3, 3] = place
    return model
