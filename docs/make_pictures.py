"""Draw the images of the documentation: ``python -m docs.make_pictures``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from minigolf_env.apps.gallery import render_course
from minigolf_env.courses import load_course
from minigolf_env.courses.procedural import DIFFICULTY_NAMES, level_name
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.players.search import search
from minigolf_env.rendering.gl.offscreen import draw
from minigolf_env.rendering.replay import Replay

IMAGE_FOLDER = Path(__file__).parent / "pictures"
"""Folder of the images."""
IMAGE_SIZE = (960, 540)
"""Width and height of the image of a hole-in-one, pixels."""


def draw_hole_in_one(time: float) -> Image.Image:
    """Return the dogleg at a time (s) of a hole-in-one found by search, with the whole path of the ball."""
    env = MiniGolfEnv("dogleg")
    env.reset(seed=1)
    start = np.array(env.get_state()["position"])
    path, times = env.task.simulate_path(start, env.task.launch_velocity(search(env).action.astype(np.float64)))
    replay = Replay(env.task.course, path, times, "follow", IMAGE_SIZE[0] / IMAGE_SIZE[1])
    camera, state = replay.view(time)
    return Image.fromarray(draw(env.task.course, camera, state._replace(lines=(replay.path_line(400),)), IMAGE_SIZE))


def draw_levels(numbers: range, size: tuple[int, int] = (300, 225)) -> Image.Image:
    """Return images of levels in a grid: one row for each difficulty, one column for each number; size in pixels."""
    grid = Image.new("RGB", (len(numbers) * size[0], len(DIFFICULTY_NAMES) * size[1]))
    for row, difficulty in enumerate(DIFFICULTY_NAMES):
        for column, number in enumerate(numbers):
            image = render_course(load_course(level_name(difficulty, number)), "orbit", size)
            grid.paste(Image.fromarray(image), (column * size[0], row * size[1]))
    return grid


if __name__ == "__main__":
    IMAGE_FOLDER.mkdir(exist_ok=True)
    draw_hole_in_one(1.75).save(IMAGE_FOLDER / "dogleg.jpg", quality=90)
    draw_levels(range(4)).save(IMAGE_FOLDER / "levels.jpg", quality=88)
