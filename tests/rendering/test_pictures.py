"""Pictures as such: the same bits always, and nothing missing in them."""

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
from minigolf_env.rendering import Image, Line, RenderingError, SceneState, flag_rest_position
from minigolf_env.rendering.camera import Camera, make_camera
from minigolf_env.rendering.gl import context as gl_context
from minigolf_env.rendering.gl.offscreen import OffscreenRenderer, draw, get_offscreen_renderer
from minigolf_env.rendering.replay import flag_position

pytestmark = pytest.mark.usefixtures("gl")

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests" / "data" / "pictures"
SIZE = (240, 180)
CLOSE = {"close": ((3.2, 1.9), (3.1, 1.75, 0.12)), "cup": ((3.35, 2.0), (3.2, 1.7, 0.35))}
"""Where the ball lies and from where it is seen closely, m."""
DOGLEG = load_course("dogleg")
ALIKE = 0.75
"""Mean difference (of 255) that pictures of other graphics libraries may have; a missing ball differs by more."""


def moment(ball: tuple[float, float] = (0.6, 0.4)) -> SceneState:
    """Return a ball on the dogleg's felt, with a trail."""
    place = np.array([*ball, DOGLEG.ball_radius])
    way = np.linspace(place - [0.3, 0.1, 0.019], place - [0, 0, 0.019], 12)
    return SceneState(
        place, np.eye(3), flag_position(DOGLEG, place), (Line(way, 0.02, (1, 1, 1, 0.1), (1, 1, 1, 0.5)),)
    )


def picture(frame: SceneState | None = None, camera: str = "follow", profile: str = "high") -> Image:
    """Return a picture of the dogleg."""
    frame = moment() if frame is None else frame
    return draw(DOGLEG, make_camera(camera, DOGLEG, frame.ball, SIZE[0] / SIZE[1]), frame, SIZE, profile)


def difference(a: Image, b: Image) -> float:
    """Return how much two pictures differ where they differ most: the largest mean over tiles of 12 x 12 pixels."""
    away = np.abs(a.astype(float) - b).mean(axis=2)
    return float(away.reshape(SIZE[1] // 12, 12, SIZE[0] // 12, 12).mean(axis=(1, 3)).max())


def digest(code: str, **environment: str) -> str:
    """Return what a fresh process prints that runs ``code`` with this module's names."""
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


def fingerprint(*pictures: Image) -> str:
    """Return a hash of pictures."""
    return hashlib.sha256(b"".join(map(bytes, pictures))).hexdigest()


@pytest.mark.parametrize("profile", ["high", "fast"])
def test_the_same_picture_twice(profile: str) -> None:
    """Bit for bit, with others drawn in between."""
    first = picture(profile=profile)
    picture(camera="top", profile=profile)
    assert (picture(profile=profile) == first).all()


@pytest.mark.parametrize("threads", ["0", "1", "2"])
def test_the_same_picture_in_another_process_with_other_threads(threads: str) -> None:
    """The software renderer's threads change nothing."""
    here = fingerprint(picture(), picture(camera="top", profile="fast"))
    there = digest('print(fingerprint(picture(), picture(camera="top", profile="fast")))', LP_NUM_THREADS=threads)
    assert there == here


@pytest.mark.parametrize("profile", ["high", "fast"])
@pytest.mark.parametrize("camera", ["top", "tee", "orbit"])
@pytest.mark.parametrize("name", ["dogleg", "room"])
def test_drawing_only_what_moves_gives_the_same_picture(name: str, camera: str, profile: str) -> None:
    """Balls anywhere, in the air and beside the course, the flag in and out, lines: as if all were drawn."""
    course, rng, size = load_course(name), np.random.default_rng(0), (96, 72)
    place = make_camera(camera, course, np.zeros(3), 4 / 3)
    lower, upper = np.array(course.bounds)
    for k in range(8):
        ball = rng.uniform(lower, upper)
        line = Line(rng.uniform(lower, upper, (4, 3)), 0.03, (1, 0, 0, 0.8), (1, 1, 1, 0.3))
        frame = SceneState(ball, np.eye(3), flag_position(course, ball), (line,) if k % 3 == 0 else (), 1.0 + k % 2)
        with get_offscreen_renderer().context.current():
            expected = get_offscreen_renderer().renderer().draw(course, place, frame, size, profile).read()
        np.testing.assert_array_equal(draw(course, place, frame, size, profile), expected)


def test_other_threads_draw_the_same() -> None:
    """Four threads at once get what one gets."""
    expected, drawn = picture(), []
    threads = [threading.Thread(target=lambda: drawn.append(picture())) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(drawn) == 4 and all((one == expected).all() for one in drawn)


def stored(name: str) -> Image:
    """Return a picture as it was when it was looked at."""
    return np.asarray(PIL.Image.open(GOLDEN / f"dogleg_{name}.png").convert("RGB"))


def golden(name: str) -> Image:
    """Return a stored picture's like: a view's name, "close" (to the ball) or "cup"."""
    if name not in CLOSE:
        return picture(camera=name)
    place, eye = CLOSE[name]
    frame = moment(place)._replace(flag=flag_rest_position(DOGLEG))
    renderer = OffscreenRenderer()
    with renderer.context.current():
        return renderer.draw((DOGLEG, Camera(eye, (*place, 0.0)), SIZE, "high"), frame)


@pytest.mark.parametrize("name", ["follow", "top", "tee", "orbit", "close", "cup"])
def test_pictures_are_those_looked_at_when_they_were_made(name: str) -> None:
    """Against stored pictures, with room for other graphics libraries: ``python -m tests.rendering.test_pictures``."""
    now = golden(name)
    assert np.abs(now.astype(float) - stored(name)).mean() < ALIKE
    assert difference(now, stored(name)) < 4.0 * ALIKE


def test_a_hidden_ball_is_hinted_at() -> None:
    """Behind the border a pale disc shows where it is; in the open there is none over the ball."""
    camera = Camera((-0.6, 0.6, 0.15), (0.3, 0.6, 0.0))
    hidden = moment((0.03, 0.6))._replace(lines=())
    away = hidden._replace(ball=hidden.ball + np.array([3.0, 0.0, 0.0]))
    seen = draw(DOGLEG, camera, hidden, SIZE, "high"), draw(DOGLEG, camera, away, SIZE, "high")
    changed = np.abs(seen[0].astype(int) - seen[1]).max(axis=2) > 20
    assert 20 < changed.sum() < 0.02 * changed.size


def without(what: str) -> Image:
    """Return the followed picture with something missing from it."""
    frame = moment()
    if what == "ball and its shadow":
        return picture(frame._replace(ball=frame.ball - [0, 0, 50.0]), camera="tee")
    if what == "flag":
        return picture(frame._replace(flag=np.array([0.0, 0.0, -50.0])), camera="tee")
    return picture(frame._replace(lines=()), camera="tee")


@pytest.mark.parametrize("what", ["ball and its shadow", "flag", "trail"])
def test_the_comparison_notices_what_is_missing(what: str) -> None:
    """Each small thing changes the picture by more than the comparison allows."""
    assert difference(without(what), picture(camera="tee")) > 4.0 * ALIKE


@pytest.mark.parametrize(
    ("broken", "name", "change"),
    [
        ("the sun's shadows", "follow", ("direct *= light_share(sun_map", "if (false) direct *= light_share(sun_map")),
        ("the sky's shadows", "cup", ("ambient_share *= mix(0.1", "if (false) ambient_share *= mix(0.1")),
        ("the ball's shadow", "close", ("direct *= sun_past_ball(p)", "direct *= 1.0")),
        ("the shade under the ball", "close", ("ambient_share = 1.0 - 0.85 * occlusion", "ambient_share = 1.0")),
        ("the dimples", "close", ("* (skin.rgb * 2.0 - 1.0)), 0.8)", "* (skin.rgb * 2.0 - 1.0)), 0.0)")),
        ("the ball's band", "close", ("mix(vec3(0.80, 0.10, 0.06), vec3(0.93), skin.a)", "vec3(0.93)")),
        ("the flag's shadow", "cup", ("direct *= sun_past_flag(p)", "direct *= 1.0")),
        ("the cup's depth", "cup", ("if (cup.w > 0.0) albedo", "if (false) albedo")),
        ("the mown stripes", "top", ("sin(p.x * (PI / 0.22))", "0.0")),
        ("the grain of the wood", "follow", ("float ring = ", "float ring = 0.0 * ")),
        ("the gloss", "close", ("if (gloss > 0.0)", "if (false)")),
    ],
)
def test_the_comparison_notices_broken_shaders(
    broken: str, name: str, change: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without one of the lights a stored picture is missed by more than it may be."""
    from minigolf_env.rendering.gl import offscreen, program

    sources = program.read_shader

    def altered(file: str) -> str:
        text = sources(file)
        assert file != "surface.frag" or change[0] in text, f"surface.frag has changed: {change[0]}"
        return text.replace(*change)

    monkeypatch.setattr(program, "read_shader", altered)
    fresh = OffscreenRenderer()
    monkeypatch.setattr(offscreen, "get_offscreen_renderer", lambda: fresh)
    assert difference(golden(name), stored(name)) > 4.0 * ALIKE, broken


def test_an_interrupted_picture_spoils_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever drawing stops, the next picture is right, and so is that of a course drawn for the first time."""
    from minigolf_env.rendering.gl import buffers, renderer

    expected = picture(), picture(camera="top"), picture(camera="top")

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    for place, method in (
        (buffers.LineStrips, "draw"),
        (buffers.MeshBuffer, "draw"),
        (buffers.Framebuffer, "resolve"),
        (renderer.Renderer, "_draw_flag"),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(place, method, interrupted)
            with pytest.raises(KeyboardInterrupt):  # Of a view that is new, so that all of it is drawn.
                draw(DOGLEG, Camera((float(len(method)), -1.0, 1.0), (3.0, 2.0, 0.0)), moment(), SIZE)
            with contextlib.suppress(KeyboardInterrupt):  # The flag is not in the part that is drawn again.
                picture(camera="top")
        course = dataclasses.replace(DOGLEG)
        again = draw(course, make_camera("follow", course, moment().ball, 4 / 3), moment(), SIZE, "high")
        for now, before in zip((again, picture(camera="top"), picture(camera="top")), expected, strict=True):
            np.testing.assert_array_equal(now, before)


def test_first_pictures_from_several_threads() -> None:
    """In a fresh process four threads that draw at once get the same right picture."""
    code = """
import threading
gate, drawn = threading.Barrier(4), []
def act(): gate.wait(); drawn.append(fingerprint(picture(profile="fast")))
threads = [threading.Thread(target=act) for _ in range(4)]
for t in threads: t.start()
for t in threads: t.join()
print(len(drawn), *set(drawn))
"""
    assert digest(f"exec({code!r})") == f"4 {fingerprint(picture(profile='fast'))}"


def test_a_display_that_fails_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where one EGL display raises, the next is tried; where all do, each is named."""
    found = gl_context._platform_display

    def failing(platform: int, native: object) -> object:
        if platform == gl_context.PLATFORM_DEVICE:
            raise OSError("bad device")
        return found(platform, native)

    monkeypatch.setattr(gl_context, "_platform_display", failing)
    with gl_context.EGLContext().current():
        pass

    def refuse(self: gl_context.EGLContext, display: object) -> None:
        raise OSError("bad\nconfiguration")

    monkeypatch.setattr(gl_context.EGLContext, "_create_context", refuse)
    with pytest.raises(RenderingError, match=r"device 0: OSError: bad device.*surfaceless: OSError: bad configuration"):
        gl_context.EGLContext()


def test_the_largest_size_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond the library's limit there is an error that names it, and the next picture is drawn."""
    with pytest.raises(RenderingError, match="render_size"):
        draw(DOGLEG, make_camera("top", DOGLEG, np.zeros(3), 1.0), moment(), (100_000, 8))
    assert picture().shape == (SIZE[1], SIZE[0], 3)


def test_the_smallest_size_is_one_pixel() -> None:
    """Odd and tiny sizes have the shape that was asked for."""
    for size in ((1, 1), (3, 7), (101, 33)):
        assert draw(DOGLEG, make_camera("top", DOGLEG, np.zeros(3), 1.0), moment(), size).shape == (size[1], size[0], 3)


def test_a_forked_child_is_told_and_does_not_hang() -> None:
    """OpenGL does not survive a fork."""
    code = """
picture()
import multiprocessing
def child(queue):
    try: picture()
    except RenderingError as error: queue.put(str(error))
fork = multiprocessing.get_context("fork"); queue = fork.Queue()
process = fork.Process(target=child, args=(queue,)); process.start(); print(queue.get(timeout=60)); process.join()
"""
    assert "fork" in digest(f"exec({code!r})")


def test_nothing_of_opengl_is_loaded_before_the_first_picture() -> None:
    """Neither import nor make, reset and step without a render mode."""
    code = (
        "import sys, gymnasium as gym, minigolf_env; env = gym.make('MiniGolf-v0', render_mode='rgb_array'); "
        "env.reset(seed=0); env.step([0.1, 0]); print(*sorted({'OpenGL', 'pyglet'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_missing_library_is_named_with_its_remedy() -> None:
    """Whatever PyOpenGL raises where libEGL cannot be loaded becomes one sentence."""
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
    assert "apt-get install libegl1 libgl1" in digest(f"exec({code!r})")


def test_a_device_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """The variable that chooses one is checked."""
    monkeypatch.setenv(gl_context.DEVICE_VARIABLE, "99")
    with pytest.raises(RenderingError, match=f"{gl_context.DEVICE_VARIABLE}.*99"):
        gl_context.EGLContext()


def address(pointer: Any) -> int | None:
    """Return where a pointer points."""
    return ctypes.cast(pointer, ctypes.c_void_p).value


def test_other_users_of_opengl_are_not_disturbed() -> None:
    """A context that was current before a picture is current after it, and undamaged."""
    from OpenGL import EGL, GL

    other = gl_context.EGLContext()
    with other.current():
        before = address(EGL.eglGetCurrentContext())
        GL.glClearColor(0.25, 0.5, 0.75, 1.0)
        picture()
        assert address(EGL.eglGetCurrentContext()) == before
        np.testing.assert_allclose(GL.glGetFloatv(GL.GL_COLOR_CLEAR_VALUE), [0.25, 0.5, 0.75, 1.0])


if __name__ == "__main__":
    for name in ("follow", "top", "tee", "orbit", *CLOSE):
        PIL.Image.fromarray(golden(name)).save(GOLDEN / f"dogleg_{name}.png")
