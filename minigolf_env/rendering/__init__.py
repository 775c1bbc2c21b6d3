"""Pictures of a course and what happens on it. Importing this loads no OpenGL; the first picture does."""

from minigolf_env.rendering.camera import CAMERAS, Camera
from minigolf_env.rendering.dirty_rect import flag_at_rest
from minigolf_env.rendering.episode_renderer import FPS, PROFILES, RENDER_MODES, Screen, Settings, Stage, check_size
from minigolf_env.rendering.errors import RenderingError
from minigolf_env.rendering.replay import PAUSE, picture_count, still
from minigolf_env.rendering.scene_state import Frame, Line
from minigolf_env.rendering.tiles import tile

__all__ = [
    "CAMERAS",
    "FPS",
    "PAUSE",
    "PROFILES",
    "RENDER_MODES",
    "Camera",
    "Frame",
    "Line",
    "RenderingError",
    "Screen",
    "Settings",
    "Stage",
    "check_size",
    "flag_at_rest",
    "picture_count",
    "still",
    "tile",
]
