"""Measure the CPU time of a frame next to MuJoCo's renderer: ``python -m benchmarks.rendering``.

Both renderers use EGL. Our profile "high" is compared with MuJoCo at four samples per pixel with shadows; our profile
"fast" (one sample, with shadows) with MuJoCo without both. The scene is a ball on a green with borders and obstacles;
the camera follows the ball. MuJoCo's shadow map has 1024 pixels per side, as ours; its default, 4096, is slower. Times
are CPU time of all threads, medians; the two take turns.

Also measured: the time from the start of Python to the first frame, and the rate of pixel observations.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.report import print_table
from minigolf_env.courses import load_course
from minigolf_env.envs import MiniGolfVectorEnv
from minigolf_env.rendering.camera import make_camera
from minigolf_env.rendering.gl.offscreen import draw
from minigolf_env.rendering.replay import flag_position
from minigolf_env.rendering.scene_state import SceneState

FRAME_SIZES = ((640, 480), (256, 256), (84, 84))
NUM_FRAMES = 30
"""Number of measured frames."""

NUM_WARMUP_FRAMES = 3
"""Number of frames before the measurement."""

MUJOCO_MODEL = """
<mujoco>
  <visual><global offwidth="640" offheight="480"/><quality offsamples="{samples}" shadowsize="1024"/></visual>
  <asset>
    <texture name="green" type="2d" builtin="checker" rgb1=".2 .5 .2" rgb2=".25 .55 .25" width="256" height="256"/>
    <material name="green" texture="green" texrepeat="40 40"/>
    <texture type="skybox" builtin="gradient" rgb1=".6 .7 .9" rgb2=".3 .4 .5" width="64" height="64"/>
  </asset>
  <worldbody>
    <light pos="1 -1 4" dir="0.4 0.4 -0.8" directional="true" castshadow="{shadow}"/>
    <geom type="plane" size="20 20 .1" material="green"/>
    <geom type="box" size="2 .035 .06" pos="2 -.035 .06"/>
    <geom type="box" size="1.37 .035 .06" pos="1.37 1.285 .06"/>
    <geom type="box" size=".035 .6 .06" pos="-.035 .6 .06"/>
    <geom type="box" size=".035 1.2 .06" pos="4.035 1.2 .06"/>
    <geom type="box" size=".2 .08 .06" pos="1.9 .6 .06" euler="0 0 -30"/>
    <geom type="cylinder" size=".11 .06" pos="3.3 1.5 .06"/>
    <geom type="cylinder" size=".006 .31" pos="3.45 2.1 .31"/>
    <body name="ball" pos=".35 .6 .02135"><freejoint/><geom type="sphere" size=".02135"/></body>
  </worldbody>
</mujoco>
"""


def minigolf_renderer(size: tuple[int, int], profile: str) -> Callable[[float], Any]:
    """Return a function that renders the ball at x, m, with our renderer."""
    course = load_course("dogleg")

    def render_frame(x: float) -> Any:
        ball = np.array([x, 0.6, course.ball_radius])
        state = SceneState(ball, np.eye(3), flag_position(course, ball))
        return draw(course, make_camera("follow", course, ball, size[0] / size[1]), state, size, profile)

    return render_frame


def mujoco_renderer(size: tuple[int, int], profile: str) -> Callable[[float], Any]:
    """Return a function that renders the ball at x, m, with MuJoCo."""
    import mujoco

    high = profile == "high"
    model = mujoco.MjModel.from_xml_string(MUJOCO_MODEL.format(samples=4 if high else 0, shadow=str(high).lower()))
    data = mujoco.MjData(model)
    renderer = mujoco.Renderer(model, size[1], size[0])
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = high
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 1.9, 10.0, -28.0

    def render_frame(x: float) -> Any:
        data.qpos[:3] = x, 0.6, 0.02135
        mujoco.mj_forward(model, data)
        camera.lookat[:] = x + 0.6, 0.7, 0.0
        renderer.update_scene(data, camera)
        return renderer.render()

    return render_frame


def measure_alternating(renderers: dict[str, Callable[[float], Any]]) -> dict[str, float]:
    """Return the median CPU time of a frame of each renderer, ms; the renderers take turns."""
    cpu_times: dict[str, list[float]] = {name: [] for name in renderers}
    for k in range(NUM_FRAMES + NUM_WARMUP_FRAMES):
        for name, render_frame in renderers.items():
            start = time.process_time()
            render_frame(0.3 + 0.04 * k)
            cpu_times[name].append(1e3 * (time.process_time() - start))
    return {name: statistics.median(times[NUM_WARMUP_FRAMES:]) for name, times in cpu_times.items()}


def print_mujoco_comparison() -> None:
    """Print the CPU time of a frame with our renderer and with MuJoCo."""
    rows = []
    for profile in ("high", "fast"):
        for size in FRAME_SIZES:
            renderers = {"ours": minigolf_renderer(size, profile), "mujoco": mujoco_renderer(size, profile)}
            cost = measure_alternating(renderers)
            ratio = cost["mujoco"] / cost["ours"]
            name = f"{size[0]} x {size[1]}, {profile}"
            rows.append([name, f"{cost['ours']:.1f}", f"{cost['mujoco']:.1f}", f"{ratio:.1f}x"])
    print_table(["frame", "ours, ms", "mujoco, ms", "ratio"], rows)


def print_first_frame_time() -> None:
    """Print the time from the start of Python to the first frame, with warm caches."""
    code = (
        "import gymnasium, minigolf_env; env = gymnasium.make('MiniGolf-v0', render_mode='rgb_array'); "
        "env.reset(seed=0); env.render()"
    )
    times = []
    for _ in range(6):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        times.append(time.perf_counter() - start)
    print(
        f"first frame: {statistics.median(times[1:]):.2f} s from the start of Python, median of {len(times) - 1} runs"
    )


def print_observation_rate(count: int = 64) -> None:
    """Print the rate of pixel observations of a batch for a second of CPU time."""
    envs = MiniGolfVectorEnv(count, observation="pixels")
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    cpu_times = []
    for _ in range(12):
        envs.step(rng.uniform(-0.5, 0.5, (count, 2)).astype(np.float32))
        start = time.process_time()
        envs._observe()
        cpu_times.append(time.process_time() - start)
    print(f"pixel observations, batch of {count}: {count / statistics.median(cpu_times[2:]):,.0f} per CPU-second")


if __name__ == "__main__":
    os.environ["MUJOCO_GL"] = "egl"
    print_first_frame_time()
    print_observation_rate()
    print_mujoco_comparison()
