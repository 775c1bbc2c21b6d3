"""Rendered images: equal bits in all circumstances, and everything visible in them."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import hashlib
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from minigolf_env.courses import load_course
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.rendering import Image, Line, RenderingError, SceneState, flag_rest_position
from minigolf_env.rendering.camera import Camera, make_camera
from minigolf_env.rendering.gl import context as gl_context
from minigolf_env.rendering.gl.offscreen import OffscreenRenderer, draw, get_offscreen_renderer
from minigolf_env.rendering.replay import flag_position

pytestmark = pytest.mark.usefixtures("gl")

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests" / "data" / "pictures"
SIZE = (240, 180)
CLOSE_UPS = {"close": ((3.2, 1.9), (3.1, 1.75, 0.12)), "cup": ((3.35, 2.0), (3.2, 1.7, 0.35))}
"""Position (2,) of the ball and of the camera (3,) in the close-ups, m."""
DOGLEG = load_course("dogleg")
MAX_MEAN_DIFFERENCE = 0.75
"""Mean difference (of 255) allowed to other OpenGL drivers; an image without the ball differs by more."""


def make_state(ball: tuple[float, float] = (0.6, 0.4)) -> SceneState:
    """Return a ball on the dogleg's felt, with a trail."""
    position = np.array([*ball, DOGLEG.ball_radius])
    path = np.linspace(position - [0.3, 0.1, 0.019], position - [0, 0, 0.019], 12)
    trail = Line(path, 0.02, (1, 1, 1, 0.1), (1, 1, 1, 0.5))
    return SceneState(position, np.eye(3), flag_position(DOGLEG, position), (trail,))


def draw_dogleg(state: SceneState | None = None, camera: str = "follow", profile: str = "high") -> Image:
    """Return an image of the dogleg."""
    state = make_state() if state is None else state
    return draw(DOGLEG, make_camera(camera, DOGLEG, state.ball, SIZE[0] / SIZE[1]), state, SIZE, profile)


def max_tile_difference(a: Image, b: Image) -> float:
    """Return the largest mean difference of two images over tiles of 12 x 12 pixels."""
    differences = np.abs(a.astype(float) - b).mean(axis=2)
    return float(differences.reshape(SIZE[1] // 12, 12, SIZE[0] // 12, 12).mean(axis=(1, 3)).max())


def run_in_new_process(code: str, **environment: str) -> str:
    """Return the output of a new process that runs ``code`` with the names of this module."""
    names = "from tests.rendering.test_pictures import *; "
    done = subprocess.run(
        [sys.executable, "-c", names + code],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def hash_images(*images: Image) -> str:
    """Return a hash of images."""
    return hashlib.sha256(b"".join(map(bytes, images))).hexdigest()


@pytest.mark.parametrize("profile", ["high", "fast"])
def test_drawing_twice_gives_equal_bits(profile: str) -> None:
    """Drawing another image in between changes no pixel."""
    first = draw_dogleg(profile=profile)
    draw_dogleg(camera="top", profile=profile)
    assert (draw_dogleg(profile=profile) == first).all()


@pytest.mark.parametrize("threads", ["0", "1", "2"])
def test_new_process_with_any_number_of_threads_gives_equal_bits(threads: str) -> None:
    """LP_NUM_THREADS sets the threads of Mesa's software renderer."""
    here = hash_images(draw_dogleg(), draw_dogleg(camera="top", profile="fast"))
    there = run_in_new_process(
        'print(hash_images(draw_dogleg(), draw_dogleg(camera="top", profile="fast")))', LP_NUM_THREADS=threads
    )
    assert there == here


@pytest.mark.parametrize("profile", ["high", "fast"])
@pytest.mark.parametrize("camera", ["top", "tee", "orbit"])
@pytest.mark.parametrize("name", ["dogleg", "room"])
def test_dirty_rectangle_gives_the_bits_of_a_full_redraw(name: str, camera: str, profile: str) -> None:
    """Cases: balls anywhere, in the air and next to the course, the flag in and out of the cup, some with lines."""
    course = load_course(name)
    rng = np.random.default_rng(0)
    size = (96, 72)
    viewpoint = make_camera(camera, course, np.zeros(3), 4 / 3)
    lower, upper = np.array(course.bounds)
    for k in range(8):
        ball = rng.uniform(lower, upper)
        line = Line(rng.uniform(lower, upper, (4, 3)), 0.03, (1, 0, 0, 0.8), (1, 1, 1, 0.3))
        lines = (line,) if k % 3 == 0 else ()
        state = SceneState(ball, np.eye(3), flag_position(course, ball), lines, 0.1 * (k % 2))
        renderer = get_offscreen_renderer()
        with renderer.context.current():
            expected = renderer.renderer().draw(course, viewpoint, state, size, profile).read()
        np.testing.assert_array_equal(draw(course, viewpoint, state, size, profile), expected)


def test_threads_give_equal_bits() -> None:
    """Four threads that draw at the same time get equal images."""
    expected, drawn = draw_dogleg(), []
    threads = [threading.Thread(target=lambda: drawn.append(draw_dogleg())) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(drawn) == 4 and all((image == expected).all() for image in drawn)


def stored_image(name: str) -> Image:
    """Return the stored image of a name, which a person has checked."""
    return np.asarray(PIL.Image.open(GOLDEN / f"dogleg_{name}.png").convert("RGB"))


def draw_like_stored(name: str) -> Image:
    """Return the image that should equal a stored one: a camera's name, "close" (to the ball) or "cup"."""
    if name not in CLOSE_UPS:
        return draw_dogleg(camera=name)
    ball, eye = CLOSE_UPS[name]
    state = make_state(ball)._replace(flag=flag_rest_position(DOGLEG))
    renderer = OffscreenRenderer()
    with renderer.context.current():
        return renderer.draw((DOGLEG, Camera(eye, (*ball, 0.0)), SIZE, "high"), state)


@pytest.mark.parametrize("name", ["follow", "top", "tee", "orbit", "close", "cup"])
def test_images_equal_the_stored_ones(name: str) -> None:
    """Other OpenGL drivers may differ slightly. ``python -m tests.rendering.test_pictures`` stores new images."""
    image = draw_like_stored(name)
    assert np.abs(image.astype(float) - stored_image(name)).mean() < MAX_MEAN_DIFFERENCE
    assert max_tile_difference(image, stored_image(name)) < 4.0 * MAX_MEAN_DIFFERENCE


def test_hidden_ball_has_a_ghost() -> None:
    """A pale disc shows a ball behind the border; a visible ball has none."""
    camera = Camera((-0.6, 0.6, 0.15), (0.3, 0.6, 0.0))
    hidden = make_state((0.03, 0.6))._replace(lines=())
    elsewhere = hidden._replace(ball=hidden.ball + np.array([3.0, 0.0, 0.0]))
    with_ghost = draw(DOGLEG, camera, hidden, SIZE, "high")
    without_ghost = draw(DOGLEG, camera, elsewhere, SIZE, "high")
    changed = np.abs(with_ghost.astype(int) - without_ghost).max(axis=2) > 20
    assert 20 < changed.sum() < 0.02 * changed.size


def draw_without(what: str) -> Image:
    """Return the image from behind the tee with something missing."""
    state = make_state()
    if what == "ball and its shadow":
        return draw_dogleg(state._replace(ball=state.ball - [0, 0, 50.0]), camera="tee")
    if what == "flag":
        return draw_dogleg(state._replace(flag=np.array([0.0, 0.0, -50.0])), camera="tee")
    return draw_dogleg(state._replace(lines=()), camera="tee")


@pytest.mark.parametrize("what", ["ball and its shadow", "flag", "trail"])
def test_comparison_detects_missing_objects(what: str) -> None:
    """Each small object changes the image by more than the comparison allows."""
    assert max_tile_difference(draw_without(what), draw_dogleg(camera="tee")) > 4.0 * MAX_MEAN_DIFFERENCE


@pytest.mark.parametrize(
    ("broken", "name", "change"),
    [
        ("the sun's shadows", "follow", ("direct *= light_share(sun_map", "if (false) direct *= light_share(sun_map")),
        ("the sky's shadows", "cup", ("ambient_share *= mix(0.1", "if (false) ambient_share *= mix(0.1")),
        ("the ball's shadow", "close", ("direct *= sun_past_ball(p)", "direct *= 1.0")),
        (
            "the shade under the ball",
            "close",
            ("ambient_share = 1.0 - OCCLUSION_STRENGTH * occlusion", "ambient_share = 1.0"),
        ),
        ("the dimples", "close", ("* (skin.rgb * 2.0 - 1.0)), 0.8)", "* (skin.rgb * 2.0 - 1.0)), 0.0)")),
        ("the ball's band", "close", ("mix(vec3(0.80, 0.10, 0.06), vec3(0.93), skin.a)", "vec3(0.93)")),
        ("the flag's shadow", "cup", ("direct *= sun_past_flag(p)", "direct *= 1.0")),
        ("the cup's depth", "cup", ("if (cup.w > 0.0) albedo", "if (false) albedo")),
        ("the mown stripes", "top", ("sin(p.x * (PI / 0.22))", "0.0")),
        ("the grain of the wood", "follow", ("float ring = ", "float ring = 0.0 * ")),
        ("the gloss", "close", ("if (gloss > 0.0)", "if (false)")),
    ],
)
def test_comparison_detects_broken_shaders(
    broken: str, name: str, change: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without one of the effects an image differs from the stored one by more than the comparison allows."""
    from minigolf_env.rendering.gl import offscreen, program

    read_shader = program.read_shader

    def altered(file: str) -> str:
        text = read_shader(file)
        assert file != "surface.frag" or change[0] in text, f"surface.frag has changed: {change[0]}"
        return text.replace(*change)

    monkeypatch.setattr(program, "read_shader", altered)
    renderer = OffscreenRenderer()
    monkeypatch.setattr(offscreen, "get_offscreen_renderer", lambda: renderer)
    assert max_tile_difference(draw_like_stored(name), stored_image(name)) > 4.0 * MAX_MEAN_DIFFERENCE, broken


def test_interrupted_image_does_not_disturb_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever drawing stops, the next image is right, also of a course that is drawn for the first time."""
    from minigolf_env.rendering.gl import buffers, renderer

    expected = draw_dogleg(), draw_dogleg(camera="top"), draw_dogleg(camera="top")

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    for owner, method in (
        (buffers.LineStrips, "draw"),
        (buffers.MeshBuffer, "draw"),
        (buffers.Framebuffer, "resolve"),
        (renderer.Renderer, "_draw_flag"),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(owner, method, interrupted)
            with pytest.raises(KeyboardInterrupt):  # A new camera, so that the whole image is drawn.
                draw(DOGLEG, Camera((float(len(method)), -1.0, 1.0), (3.0, 2.0, 0.0)), make_state(), SIZE)
            with contextlib.suppress(KeyboardInterrupt):  # The flag is not in the dirty rectangle.
                draw_dogleg(camera="top")
        course = dataclasses.replace(DOGLEG)
        first_image = draw(course, make_camera("follow", course, make_state().ball, 4 / 3), make_state(), SIZE, "high")
        for image, before in zip(
            (first_image, draw_dogleg(camera="top"), draw_dogleg(camera="top")), expected, strict=True
        ):
            np.testing.assert_array_equal(image, before)


def test_first_images_of_several_threads_are_equal() -> None:
    """In a new process four threads draw the first image at the same time."""
    code = """
import threading
gate, drawn = threading.Barrier(4), []
def act(): gate.wait(); drawn.append(hash_images(draw_dogleg(profile="fast")))
threads = [threading.Thread(target=act) for _ in range(4)]
for t in threads: t.start()
for t in threads: t.join()
print(len(drawn), *set(drawn))
"""
    assert run_in_new_process(f"exec({code!r})") == f"4 {hash_images(draw_dogleg(profile='fast'))}"


def test_skips_egl_displays_that_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """If one EGL display raises, the next is tried; if all do, the message names each."""
    platform_display = gl_context._platform_display

    def failing(platform: int, native: object) -> object:
        if platform == gl_context.PLATFORM_DEVICE:
            raise OSError("bad device")
        return platform_display(platform, native)

    monkeypatch.setattr(gl_context, "_platform_display", failing)
    with gl_context.EGLContext().current():
        pass

    def refuse(self: gl_context.EGLContext, display: object) -> None:
        raise OSError("bad\nconfiguration")

    monkeypatch.setattr(gl_context.EGLContext, "_create_context", refuse)
    with pytest.raises(RenderingError, match=r"device 0: OSError: bad device.*surfaceless: OSError: bad configuration"):
        gl_context.EGLContext()


def test_rejects_sizes_beyond_the_drivers_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message names the argument, and the next image is drawn."""
    with pytest.raises(RenderingError, match="render_size"):
        draw(DOGLEG, make_camera("top", DOGLEG, np.zeros(3), 1.0), make_state(), (100_000, 8))
    assert draw_dogleg().shape == (SIZE[1], SIZE[0], 3)


def test_draws_odd_and_tiny_sizes() -> None:
    """Images of odd sizes, down to one pixel, are drawn."""
    for size in ((1, 1), (3, 7), (101, 33)):
        image = draw(DOGLEG, make_camera("top", DOGLEG, np.zeros(3), 1.0), make_state(), size)
        assert image.shape == (size[1], size[0], 3)


def test_forked_child_raises_instead_of_hanging() -> None:
    """Drawing in a forked child raises an error, since OpenGL does not survive a fork."""
    code = """
draw_dogleg()
import multiprocessing
def child(queue):
    try: draw_dogleg()
    except RenderingError as error: queue.put(str(error))
fork = multiprocessing.get_context("fork"); queue = fork.Queue()
process = fork.Process(target=child, args=(queue,)); process.start(); print(queue.get(timeout=60)); process.join()
"""
    assert "fork" in run_in_new_process(f"exec({code!r})")


def test_opengl_is_not_imported_before_the_first_image() -> None:
    """Neither the import of the package nor make, reset and step load OpenGL."""
    code = (
        "import sys, gymnasium as gym, minigolf_env; env = gym.make('MiniGolf-v0', render_mode='rgb_array'); "
        "env.reset(seed=0); env.step([0.1, 0]); print(*sorted({'OpenGL', 'pyglet'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_message_about_missing_libraries_has_the_remedy() -> None:
    """PyOpenGL raises several kinds of exceptions if libEGL cannot be loaded; all become one message."""
    code = """
import ctypes, ctypes.util, sys
for name in [name for name in sys.modules if name.startswith("OpenGL")]: del sys.modules[name]
load = ctypes.CDLL.__init__
def refuse(self, name, *rest, **more):
    if "EGL" in str(name): raise OSError(f"{name}: cannot open shared object file")
    load(self, name, *rest, **more)
ctypes.CDLL.__init__ = refuse
ctypes.util.find_library = lambda name: None if "EGL" in name else name
try: gl_context.EGLContext()
except RenderingError as error: print(error)
"""
    assert "apt-get install libegl1 libgl1" in run_in_new_process(f"exec({code!r})")


def test_rejects_an_egl_device_that_does_not_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message names the environment variable and its value."""
    monkeypatch.setenv(gl_context.DEVICE_VARIABLE, "99")
    with pytest.raises(RenderingError, match=f"{gl_context.DEVICE_VARIABLE}.*99"):
        gl_context.EGLContext()


def address_of(pointer: Any) -> int | None:
    """Return the address that a pointer has."""
    return ctypes.cast(pointer, ctypes.c_void_p).value


def test_restores_the_context_of_other_opengl_users() -> None:
    """A context that was current before an image is current after it, with its state."""
    from OpenGL import EGL, GL

    other = gl_context.EGLContext()
    with other.current():
        before = address_of(EGL.eglGetCurrentContext())
        GL.glClearColor(0.25, 0.5, 0.75, 1.0)
        draw_dogleg()
        assert address_of(EGL.eglGetCurrentContext()) == before
        np.testing.assert_allclose(GL.glGetFloatv(GL.GL_COLOR_CLEAR_VALUE), [0.25, 0.5, 0.75, 1.0])


if __name__ == "__main__":
    for name in ("follow", "top", "tee", "orbit", *CLOSE_UPS):
        PIL.Image.fromarray(draw_like_stored(name)).save(GOLDEN / f"dogleg_{name}.png")


@pytest.mark.parametrize("end", ["display", "context"])
def test_context_that_another_library_ended_is_made_again(end: str) -> None:
    """After SDL, for one, has ended the display of the process, pictures have the same pixels as before."""
    from OpenGL import EGL

    env = MiniGolfEnv(render_mode="rgb_array", render_size=(160, 120))
    env.reset(seed=0)
    before = [env.render(), env.render()]
    for _ in range(2):
        context: Any = get_offscreen_renderer().context
        if end == "display":
            EGL.eglTerminate(context._display)
        else:
            EGL.eglDestroyContext(context._display, context._context)
        after = [env.render(), env.render()]
        assert all((one == other).all() for one, other in zip(before, after, strict=True))


def test_ended_context_of_another_library_does_not_disturb_pictures() -> None:
    """Another library's context, current in this thread, may have ended with the display: then none is restored."""
    from OpenGL import EGL

    env = MiniGolfEnv(render_mode="rgb_array", render_size=(160, 120))
    env.reset(seed=0)
    before = env.render()
    other = gl_context.EGLContext()
    EGL.eglMakeCurrent(other._display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, other._context)
    EGL.eglTerminate(other._display)
    for _ in range(2):
        assert (env.render() == before).all()


def test_context_that_ends_again_at_once_is_a_rendering_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """One new context is tried, no more."""
    from OpenGL import EGL

    env = MiniGolfEnv(render_mode="rgb_array", render_size=(160, 120))
    env.reset(seed=0)
    env.render()
    monkeypatch.setattr(EGL, "eglMakeCurrent", raise_egl_error)
    with pytest.raises(RenderingError, match=r"the OpenGL context has ended: .*EGL_BAD_DISPLAY"):
        env.render()
    monkeypatch.undo()
    assert env.render().any()


def raise_egl_error(*_: object) -> None:
    """Fail as EGL does after its display was ended."""
    from OpenGL import EGL

    raise EGL.EGLError(err=EGL.EGL_BAD_DISPLAY)


@pytest.mark.parametrize("platform", ["osmesa", "glx", "nonsense"])
def test_other_platform_of_pyopengl_is_named(platform: str) -> None:
    """The message says which environment variable to unset, and does not ask for libraries; an empty one is unset."""
    make = "from minigolf_env.envs import MiniGolfEnv\nenv = MiniGolfEnv(render_mode='rgb_array')\n"
    command = [sys.executable, "-c", make + "env.reset()\nenv.render()"]
    message = f"expected PYOPENGL_PLATFORM=egl or none, received '{platform}'; unset it"
    for value, is_refused in ((platform, True), ("", False)):
        environment = {**os.environ, "PYOPENGL_PLATFORM": value}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (message in done.stderr) == (done.returncode != 0) == is_refused
        assert "apt-get" not in done.stderr
