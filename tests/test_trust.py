"""What the package asks of Python while it plays: no network, no other program, no pickled code."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

WATCHED = ("socket.", "subprocess.", "os.system", "os.exec", "os.fork", "os.posix_spawn", "pickle.find_class")
"""Beginnings of the names of audit events: see "Audit events table" in Python's documentation."""

PROGRAM = """
import sys
import gymnasium as gym, numpy as np, minigolf_env
from minigolf_env.courses import load_course
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.players.policies import load_policy

def play(course="dogleg"):
    env = gym.make("MiniGolf-v0", course=course)
    env.reset(seed=1)
    env.step(env.action_space.sample())
    envs = gym.make_vec("MiniGolf-v0", num_envs=64)
    envs.reset(seed=1)
    envs.step(envs.action_space.sample())

play()  # Compiled kernels are read by now: they are pickled, and one's own.
seen = []
sys.addaudithook(lambda event, _: event.startswith({watched!r}) and seen.append(event))
play()
{what}
print(*seen)
"""

WINDMILL = str(ROOT / "docs" / "examples" / "windmill.toml")
BOULDER = str(ROOT / "docs" / "examples" / "boulder.glb")


def asked(what: str) -> list[str]:
    """Return the watched events while a program plays, and does what is asked."""
    program = PROGRAM.format(watched=WATCHED, what=what)
    got = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert got.returncode == 0, got.stderr
    return got.stdout.split()


@pytest.mark.parametrize(
    "what",
    [
        "play('round')",
        "play('procedural')",
        f"play({WINDMILL!r})",
        f"play({BOULDER!r})",
        "env = MiniGolfEnv(); load_policy('ppo').act(env.reset(seed=1)[0], env)",
    ],
)
def test_nothing_else_is_asked_for(what: str) -> None:
    """Playing, loading files and the model that ships."""
    assert asked(what) == []


def test_a_strangers_model_runs_no_code(tmp_path: Path) -> None:
    """Reading stable-baselines3's file by this package unpickles nothing; by its own load it does."""
    sb3 = pytest.importorskip("stable_baselines3")
    path = str(tmp_path / "model.zip")
    from minigolf_env.envs import MiniGolfEnv

    sb3.PPO("MlpPolicy", MiniGolfEnv(), n_steps=8, batch_size=8, device="cpu").save(path)
    assert asked(f"load_policy({path!r})") == []
    assert "pickle.find_class" in asked(f"import stable_baselines3; stable_baselines3.PPO.load({path!r})")


def test_the_watch_notices() -> None:
    """Each kind of event."""
    deeds = "import os, pickle, socket, subprocess; socket.socket(); subprocess.run([sys.executable, '-c', ''])"
    assert {event.partition(".")[0] for event in asked(f"{deeds}; pickle.loads(pickle.dumps(print))")} >= {
        "socket",
        "subprocess",
        "pickle",
    }
