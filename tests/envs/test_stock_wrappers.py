"""Gymnasium's own wrappers that record frames."""

import sys
import types
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RenderCollection
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv

LOOK: dict[str, Any] = {"render_size": (64, 48), "camera": "top", "render_profile": "fast"}
WEAK_PUTT = np.array([0.1, 0.0], np.float32)

pytestmark = pytest.mark.usefixtures("gl")


def test_gymnasium_wrappers_record_one_frame_a_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """RenderCollection, and both RecordVideo with a stand-in for moviepy, which encodes for them."""
    lengths: list[int] = []

    class Clip:
        def __init__(self, frames: list[NDArray[np.uint8]], fps: int) -> None:
            lengths.append(len(frames))

        def write_videofile(self, path: str, logger: object) -> None:
            Path(path).touch()

    for name in ("moviepy", "moviepy.video", "moviepy.video.io", "moviepy.video.io.ImageSequenceClip"):
        module = types.ModuleType(name)
        monkeypatch.setitem(sys.modules, name, module)
    module.ImageSequenceClip = Clip  # type: ignore[attr-defined]
    env: Any = gym.wrappers.RecordVideo(
        gym.make("MiniGolf-v0", render_mode="rgb_array", **LOOK), str(tmp_path / "one"), lambda n: True
    )
    env.reset(seed=0)
    for _ in range(2):
        env.step(WEAK_PUTT)
    env.close()
    many: Any = gym.wrappers.vector.RecordVideo(
        gym.make_vec("MiniGolf-v0", num_envs=3, render_mode="rgb_array", **LOOK),
        str(tmp_path / "many"),
        episode_trigger=lambda n: True,
    )
    many.reset(seed=0)
    many.step(np.stack([WEAK_PUTT] * 3))
    many.close()
    assert lengths == [3, 2]
    assert all((tmp_path / name / "rl-video-episode-0.mp4").exists() for name in ("one", "many"))
    collected: Any = RenderCollection(MiniGolfEnv(render_mode="rgb_array", **LOOK))
    collected.reset(seed=0)
    collected.step(WEAK_PUTT)
    assert [picture.shape for picture in collected.render()] == [(48, 64, 3)] * 2
