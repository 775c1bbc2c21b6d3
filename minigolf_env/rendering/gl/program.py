"""Shader programs. Each function works in the context that is current."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.lighting import LIGHTING
from minigolf_env.rendering.props import POLE_RADIUS, SKY_COLOR

MATERIAL_NAMES = (
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
    "marker",
    "marker_ghost",
)
"""Materials of surface.frag; each is compiled into a separate program."""

FRAME_UNIFORMS_BINDING = 5
"""Binding point of the uniform block FrameUniforms of common.glsl; pyglet uses the points from 0 on."""

SHADER_CONSTANTS = {
    "POLE_RADIUS": str(POLE_RADIUS),
    "SKY_COLOR": f"vec3{SKY_COLOR}",
    **{
        name.upper(): f"vec3{value}" if isinstance(value, tuple) else str(value)
        for name, value in LIGHTING._asdict().items()
    },
}
"""Constants that shaders and Python share, as GLSL expressions."""

PROFILE_FLAGS = {"high": (), "fast": ("FAST",), "gbuffer": ("FAST", "GBUFFER")}
"""Names that are #defined for each profile."""

TEXTURE_UNITS = ("sun_map", "sky_map", "detail", "dimples")
"""Samplers of surface.frag; each is bound to the texture unit of its position."""


class Program:
    """A linked shader program.

    Args:
        name: "depth", "line", or one of MATERIAL_NAMES.
        profile: "high"; "fast": no specular reflections and no shadow map of the sky; "gbuffer": as "fast", with the
            outputs of a G-buffer.

    Raises:
        RenderingError: the driver does not compile or link the program.
    """

    def __init__(self, name: str, profile: str = "high") -> None:
        self.id = _build_program(name, profile)
        # Bind the uniform block and the samplers; set the other uniforms to their defaults.
        GL.glUseProgram(self.id)
        block = GL.glGetUniformBlockIndex(self.id, "FrameUniforms")
        if block != GL.GL_INVALID_INDEX:
            GL.glUniformBlockBinding(self.id, block, FRAME_UNIFORMS_BINDING)
        self._model_location = GL.glGetUniformLocation(self.id, "model")
        self._tint_location = GL.glGetUniformLocation(self.id, "tint")
        self.set_model_matrix(np.eye(4))
        self.set_tint(None)
        for unit, sampler in enumerate(TEXTURE_UNITS):
            GL.glUniform1i(GL.glGetUniformLocation(self.id, sampler), unit)

    def use(self) -> None:
        """Make this the program of the next draw calls."""
        GL.glUseProgram(self.id)

    def set_model_matrix(self, model: NDArray[np.float64]) -> None:
        """Set the matrix (4, 4) from model to world coordinates; the program is in use."""
        GL.glUniformMatrix4fv(self._model_location, 1, GL.GL_TRUE, model.astype(np.float32))

    def set_tint(self, color: tuple[float, float, float] | None) -> None:
        """Set the sRGB colour that tints the material, or None for its own colour; the program is in use."""
        if self._tint_location >= 0:
            GL.glUniform4f(self._tint_location, *((*color, 1.0) if color is not None else (0.0, 0.0, 0.0, 0.0)))


def _build_program(name: str, profile: str) -> int:
    """Return the OpenGL id of a compiled and linked program; arguments and errors as for ``Program``."""
    # One #define for each shared constant and each material, for the profile, and for the material of this program.
    stem = "surface" if name in MATERIAL_NAMES else name
    defines = "".join(f"#define {constant} {value}\n" for constant, value in SHADER_CONSTANTS.items())
    defines += "".join(f"#define {material.upper()} {k}\n" for k, material in enumerate(MATERIAL_NAMES))
    defines += "".join(f"#define {flag}\n" for flag in PROFILE_FLAGS[profile])
    defines += f"#define MATERIAL {name.upper()}\n" if name in MATERIAL_NAMES else ""
    # Compile both shaders.
    program: int = GL.glCreateProgram()
    for kind, suffix in ((GL.GL_VERTEX_SHADER, "vert"), (GL.GL_FRAGMENT_SHADER, "frag")):
        shader = GL.glCreateShader(kind)
        GL.glShaderSource(shader, read_shader("common.glsl") + defines + read_shader(f"{stem}.{suffix}"))
        GL.glCompileShader(shader)
        if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
            log = GL.glGetShaderInfoLog(shader).decode(errors="replace")
            raise RenderingError(f"rendering: the OpenGL driver does not compile {stem}.{suffix} ({name}): {log}")
        GL.glAttachShader(program, shader)
        GL.glDeleteShader(shader)
    # Link them.
    GL.glLinkProgram(program)
    if not GL.glGetProgramiv(program, GL.GL_LINK_STATUS):
        log = GL.glGetProgramInfoLog(program).decode(errors="replace")
        raise RenderingError(f"rendering: the OpenGL driver does not link {name}: {log}")
    return program


def read_shader(name: str) -> str:
    """Return the source of a shader."""
    return (files("minigolf_env.rendering.gl") / "shaders" / name).read_text(encoding="utf-8")
