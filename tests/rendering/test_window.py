"""Render mode "human", in a real window of a virtual display (Xvfb)."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from minigolf_env.rendering import Camera
from minigolf_env.rendering.window import _widen

ROOT = Path(__file__).parents[2]

START = """
import time
import gymnasium as gym, numpy as np
import minigolf_env
from PIL import ImageGrab
size = {"render_size": (320, 240), "render_profile": "fast"}
human = gym.make("MiniGolf-v0", render_mode="human", render_speed=speed, **size)
array = gym.make("MiniGolf-v0", render_mode="rgb_array", **size)
putt = np.array([0.25, 0.05], np.float32)
def window(): return human.unwrapped.renderer._window
def grab():
    x, y = window().window.get_location()
    return np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB"))[y:y + 240, x:x + 320]
def wait_for(image):
    end = time.monotonic() + 60.0
    while not (grab() == image).all():
        assert time.monotonic() < end, "the window never showed this image"
        time.sleep(0.05)
"""


def run(display: str, code: str, speed: float = 10.0) -> str:
    """Return the output of a process that runs START and then ``code``, with a display."""
    done = subprocess.run(
        [sys.executable, "-c", f"display, speed = {display!r}, {speed}\n{START}\n{textwrap.dedent(code)}"],
        cwd=ROOT,
        env={**os.environ, "DISPLAY": display},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


def test_window_shows_the_bits_of_rgb_array(display: str) -> None:
    """Window and EGL context draw equal images when they are used in turn."""
    code = """
        human.reset(seed=1), array.reset(seed=1)
        wait_for(array.render())
        for env in (human, array): env.unwrapped.set_state({"position": (2.0, 0.3, 0.03)})
        wait_for(array.render())
        print("seen")
    """
    assert run(display, code) == "seen"


def test_window_shows_a_putt_in_real_time(display: str) -> None:
    """The last frame has the ball at its final position."""
    code = """
        human.reset(seed=1)
        shown = []
        show = window().draw_and_handle_events
        window().draw_and_handle_events = lambda camera, state: (shown.append(state.ball), show(camera, state))
        start = time.perf_counter()
        info = human.step(putt)[4]
        assert time.perf_counter() - start >= info["shot_time"] > 0.5
        assert len(shown) >= 3 and np.array_equal(shown[-1], human.unwrapped.get_state()["position"])
        print("shown")
    """
    assert run(display, code, speed=1.0) == "shown"


def test_closed_window_stays_closed_and_the_environment_plays_on(display: str) -> None:
    """After its user closes the window during a putt, the putt ends; close() twice and render() are harmless."""
    code = """
        human.reset(seed=1), array.reset(seed=1)
        show, count = window().draw_and_handle_events, [0]
        def closing(camera, state):
            count[0] += 1
            if count[0] == 3: window().window.dispatch_event("on_close")
            show(camera, state)
        window().draw_and_handle_events = closing
        human.step(putt), array.step(putt)
        assert count[0] == 3 and not window().is_open
        assert human.unwrapped.get_state()["position"] == array.unwrapped.get_state()["position"]
        human.step(putt), human.reset(), human.render(), human.close(), human.close()
        array.render()
        print("ended")
    """
    assert run(display, code) == "ended"


def test_resized_window_is_filled(display: str) -> None:
    """The image has the new size of the window."""
    code = """
        human.reset(seed=1)
        window().window.set_size(480, 240)
        wide = gym.make("MiniGolf-v0", render_mode="rgb_array", render_size=(480, 240), render_profile="fast")
        wide.reset(seed=1)
        expected = wide.render()
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            window().draw_and_handle_events(*window()._shown)
            x, y = window().window.get_location()
            seen = np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB"))[y:y + 240, x:x + 480]
            if np.abs(seen.astype(int) - expected).mean() < 8.0: break
            time.sleep(0.05)
        else: raise AssertionError("the window was never filled")
        print("filled")
    """
    assert run(display, code) == "filled"


def test_narrow_window_shows_the_whole_width() -> None:
    """Everything from side to side stays visible when the window becomes narrower."""
    camera = Camera((0.0, -2.0, 1.0), (0.0, 0.0, 0.0), fov=40.0)
    narrow = _widen(camera, 2.5)
    edge = np.append(camera.ray(1.0, 0.0, 1.0)[0] + camera.ray(1.0, 0.0, 1.0)[1], 1.0)
    x, _, _, w = narrow.clip_from_world(0.4) @ edge
    np.testing.assert_allclose(x / w, 1.0)
    assert _widen(camera, 1.0) == camera


def test_forked_child_raises_and_the_parent_keeps_its_window(display: str) -> None:
    """The child raises an error instead of showing something; its close() does not close the parent's window."""
    code = """
        import os
        from minigolf_env.rendering import RenderingError
        human.reset(seed=1)
        child = os.fork()
        if child == 0:
            try: human.step(putt)
            except RenderingError as error: human.close(); os._exit(7 if "fork" in str(error) else 1)
            os._exit(2)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
        human.step(putt)
        assert window().is_open
        human.close()
        print("alone")
    """
    assert run(display, code) == "alone"


@pytest.mark.parametrize("end", ["sys.exit()", "del human; gc.collect(); os._exit(0)", "human.close(); sys.exit()"])
def test_window_stays_open_when_a_forked_child_exits(display: str, end: str) -> None:
    """No kind of exit of the child closes the window, also after it has closed or deleted the environment."""
    code = f"""
        import gc, os, sys
        human.reset(seed=1)
        child = os.fork()
        if child == 0:
            {end}
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        human.step(putt)
        assert window().is_open
        human.close()
        print("open")
    """
    assert run(display, code) == "open"


def test_garbage_collected_window_is_closed(display: str) -> None:
    """Environments that are deleted without close() leave no window open."""
    code = """
        import gc, pyglet
        for _ in range(3):
            env = gym.make("MiniGolf-v0", render_mode="human", **size)
            env.reset(seed=1)
            del env
            gc.collect()
        assert not [w for w in pyglet.app.windows if w.context is not None], list(pyglet.app.windows)
        print("closed")
    """
    assert run(display, code) == "closed"


def test_two_windows_show_their_own_environments(display: str) -> None:
    """Each window shows its own environment, also after the other is closed."""
    code = """
        other = gym.make("MiniGolf-v0", render_mode="human", camera="top", render_speed=speed, **size)
        human.reset(seed=1), other.reset(seed=2)
        human.step(putt), other.step(putt)
        assert window().is_open and other.unwrapped.renderer._window.is_open
        human.close()
        other.step(putt)
        print("both")
    """
    assert run(display, code) == "both"


def test_window_restores_the_egl_context_of_other_users(display: str) -> None:
    """An EGL context that another library has left current keeps its state and stays current."""
    code = """
        from OpenGL import EGL, GL
        from minigolf_env.rendering.gl.context import EGLContext
        def current(): return __import__("ctypes").cast(EGL.eglGetCurrentContext(), __import__("ctypes").c_void_p).value
        with EGLContext().current():
            buffers = GL.glGenBuffers(3)
            for buffer in buffers:
                GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, buffer)
                GL.glBufferData(GL.GL_UNIFORM_BUFFER, 64, bytes([buffer]) * 64, GL.GL_STATIC_DRAW)
            mine = current()
            human.reset(seed=1), array.reset(seed=1)
            for _ in range(2): human.step(putt), array.step(putt)
            assert current() == mine
            for buffer in buffers:
                GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, buffer)
                assert bytes(GL.glGetBufferSubData(GL.GL_UNIFORM_BUFFER, 0, 64)) == bytes([buffer]) * 64
        for env in (human, array): env.unwrapped.set_state({"position": (2.0, 0.3, 0.03)})
        wait_for(array.render())
        human.close()
        print("together")
    """
    assert run(display, code) == "together"


def test_hidden_window_gives_the_bits_of_egl(display: str) -> None:
    """A hidden window is the context of systems without EGL."""
    code = """
        from minigolf_env.courses import load_course
        from minigolf_env.rendering import static_view
        from minigolf_env.rendering.gl.offscreen import OffscreenRenderer, draw
        from minigolf_env.rendering.gl.window_context import HiddenWindowContext
        course = load_course("dogleg")
        camera, state = static_view(course, "tee", 4 / 3, np.array([0.4, 0.6, 0.03]))
        renderer = OffscreenRenderer(HiddenWindowContext())
        for profile in ("high", "fast", "fast"):
            with renderer.context.current():
                image = renderer.draw((course, camera, (160, 120), profile), state)
            assert (image == draw(course, camera, state, (160, 120), profile)).all()
        print("same")
    """
    assert run(display, code) == "same"
