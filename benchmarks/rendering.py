"""Measure the CPU time of a frame next to MuJoCo's renderer: ``python -m benchmarks.rendering``.

Both renderers use EGL. Our profile "high" is compared with MuJoCo at four samples per pixel with shadows; our profile
"fast" (one sample, with shadows) with MuJoCo without both. The scene is a ball on a green with borders and obstacles;
the camera follows the ball. MuJoCo's shadow map has 1024 pixels per side, as ours; its default, 4096, is slower. Times
are CPU time of all threads, medians; the two take turns.

Also measured: the time from the start of Python to the first frame, and the rate of pixel observations, by the compiled
kernel and by the renderer in turn.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from benchmarks.report import print_table
from benchmarks.timing import cpu_seconds
from minigolf_env.courses import Course, load_course
from minigolf_env.courses.procedural import level_name
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.observations.pixels import IMAGE_SIZE, marker_view, observe_pixels, top_view
from minigolf_env.envs.rules import NUM_STATE_FEATURES
from minigolf_env.envs.task import TaskBatch
from minigolf_env.rendering.camera import make_camera
from minigolf_env.rendering.gl.offscreen import draw
from minigolf_env.rendering.props import flag_rest_position
from minigolf_env.rendering.replay import flag_position
from minigolf_env.rendering.scene_state import SceneState

FRAME_SIZES = ((640, 480), (256, 256), (84, 84))
NUM_FRAMES = 30
"""Number of measured frames."""

NUM_WARMUP_FRAMES = 3
"""Number of frames before the measurement."""

NUM_LEVELS = 500
"""Number of levels of pixel observations."""

NUM_OBSERVATION_ROUNDS = 10
"""Number of measured batches of pixel observations."""

NO_STATE = np.empty((0, NUM_STATE_FEATURES), np.float32)
"""Features "state", which pixel observations do not show."""

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
            cpu_times[name].append(1e3 * cpu_seconds(lambda: render_frame(0.3 + 0.04 * k)))  # noqa: B023 (called at once)
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


def pixel_rates(tasks: TaskBatch, num_rendered: int) -> dict[str, float]:
    """Return pixel observations per CPU-second after the first frame of each course: of the kernel and the renderer.

    Args:
        tasks: one hole, or a level for each ball.
        num_rendered: number of tasks whose balls the renderer draws, in turn with the kernel.
    """
    count = 64 if len(tasks.tasks) == 1 else len(tasks.tasks)
    rng = np.random.default_rng(0)
    strokes = np.zeros(count, np.int64)
    cpu_times: dict[str, list[float]] = {"kernel": [], "renderer": []}
    for _ in range(NUM_OBSERVATION_ROUNDS + 1):
        balls = tasks.sample_start([rng] * count) + rng.uniform(0.0, 1.0, (count, 1)) * [1.0, 0.2, 0.0]
        rendered = [(tasks.tasks[k % len(tasks.tasks)].course, balls[k]) for k in range(num_rendered)]
        kernel = cpu_seconds(lambda: observe_pixels(tasks, balls, strokes, NO_STATE))  # noqa: B023 (called at once)
        renderer = cpu_seconds(lambda: [render_marker(*pair) for pair in rendered])  # noqa: B023
        cpu_times["kernel"].append(kernel / count)
        cpu_times["renderer"].append(renderer / num_rendered)
    return {name: 1.0 / statistics.median(times[1:]) for name, times in cpu_times.items()}


def render_marker(course: Course, ball: FloatArray) -> None:
    """Draw the image of a pixel observation with the renderer."""
    camera, radius = marker_view(course)
    state = SceneState(ball, np.eye(3), flag_rest_position(course), marker_radius=radius)
    draw(course, camera, state, (IMAGE_SIZE, IMAGE_SIZE), "fast")


def print_observation_rates() -> None:
    """Print the rates of pixel observations on one hole and on levels, next to the renderer's, on one thread."""
    numba.set_num_threads(1)
    hole = MiniGolfEnv(observation="pixels").task
    start = time.process_time()
    levels = TaskBatch([MiniGolfEnv(level_name("medium", k), observation="pixels").task for k in range(NUM_LEVELS)])
    made = time.process_time()
    for task in levels.tasks:
        top_view(task.course)
    first_frame = (time.process_time() - made) / NUM_LEVELS
    rows = []
    for name, tasks, num_rendered in (("dogleg", hole, 64), (f"{NUM_LEVELS} levels", levels, 12)):
        rates = pixel_rates(tasks, num_rendered)
        ratio = f"{rates['kernel'] / rates['renderer']:,.0f}x"
        rows.append([name, f"{rates['kernel']:,.0f}", f"{rates['renderer']:,.0f}", ratio])
    print_table(["pixel observations on", "per CPU-second", "by the renderer", "ratio"], rows)
    print(f"first frame of a level: {first_frame:.2f} CPU-seconds; its physics: {(made - start) / NUM_LEVELS:.2f}\n")


if __name__ == "__main__":
    os.environ["MUJOCO_GL"] = "egl"
    print_first_frame_time()
    print_observation_rates()
    print_mujoco_comparison()
