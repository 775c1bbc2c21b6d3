"""Playing opens no socket, starts no program and unpickles nothing, as Python's audit events show."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

WATCHED_EVENTS = ("socket.", "subprocess.", "os.system", "os.exec", "os.fork", "os.posix_spawn", "pickle.find_class")
"""Prefixes of the names of audit events: see "Audit events table" in Python's documentation."""

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

play()  # Loads the cache of compiled kernels, which this machine pickled itself.
events = []
sys.addaudithook(lambda event, _: event.startswith({watched_events!r}) and events.append(event))
play()
{code}
print(*events)
"""

WINDMILL = str(ROOT / "docs" / "examples" / "windmill.toml")
BOULDER = str(ROOT / "docs" / "examples" / "boulder.glb")


def audit_events(code: str) -> list[str]:
    """Return the watched events of a process that plays an episode and then runs ``code``."""
    program = PROGRAM.format(watched_events=WATCHED_EVENTS, code=code)
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.parametrize(
    "code",
    [
        "play('round')",
        "play('procedural')",
        f"play({WINDMILL!r})",
        f"play({BOULDER!r})",
        "env = MiniGolfEnv(); load_policy('ppo').act(env.reset(seed=1)[0], env)",
    ],
)
def test_playing_and_loading_cause_no_watched_event(code: str) -> None:
    """Bundled courses, course files and the pretrained model need no network, program or pickle."""
    assert audit_events(code) == []


def test_loading_a_model_file_unpickles_nothing(tmp_path: Path) -> None:
    """This package reads stable-baselines3's file without unpickling; PPO.load unpickles it."""
    sb3 = pytest.importorskip("stable_baselines3")
    path = str(tmp_path / "model.zip")
    from minigolf_env.envs import MiniGolfEnv

    sb3.PPO("MlpPolicy", MiniGolfEnv(), n_steps=8, batch_size=8, device="cpu").save(path)
    assert audit_events(f"load_policy({path!r})") == []
    assert "pickle.find_class" in audit_events(f"import stable_baselines3; stable_baselines3.PPO.load({path!r})")


def test_audit_hook_reports_sockets_processes_and_pickles() -> None:
    """The tests above would fail if such an event occurred."""
    code = "import os, pickle, socket, subprocess; socket.socket(); subprocess.run([sys.executable, '-c', ''])"
    assert {event.partition(".")[0] for event in audit_events(f"{code}; pickle.loads(pickle.dumps(print))")} >= {
        "socket",
        "subprocess",
        "pickle",
    }
