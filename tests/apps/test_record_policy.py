"""Recording a policy: every putt is in the video, and mistakes are reported before anything is computed."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minigolf_env import cli
from minigolf_env.apps.record_policy import record_policy
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.players.policies import RandomPolicy
from minigolf_env.rendering import PAUSE_AFTER_PUTT, RenderingError
from tests.videos import decode

SIZE = (64, 48)
FPS = 5
SMALL_VIDEO: dict[str, Any] = {"size": SIZE, "fps": FPS, "profile": "fast"}


@pytest.mark.parametrize("env_args", [{"course": "dogleg"}, {"course": "procedural", "difficulty": "medium"}])
def test_video_shows_every_putt(
    tmp_path: Path, gl: None, capsys: pytest.CaptureFixture[str], env_args: dict[str, str]
) -> None:
    """The video has one frame of the tee and FPS frames per second of each putt; the last shows the ball at rest."""
    path = tmp_path / "a.mp4"
    record_policy(path, policy="random", seed=3, camera="top", episodes=2, **env_args, **SMALL_VIDEO)
    policy = RandomPolicy(3)
    num_frames = 0
    strokes = []
    for seed in (3, 4):
        env = MiniGolfEnv(render_mode="rgb_array", render_size=SIZE, camera="top", render_profile="fast", **env_args)
        observation, info = env.reset(seed=seed)
        done = False
        num_frames += 1
        while not done:
            observation, _, done, _, info = env.step(policy.act(observation, env))
            num_frames += math.ceil((info["shot_time"] + PAUSE_AFTER_PUTT) * FPS)
        strokes.append(f"{info['strokes']}" + ("" if info["is_success"] else " (not holed)"))
    frames = decode(path, SIZE)
    assert len(frames) == num_frames
    assert np.abs(frames[-1].astype(float) - env.render()).mean() < 5.0
    line = capsys.readouterr().out
    assert line.startswith(f"{path}: {num_frames / FPS:.1f} s of 64 x 48, ")
    assert f"strokes: {', '.join(strokes)};" in line and line.count("\n") == 1


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        ({"policy": "serch"}, "did you mean 'search'"),
        ({"policy": "none.zip"}, "none at none.zip"),
        ({"course": "doglegg"}, "did you mean 'dogleg'"),
        ({"course": "room"}, "a cup"),
        ({"difficulty": "easy"}, "difficulty: expected with course='procedural'"),
        ({"course": "procedural", "difficulty": "medum"}, "did you mean 'medium'"),
        ({"camera": "tpo"}, "did you mean 'top'"),
        ({"profile": "hig"}, "did you mean 'high'"),
        ({"size": (0, 48)}, "size: expected width and height"),
        ({"fps": 0}, "fps: expected"),
        ({"episodes": 0}, "episodes: expected"),
        ({"seed": -1}, "seed: expected"),
        ({"output": "a.mpeg"}, "did you mean '.mp4'"),
    ],
)
def test_rejects_invalid_arguments_before_computing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mistake: dict[str, Any], message: str
) -> None:
    """A mistake is reported before a world is built or a file is made."""

    def fail(*args: object, **options: object) -> None:
        raise AssertionError("the world was built before the arguments were checked")

    monkeypatch.setattr("minigolf_env.courses.Course.world", fail)
    monkeypatch.chdir(tmp_path)
    arguments = {"output": "a.mp4", "course": "dogleg", **SMALL_VIDEO, **mistake}
    with pytest.raises((ValueError, OSError), match=message):
        record_policy(**arguments)
    assert list(tmp_path.iterdir()) == []


def run_video_command(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    """Run ``minigolf video`` and return its exit code."""
    monkeypatch.setattr(sys, "argv", ["minigolf", "video", *words])
    try:
        cli.main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_command_exit_codes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], gl: None
) -> None:
    """The command exits with 0 and a file, 1 and a one-line error, or 2 for an unknown option or without OpenGL."""
    monkeypatch.chdir(tmp_path)
    assert run_video_command(monkeypatch, "-o", "a.gif", "--size", "64", "48", "--fps", "5", "--profile", "fast") == 0
    assert len(decode(tmp_path / "a.gif", SIZE)) > 5
    assert run_video_command(monkeypatch, "-o", "a.gif", "--policy", "serch") == 1
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("minigolf: --policy") and error.endswith("did you mean 'search'?")
    assert run_video_command(monkeypatch, "-o", "a.gif", "--polcy", "search") == 2

    def no_opengl(*args: object, **options: object) -> None:
        raise RenderingError("there is no OpenGL here.")

    monkeypatch.setattr("minigolf_env.apps.record_policy.record_policy", no_opengl)
    assert run_video_command(monkeypatch, "-o", "a.gif") == 2


def test_mistake_prints_one_line_and_no_traceback(tmp_path: Path) -> None:
    """In a separate process, a mistake prints one line on stderr."""
    command = [sys.executable, "-m", "minigolf_env.cli", "video", "-o", str(tmp_path / "a.mpeg")]
    result = subprocess.run(command, capture_output=True, text=True)
    assert (result.returncode, result.stdout, result.stderr.count("\n")) == (1, "", 1)
    assert "did you mean '.mp4'?" in result.stderr
