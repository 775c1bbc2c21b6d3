"""The observation "pixels": the kernel that draws the ball into kept views agrees with the renderer."""

from __future__ import annotations

import dataclasses
import gc
import subprocess
import sys
from collections.abc import Iterator

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.courses import Course, list_courses, load_course
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.observations import pixels
from minigolf_env.envs.observations.compositing import composite_range
from minigolf_env.envs.observations.pixels import (
    IMAGE_SIZE,
    MAX_CACHED_VIEWS,
    STROKES_BAR_HEIGHT,
    marker_view,
    observe_pixels,
    top_view,
)
from minigolf_env.envs.rules import NUM_STATE_FEATURES
from minigolf_env.envs.task import Task, TaskBatch
from minigolf_env.rendering import RenderingError, SceneState, flag_rest_position
from minigolf_env.rendering.gl import offscreen
from minigolf_env.rendering.lighting import LIGHTING

pytestmark = pytest.mark.usefixtures("gl")

NUM_POSITIONS = 20
"""Number of positions of the ball on each course."""

MAX_DIFFERENCE = 4
"""Greatest difference of a channel from the renderer's, of 255. Rounding gives 2, the documentation promises 8."""

MAX_MEAN_DIFFERENCE = 0.1
"""Mean difference allowed, of 255."""

LEVELS_PER_TEST = 10
"""Number of levels of one test."""

MATERIALS = ("felt", "wood", "stone", "wall", "cup", "brick", "paint", "water")

STATE = np.empty((0, NUM_STATE_FEATURES), np.float32)
"""Features "state", which images do not show."""


@pytest.fixture
def restored_num_threads() -> Iterator[None]:
    """Restore numba's number of threads."""
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


def make_task(course: str) -> Task:
    """Return the task of a course."""
    return MiniGolfEnv(course, observation="pixels").task


def sample_positions(course: Course, rng: np.random.Generator) -> FloatArray:
    """Return positions (20, 3) of a ball: in and at the cup, on the ground and under roofs, in the air, outside."""
    vertices = np.concatenate([part.mesh.vertices for part in course.parts])
    upper = vertices.max(axis=0) + np.array([0.0, 0.0, 0.3])
    balls = rng.uniform(vertices.min(axis=0), upper, (NUM_POSITIONS, 3))
    balls[:14, 2] = course.tee.height + course.ball_radius
    assert course.cup is not None
    balls[0] = np.add(course.cup.position, [0.0, 0.0, course.ball_radius - course.cup.depth])
    balls[1] = np.add(course.cup.position, [course.cup.radius, 0.0, course.ball_radius])
    balls[2] = course.bounds[0]
    balls[-2:, 2] += [0.7, 1.4]  # The shadow is further away than the reach of the ambient occlusion.
    return balls


def composite(course: Course, balls: FloatArray) -> NDArray[np.uint8]:
    """Return the kernel's images (N, 84, 84, 3) of balls (N, 3), m."""
    images = np.empty((len(balls), IMAGE_SIZE, IMAGE_SIZE, 3), np.uint8)
    composite_range(0, len(balls), top_view(course), LIGHTING, balls, images)
    return images


def render(course: Course, balls: FloatArray) -> NDArray[np.uint8]:
    """Return the renderer's images (N, 84, 84, 3) of balls (N, 3), m."""
    camera, radius = marker_view(course)
    states = [SceneState(ball, np.eye(3), flag_rest_position(course), marker_radius=radius) for ball in balls]
    return np.stack([offscreen.draw(course, camera, state, (IMAGE_SIZE, IMAGE_SIZE), "fast") for state in states])


def check_agreement(course: Course, seed: int = 0) -> None:
    """Compare the kernel's images of a course with the renderer's."""
    balls = sample_positions(course, np.random.default_rng(seed))
    differences = np.abs(composite(course, balls).astype(int) - render(course, balls))
    worst = differences.max(axis=(1, 2, 3))
    assert worst.max() <= MAX_DIFFERENCE, f"{course.name}: {worst.max()} with the ball at {balls[worst.argmax()]}"
    assert differences.mean() < MAX_MEAN_DIFFERENCE


@pytest.mark.parametrize("name", list_courses())
def test_images_of_bundled_holes_agree_with_the_renderer(name: str) -> None:
    """Cases: in the cup, at its rim, on the ground, under roofs, in walls and in the air."""
    check_agreement(load_course(name))


@pytest.mark.parametrize("first", range(0, 100, LEVELS_PER_TEST))
def test_images_of_levels_agree_with_the_renderer(first: int) -> None:
    """100 levels of all difficulties."""
    for level in range(first, first + LEVELS_PER_TEST):
        difficulty = ("easy", "medium", "hard")[level % 3]
        check_agreement(load_course(f"procedural-v1-{difficulty}-{level}"), level)


@pytest.mark.parametrize("material", MATERIALS)
def test_images_of_bright_surfaces_agree_with_the_renderer(material: str) -> None:
    """Surfaces that are overexposed in the sun have colour in the ball's shadow."""
    course = load_course("islands")
    parts = [dataclasses.replace(part, material=material, color=(1.0, 1.0, 1.0)) for part in course.parts]
    check_agreement(dataclasses.replace(course, parts=tuple(parts)))


def test_image_without_the_ball_has_the_renderers_bits() -> None:
    """Pixels that the ball does not change are those of the profile "fast"."""
    course = load_course("dogleg")
    camera, _ = marker_view(course)
    renderer = offscreen.get_offscreen_renderer()
    with renderer.context.current():
        image = renderer.renderer().draw(course, camera, None, (IMAGE_SIZE, IMAGE_SIZE), "fast").read()
    np.testing.assert_array_equal(top_view(course).color, image)
    above_the_camera = np.array([[1.0, 0.5, camera.eye[2] + 0.1]])
    np.testing.assert_array_equal(composite(course, above_the_camera)[0], image)


def test_marker_is_a_white_disc_at_the_ball() -> None:
    """On open ground the disc is 2.5 pixels in radius; the ground away from the sun is darker."""
    course = load_course("dogleg")
    view = top_view(course)
    row, column = 60, 30
    distance = view.eye_z - course.tee.height - course.ball_radius
    offset = (np.array([column, row]) - 0.5 * IMAGE_SIZE) * distance / view.focal_length
    ball = np.array([[view.eye_x + offset[0], view.eye_y - offset[1], view.eye_z - distance]])
    image = composite(course, ball)[0].astype(float)
    assert (image[row - 1 : row + 1, column - 1 : column + 1] > 215.0).all()
    is_white = (image - view.color).min(axis=2) > 20.0
    assert abs(is_white.sum() - np.pi * 2.5**2) < 5.0
    mean_row, mean_column = np.argwhere(is_white).mean(axis=0) + 0.5
    assert abs(mean_row - row) < 0.6 and abs(mean_column - column) < 0.6
    darkening = (view.color - image).mean(axis=2)
    assert darkening[row - 3, column + 1] > 20.0 and abs(darkening[row + 3, column - 2]) < 2.0


def test_ball_under_a_roof_is_a_ghost_and_casts_no_shadow_on_it() -> None:
    """Under the middle of the tunnel's roof the roof is lighter in the disc of the marker, and the same elsewhere."""
    course = load_course("tunnel")
    view = top_view(course)
    height = view.eye_z - view.distance
    is_roof = (height > 0.1) & (view.normal[..., 2] > 200)
    row, column = np.argwhere(is_roof).mean(axis=0).round().astype(int)
    assert is_roof[row - 4 : row + 5, column - 4 : column + 5].all(), "the roof is wider than the marker"
    distance = view.eye_z - course.tee.height - course.ball_radius
    offset = (np.array([column, row]) + 0.5 - 0.5 * IMAGE_SIZE) * distance / view.focal_length
    ball = np.array([[view.eye_x + offset[0], view.eye_y - offset[1], view.eye_z - distance]])
    before = view.color.astype(float)
    after = composite(course, ball)[0].astype(float)
    lighter = 0.7 * before + 0.3 * 255.0
    assert np.abs(after[row, column] - lighter[row, column]).max() < 1.0
    assert (after[is_roof] >= before[is_roof]).all()
    assert 15 < (after > before)[is_roof].all(axis=1).sum() < 35


def test_images_do_not_depend_on_batch_and_threads(restored_num_threads: None) -> None:
    """Balls on one hole, and on a hole each, have the bits of single ones, with any number of threads."""
    names = ["dogleg", "tunnel", "volcano", "islands"] * 10
    tasks = [make_task(name) for name in names]
    rng = np.random.default_rng(0)
    for batch in (tasks[0], TaskBatch(tasks)):
        balls = np.concatenate([sample_positions(tasks[0].course, rng) for _ in range(2)])
        strokes = rng.integers(0, 10, len(balls))
        images = []
        for num_threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
            numba.set_num_threads(num_threads)
            images.append(observe_pixels(batch, balls, strokes, STATE))
        singles = [batch.tasks[i % len(batch.tasks)] for i in range(len(balls))]
        for i, single in enumerate(singles):
            images_of_one = observe_pixels(single, balls[i : i + 1], strokes[i : i + 1], STATE)
            np.testing.assert_array_equal(images_of_one[0], images[0][i])
        np.testing.assert_array_equal(images[0], images[1])
        assert (images[0][:, :-STROKES_BAR_HEIGHT].reshape(len(balls), -1).std(axis=0) > 0).any()


def test_batches_of_more_courses_than_a_call_holds_are_complete(monkeypatch: pytest.MonkeyPatch) -> None:
    """A batch is drawn in parts; each image is on its own course."""
    batch = TaskBatch([make_task(name) for name in ("dogleg", "tunnel", "volcano")])
    balls = np.tile([0.5, 0.5, 0.02], (6, 1))
    expected = observe_pixels(batch, balls, np.zeros(6, np.int64), STATE)
    monkeypatch.setattr(pixels, "MAX_VIEWS_PER_CALL", 2)
    np.testing.assert_array_equal(observe_pixels(batch, balls, np.zeros(6, np.int64), STATE), expected)


def test_course_is_drawn_once_while_it_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """The renderer draws a course at its first image; the least recently used is drawn again, to the same bits."""
    drawn: list[Course] = []
    draw_gbuffer = offscreen.draw_gbuffer

    def counted(course: Course, *arguments: object) -> object:
        drawn.append(course)
        return draw_gbuffer(course, *arguments)

    monkeypatch.setattr(offscreen, "draw_gbuffer", counted)
    monkeypatch.setattr(pixels, "_views", type(pixels._views)())
    monkeypatch.setattr(pixels, "MAX_CACHED_VIEWS", 2)
    a, b, c = (dataclasses.replace(load_course(name)) for name in ("dogleg", "tunnel", "bank"))
    first = top_view(a)
    for course in (b, a, a, c, a, b):
        top_view(course)
    assert drawn == [a, b, c, b] and len(pixels._views) == 2
    top_view(c)
    again = top_view(a)
    assert drawn[-2:] == [c, a] and again is not first
    for before, after in zip(first, again, strict=True):
        np.testing.assert_array_equal(before, after)


def test_kept_views_take_at_most_128_mb_and_no_course(monkeypatch: pytest.MonkeyPatch) -> None:
    """A view is dropped with its course, whose meshes it does not keep."""
    view = top_view(load_course("dogleg"))
    size = sum(array.nbytes for array in view if isinstance(array, np.ndarray))
    assert MAX_CACHED_VIEWS * size < 2**27
    monkeypatch.setattr(pixels, "_views", type(pixels._views)())
    monkeypatch.setattr(pixels, "_draw_top_view", lambda _: view)  # The renderer's own caches keep some courses.
    course = dataclasses.replace(load_course("dogleg"))
    top_view(course)
    assert len(pixels._views) == 1
    del course
    gc.collect()
    assert len(pixels._views) == 0


def test_forked_child_observes_the_courses_that_its_parent_has_drawn() -> None:
    """OpenGL does not survive a fork; images of another course are an error that says so."""
    code = """
import os
import numpy as np
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.rendering import RenderingError

env = MiniGolfEnv(observation="pixels")
before, _ = env.reset(seed=0)
if os.fork() == 0:
    assert (env.reset(seed=0)[0] == before).all()
    try:
        MiniGolfEnv("tunnel", observation="pixels").reset(seed=0)
    except RenderingError as error:
        os._exit(7 if "fork" in str(error) else 1)
    os._exit(2)
print(os.waitstatus_to_exitcode(os.wait()[1]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "7\n"


def test_without_opengl_the_first_image_is_a_rendering_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is kept of a course that could not be drawn: with OpenGL it is drawn."""
    task = dataclasses.replace(make_task("dogleg"), course=dataclasses.replace(load_course("dogleg")))
    arguments = np.array([[0.5, 0.5, 0.02]]), np.zeros(1, np.int64), STATE

    def fail() -> None:
        raise RenderingError("no EGL display can draw")

    with monkeypatch.context() as broken:
        broken.setattr(offscreen, "get_offscreen_renderer", fail)
        with pytest.raises(RenderingError, match="EGL"):
            observe_pixels(task, *arguments)
    assert observe_pixels(task, *arguments).shape == (1, IMAGE_SIZE, IMAGE_SIZE, 3)
