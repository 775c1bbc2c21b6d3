"""How much processor time a picture costs, beside MuJoCo's renderer: ``python -m benchmarks.rendering``.

Both draw through EGL: ours at profile "high" beside MuJoCo's with four samples a pixel and shadows, ours at "fast" (one
sample, with shadows) beside MuJoCo's with neither. A ball on a green with borders and obstacles, the camera behind the
ball and moving with it. MuJoCo's shadow map has 1024 pixels a side, as ours: its default, 4096, is slower. Times are of
all threads, medians; the two take turns.

Also: the time from the start of Python to the first picture, and how many pictures pixel observations get.
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

SIZES = ((640, 480), (256, 256), (84, 84))
PICTURES = 30

MODEL = """
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


def ours(size: tuple[int, int], profile: str) -> Callable[[float], Any]:
    """Return what draws the ball at x (m) with us."""
    course = load_course("dogleg")

    def picture(x: float) -> Any:
        ball = np.array([x, 0.6, course.ball_radius])
        state = SceneState(ball, np.eye(3), flag_position(course, ball))
        return draw(course, make_camera("follow", course, ball, size[0] / size[1]), state, size, profile)

    return picture


def theirs(size: tuple[int, int], profile: str) -> Callable[[float], Any]:
    """Return what draws the ball at x (m) with MuJoCo."""
    import mujoco

    high = profile == "high"
    model = mujoco.MjModel.from_xml_string(MODEL.format(samples=4 if high else 0, shadow=str(high).lower()))
    data = mujoco.MjData(model)
    renderer = mujoco.Renderer(model, size[1], size[0])
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = high
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 1.9, 10.0, -28.0

    def picture(x: float) -> Any:
        data.qpos[:3] = x, 0.6, 0.02135
        mujoco.mj_forward(model, data)
        camera.lookat[:] = x + 0.6, 0.7, 0.0
        renderer.update_scene(data, camera)
        return renderer.render()

    return picture


def in_turn(pictures: dict[str, Callable[[float], Any]]) -> dict[str, float]:
    """Return the median processor time of a picture, ms."""
    spent: dict[str, list[float]] = {name: [] for name in pictures}
    for k in range(PICTURES + 3):
        for name, picture in pictures.items():
            start = time.process_time()
            picture(0.3 + 0.04 * k)
            spent[name].append(1e3 * (time.process_time() - start))
    return {name: statistics.median(times[3:]) for name, times in spent.items()}


def beside_mujoco() -> None:
    """Print what a picture costs with us and with MuJoCo."""
    rows = []
    for profile in ("high", "fast"):
        for size in SIZES:
            makers = {"ours": ours, "mujoco": theirs}
            cost = in_turn({name: make(size, profile) for name, make in makers.items()})
            ratio = cost["mujoco"] / cost["ours"]
            name = f"{size[0]} x {size[1]}, {profile}"
            rows.append([name, f"{cost['ours']:.1f}", f"{cost['mujoco']:.1f}", f"{ratio:.1f}x"])
    print_table(["picture", "ours, ms", "mujoco, ms", "ratio"], rows)


def first_picture() -> None:
    """Print how long a picture takes from the start of Python, with warm caches."""
    code = (
        "import gymnasium, minigolf_env; env = gymnasium.make('MiniGolf-v0', render_mode='rgb_array'); "
        "env.reset(seed=0); env.render()"
    )
    times = []
    for _ in range(6):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        times.append(time.perf_counter() - start)
    print(f"first picture: {statistics.median(times[1:]):.2f} s from the start of Python, of {len(times) - 1} runs")


def observations(count: int = 64) -> None:
    """Print how many pixel observations a second of processor time a batch makes."""
    envs = MiniGolfVectorEnv(count, observation="pixels")
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    spent = []
    for _ in range(12):
        envs.step(rng.uniform(-0.5, 0.5, (count, 2)).astype(np.float32))
        start = time.process_time()
        envs._observe()
        spent.append(time.process_time() - start)
    print(f"pixel observations, batch of {count}: {count / statistics.median(spent[2:]):,.0f} a CPU-second")


if __name__ == "__main__":
    os.environ["MUJOCO_GL"] = "egl"
    first_picture()
    observations()
    beside_mujoco()
