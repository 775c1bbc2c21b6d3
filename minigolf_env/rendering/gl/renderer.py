"""The renderer: draws courses and scene states with OpenGL 3.3. It works in any current context.

Images are drawn upside down: OpenGL reads the lowest row first, which is then the top row of the image.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from minigolf_env.courses import Course
from minigolf_env.rendering import props, textures
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.dirty_rect import PixelRect, project_aabbs
from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.gbuffer import GBuffer
from minigolf_env.rendering.gl.buffers import (
    Framebuffer,
    LineStrips,
    MeshBuffer,
    alpha_blending,
    create_cube_map,
    create_texture,
    reset_gl_state,
)
from minigolf_env.rendering.gl.course_buffers import FRAME_UNIFORMS_DTYPE, CourseBuffers
from minigolf_env.rendering.gl.program import FRAME_UNIFORMS_BINDING, MATERIAL_NAMES, TEXTURE_UNITS, Program
from minigolf_env.rendering.gl.shadow_map import UP_DIRECTION
from minigolf_env.rendering.scene_state import SceneState

FloatArray = NDArray[np.float64]
Cached = TypeVar("Cached")

SAMPLES_PER_PIXEL = {"high": 4, "fast": 0, "gbuffer": 0}
"""Samples per pixel of each profile (multisample anti-aliasing); 0: none."""

NUM_COLOR_BUFFERS = {"high": 1, "fast": 1, "gbuffer": 3}
"""Number of images that each profile draws at once: surface.frag has the outputs of a G-buffer."""

MAX_CACHED_BUFFERS = 8
"""Number of courses, and of framebuffers, that are kept; the least recently used is freed first."""

SMALL_BALL_RADIUS = 4.0
"""Radius below which the ball is drawn with fewer triangles, pixels."""

NO_BALL_POSITION = np.array([0.0, 0.0, -1e3])
"""Position of the ball in an image without one, m: its shadow falls on nothing."""

FLIP_Y = np.diag([1.0, -1.0, 1.0, 1.0])
"""Matrix that turns an image upside down."""


class Renderer:
    """Draws into framebuffers that it owns, in the context that is current when its methods are called.

    Programs, course buffers and framebuffers are made when first used and cached, the latter two up to
    MAX_CACHED_BUFFERS.
    """

    def __init__(self) -> None:
        self._max_size = int(GL.glGetIntegerv(GL.GL_MAX_RENDERBUFFER_SIZE))
        self._profile = "high"
        """The profile of the image that is being drawn."""
        self._programs: dict[tuple[str, str], Program] = {}
        self._courses: OrderedDict[Course, CourseBuffers] = OrderedDict()
        self._framebuffers: OrderedDict[tuple[tuple[int, int], int, int], Framebuffer] = OrderedDict()
        # The buffer of the uniform block FrameUniforms.
        self._uniform_buffer = GL.glGenBuffers(1)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._uniform_buffer)
        GL.glBufferData(GL.GL_UNIFORM_BUFFER, FRAME_UNIFORMS_DTYPE.itemsize, None, GL.GL_DYNAMIC_DRAW)
        # Textures.
        felt = create_texture(textures.felt_texture())
        wood = create_texture(textures.wood_texture())
        stone = create_texture(textures.stone_texture())
        self._detail_textures = {
            "felt": felt,
            "lawn": felt,
            "wood": wood,
            "stone": stone,
            "brick": stone,
            "water": stone,
        }
        self._dimples = create_cube_map(textures.ball_texture())
        # Meshes.
        self._ball = MeshBuffer(*props.sphere(16, 32))
        self._small_ball = MeshBuffer(*props.sphere(6, 12))
        self._marker = MeshBuffer(*props.marker())
        self._pole = MeshBuffer(*props.pole())
        self._cloth = MeshBuffer(*props.cloth(props.CLOTH_DIRECTION))
        self._lines = LineStrips()

    def draw(
        self,
        course: Course,
        camera: Camera,
        state: SceneState | None,
        size: tuple[int, int],
        profile: str,
        rect: PixelRect | None = None,
    ) -> Framebuffer:
        """Draw an image of (width, height) pixels, or a rectangle of it; return the framebuffer that has it.

        Args:
            course: the course.
            camera: the camera.
            state: poses of ball, flag and lines; None: the course with its flag and no ball.
            size: width and height, pixels.
            profile: "high", "fast", or "gbuffer" for ``draw_gbuffer``.
            rect: the rectangle to draw; None: the whole image.

        Raises:
            RenderingError: the size is beyond the driver's limit.
        """
        self._profile = profile
        buffers = self._cached(self._courses, course, lambda: CourseBuffers(course, self._program("depth")))
        framebuffer = self._framebuffer(size)
        rect = rect or PixelRect(0, 0, *size)
        clip = FLIP_Y @ camera.clip_from_world(size[0] / size[1])
        edges = _clip_edges(rect, size)
        # Upload the uniforms, clear the rectangle and bind the shadow maps.
        self._upload_uniforms(course, buffers, clip, camera, state)
        self._clear(framebuffer, rect)
        self._bind_textures(buffers)
        # Draw the visible chunks of the course, material by material, and the lawn.
        for (material, color), runs in buffers.visible_runs(clip, edges):
            self._use_material(material, color=color)
            buffers.draw(runs)
        self._use_material("lawn")
        buffers.lawn.draw()
        # Draw what moves: flag, ball and lines.
        flag = props.flag_rest_position(course) if state is None else state.flag
        if course.cup is not None and self._is_flag_visible(flag, clip, edges):
            self._draw_flag(flag)
        if state is not None:
            if state.marker_radius:
                self._draw_marker(camera, state)
            else:
                self._draw_ball(course, camera, state, clip, size[1])
            if state.lines:
                self._program("line").use()
                self._lines.draw(state.lines)
        # Average the samples of each pixel.
        GL.glDisable(GL.GL_SCISSOR_TEST)
        framebuffer.resolve()
        return framebuffer

    def draw_gbuffer(self, course: Course, camera: Camera, size: tuple[int, int]) -> GBuffer:
        """Return the G-buffer of a course with its flag and no ball, in the profile "fast".

        Raises:
            RenderingError: the size is beyond the driver's limit.
        """
        framebuffer = self.draw(course, camera, None, size, "gbuffer")
        near, far = camera.clipping_planes()
        distance = near * far / (far - framebuffer.read_depth().astype(np.float64) * (far - near))
        return GBuffer(
            framebuffer.read(),
            framebuffer.read(color=1, channels=4),
            framebuffer.read(color=2),
            distance.astype(np.float32),
        )

    def _upload_uniforms(
        self, course: Course, buffers: CourseBuffers, clip: FloatArray, camera: Camera, state: SceneState | None
    ) -> None:
        """Set the uniform block of the frame."""
        uniforms = buffers.uniforms
        uniforms["clip_from_world"] = clip.T
        uniforms["eye"][:3] = camera.eye
        uniforms["ball"][:3] = NO_BALL_POSITION if state is None else state.ball
        uniforms["ball"][3] = course.ball_radius if state is None else state.drawn_radius(course.ball_radius)
        uniforms["flag"][:3] = props.flag_rest_position(course) if state is None else state.flag
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._uniform_buffer)
        GL.glBufferSubData(GL.GL_UNIFORM_BUFFER, 0, uniforms.nbytes, uniforms)
        GL.glBindBufferBase(GL.GL_UNIFORM_BUFFER, FRAME_UNIFORMS_BINDING, self._uniform_buffer)

    def _clear(self, framebuffer: Framebuffer, rect: PixelRect) -> None:
        """Bind a framebuffer, restrict drawing to a rectangle of it, and clear that."""
        framebuffer.bind()
        GL.glViewport(0, 0, *framebuffer.size)
        reset_gl_state()
        GL.glEnable(GL.GL_SCISSOR_TEST)
        GL.glScissor(rect.left, rect.top, rect.right - rect.left, rect.bottom - rect.top)
        GL.glFrontFace(GL.GL_CW)  # The image is upside down.
        GL.glClearColor(*props.SKY_COLOR, 1.0)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)

    def _bind_textures(self, buffers: CourseBuffers) -> None:
        """Bind the shadow maps and the dimples; the unit of the material's detail texture stays the active one."""
        for sampler, target, texture in (
            ("sun_map", GL.GL_TEXTURE_2D, buffers.sun_map.texture),
            ("sky_map", GL.GL_TEXTURE_2D, buffers.sky_map.texture),
            ("dimples", GL.GL_TEXTURE_CUBE_MAP, self._dimples),
        ):
            GL.glActiveTexture(GL.GL_TEXTURE0 + TEXTURE_UNITS.index(sampler))
            GL.glBindTexture(target, texture)
        GL.glActiveTexture(GL.GL_TEXTURE0 + TEXTURE_UNITS.index("detail"))

    def _use_material(
        self, material: str, model: FloatArray | None = None, color: tuple[float, float, float] | None = None
    ) -> None:
        """Use the program, the model matrix, the tint and the texture of a material for the next draw calls."""
        program = self._program(material)
        program.use()
        if model is not None:
            program.set_model_matrix(model)
        program.set_tint(color)
        if material in self._detail_textures:
            GL.glBindTexture(GL.GL_TEXTURE_2D, self._detail_textures[material])

    def _is_flag_visible(self, foot: FloatArray, clip: FloatArray, edges: FloatArray) -> bool:
        """Return whether a flag at a foot (3,) may be visible between edges (2, 2) of the image."""
        half_extent = np.array([props.CLOTH_LENGTH, props.CLOTH_LENGTH, 0.5 * props.POLE_HEIGHT])
        lower, upper = project_aabbs((foot + UP_DIRECTION * half_extent)[None], half_extent[None], clip)
        return bool((upper >= edges[0]).all() and (lower <= edges[1]).all())

    def _draw_flag(self, foot: FloatArray) -> None:
        """Draw pole and cloth; the cloth has two sides."""
        model = _model_matrix(foot, 1.0)
        self._use_material("pole", model)
        self._pole.draw()
        GL.glDisable(GL.GL_CULL_FACE)
        self._use_material("cloth", model)
        self._cloth.draw()
        GL.glEnable(GL.GL_CULL_FACE)

    def _draw_ball(self, course: Course, camera: Camera, state: SceneState, clip: FloatArray, height: int) -> None:
        """Draw the ball, and a translucent ghost of it where something hides it."""
        model = _model_matrix(state.ball, course.ball_radius, state.rotation)
        distance = float(clip[3] @ np.append(state.ball, 1.0))
        pixel_radius = course.ball_radius * camera.pixels_per_metre(distance, height)
        mesh = self._small_ball if pixel_radius < SMALL_BALL_RADIUS else self._ball
        self._use_material("ball", model)
        mesh.draw()
        self._use_material("ghost", model)
        with alpha_blending():
            GL.glDepthFunc(GL.GL_GREATER)
            mesh.draw()
            GL.glDepthFunc(GL.GL_LESS)

    def _draw_marker(self, camera: Camera, state: SceneState) -> None:
        """Draw the marker, a disc that faces the camera, and a translucent ghost of it where something hides it."""
        right, up, forward = camera.axes()
        model = _model_matrix(state.ball, state.marker_radius, np.stack([right, up, -forward], axis=-1))
        with alpha_blending():
            for material, depth_test in (("marker", GL.GL_LESS), ("marker_ghost", GL.GL_GREATER)):
                self._use_material(material, model)
                GL.glDepthFunc(depth_test)
                self._marker.draw()
            GL.glDepthFunc(GL.GL_LESS)

    def _program(self, name: str) -> Program:
        """Return a program in the present profile; it is compiled at the first call."""
        key = name, self._profile if name in MATERIAL_NAMES else "high"  # Other programs are the same in all profiles.
        if key not in self._programs:
            self._programs[key] = Program(*key)
        return self._programs[key]

    def _framebuffer(self, size: tuple[int, int]) -> Framebuffer:
        """Return the framebuffer of a size and the present profile; RenderingError: the driver does not support it."""
        if max(size) > self._max_size:
            raise RenderingError(
                f"render_size: expected at most {self._max_size} pixels per side, the limit of the OpenGL driver, "
                f"received {size}."
            )
        key = size, SAMPLES_PER_PIXEL[self._profile], NUM_COLOR_BUFFERS[self._profile]
        return self._cached(self._framebuffers, key, lambda: Framebuffer(*key))

    def _cached(self, cache: OrderedDict[Any, Cached], key: Hashable, make: Callable[[], Cached]) -> Cached:
        """Return the cached value of a key, or make it and free the least recently used."""
        if key not in cache:
            cache[key] = make()
            if len(cache) > MAX_CACHED_BUFFERS:
                cache.popitem(last=False)[1].delete()  # type: ignore[attr-defined]
        cache.move_to_end(key)
        return cache[key]


def driver_name() -> str:
    """Return the name of the OpenGL driver's renderer."""
    name = GL.glGetString(GL.GL_RENDERER)
    return name.decode(errors="replace") if name else ""


def _clip_edges(rect: PixelRect, size: tuple[int, int]) -> FloatArray:
    """Return the lower and upper edges (2, 2) of a rectangle of an image in x and y, -1 to 1."""
    pixels = np.array([[rect.left, rect.top], [rect.right, rect.bottom]])
    return np.asarray(2.0 * pixels / size - 1.0)


def _model_matrix(position: FloatArray, scale: float, rotation: FloatArray | None = None) -> FloatArray:
    """Return the matrix (4, 4) that rotates, scales and moves a mesh."""
    model = np.eye(4)
    model[:3, :3] = scale * (np.eye(3) if rotation is None else rotation)
    model[:3, 3] = position
    return model
