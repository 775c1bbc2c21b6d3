"""Rendering of courses and putts. Importing this package loads no OpenGL; the first image does."""

from minigolf_env.rendering.camera import CAMERA_NAMES, Camera
from minigolf_env.rendering.episode_renderer import EpisodeRenderer, PuttScene
from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.image import Image, check_size, tile, tile_sequences
from minigolf_env.rendering.props import flag_rest_position
from minigolf_env.rendering.replay import PAUSE_AFTER_PUTT, frame_count, static_view
from minigolf_env.rendering.scene_state import Line, SceneState
from minigolf_env.rendering.settings import RENDER_FPS, RENDER_MODES, RENDER_PROFILES, RenderSettings

__all__ = [
    "CAMERA_NAMES",
    "PAUSE_AFTER_PUTT",
    "RENDER_FPS",
    "RENDER_MODES",
    "RENDER_PROFILES",
    "Camera",
    "EpisodeRenderer",
    "Image",
    "Line",
    "PuttScene",
    "RenderSettings",
    "RenderingError",
    "SceneState",
    "check_size",
    "flag_rest_position",
    "frame_count",
    "static_view",
    "tile",
    "tile_sequences",
]
