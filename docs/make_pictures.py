"""Draws the pictures of the documentation: ``python -m docs.make_pictures``."""

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

PICTURES = Path(__file__).parent / "pictures"
SIZE = (960, 540)


def hole_in_one(moment: float) -> Image.Image:
    """Return the dogleg at a moment (s) of search's hole-in-one from a tee, with the whole way of the ball."""
    env = MiniGolfEnv("dogleg")
    env.reset(seed=1)
    start = np.array(env.get_state()["position"])
    path, times = env.task.simulate_path(start, env.task.launch_velocity(search(env).action.astype(np.float64)))
    film = Replay(env.task.course, path, times, "follow", SIZE[0] / SIZE[1])
    camera, state = film.view(moment)
    return Image.fromarray(draw(env.task.course, camera, state._replace(lines=(film.path_line(400),)), SIZE))


def levels(numbers: range, size: tuple[int, int] = (300, 225)) -> Image.Image:
    """Return levels of each difficulty, a row each, in pictures of a size (pixels)."""
    sheet = Image.new("RGB", (len(numbers) * size[0], len(DIFFICULTY_NAMES) * size[1]))
    for row, difficulty in enumerate(DIFFICULTY_NAMES):
        for column, number in enumerate(numbers):
            shot = render_course(load_course(level_name(difficulty, number)), "orbit", size)
            sheet.paste(Image.fromarray(shot), (column * size[0], row * size[1]))
    return sheet


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    hole_in_one(1.75).save(PICTURES / "dogleg.jpg", quality=90)
    levels(range(4)).save(PICTURES / "levels.jpg", quality=88)
