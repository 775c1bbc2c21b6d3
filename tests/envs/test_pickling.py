"""Copies continue with the same bits: by pickle or deepcopy, in another process, next to other threads."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.physics import thread_pool
from tests.envs.pickling import ENV_KINDS, make, play

ROOT = Path(__file__).parents[2]
COPY_METHODS: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy,
    **{f"pickle {p}": lambda env, p=p: pickle.loads(pickle.dumps(env, p)) for p in (2, 5)},  # noqa: S301 (ours)
}


@pytest.mark.parametrize("copy_method", COPY_METHODS)
@pytest.mark.parametrize(("name", "mode"), ENV_KINDS)
def test_copy_continues_with_the_same_bits(name: str, mode: str | None, copy_method: str) -> None:
    """A copy is made in the middle of an episode; the original and an earlier copy do not change."""
    env = make(name, mode)
    env.reset(seed=3)
    play(env, 3, 0)
    before = env.get_state()
    first, second = COPY_METHODS[copy_method](env), COPY_METHODS[copy_method](COPY_METHODS[copy_method](env))
    first_hash = play(first, 6, 100)
    assert env.get_state() == second.get_state() == before
    assert first_hash == play(second, 6, 100) == play(env, 6, 100)
    assert first.get_state() == env.get_state() != before


@pytest.mark.parametrize("copy_method", COPY_METHODS)
@pytest.mark.parametrize("mode", [None, "NextStep"])
def test_copy_before_the_first_reset_needs_a_reset(mode: str | None, copy_method: str) -> None:
    """A copy plays as the original does after its first reset."""
    env = make("levels", mode)
    other = COPY_METHODS[copy_method](env)
    with pytest.raises(ResetNeeded):
        other.get_state()
    assert other.reset(seed=5)[0].tobytes() == env.reset(seed=5)[0].tobytes()
    assert play(other, 3, 0) == play(env, 3, 0)


@pytest.mark.parametrize("copy_method", COPY_METHODS)
@pytest.mark.parametrize("mode", [None, "SameStep"])
def test_copy_renders_the_same_frames(mode: str | None, copy_method: str, gl: None) -> None:
    """Frames that were not rendered yet are copied, too."""
    show: dict[str, Any] = {"render_mode": "rgb_array_list", "render_size": (32, 24), "render_profile": "fast"}
    env: Any = MiniGolfEnv(**show) if mode is None else MiniGolfVectorEnv(2, autoreset_mode=mode, **show)
    env.reset(seed=3)
    env.step(np.full((2,) if mode is None else (2, 2), 0.3))
    other = COPY_METHODS[copy_method](env)
    ours, theirs = ([env.render()], [other.render()]) if mode is None else (env.render(), other.render())
    for some, others in zip(ours, theirs, strict=True):
        assert len(some) == len(others) > 1 and all(map(np.array_equal, some, others))


@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_other_process_continues_with_the_same_bits(method: str) -> None:
    """Environments sent to a process continue equally, for every start method."""
    command = [sys.executable, "-W", "error", "-m", "tests.envs.pickling", method]
    done = subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=600, check=False)
    lines = [line.split() for line in done.stdout.splitlines()]
    assert done.returncode == 0 and len(lines) == len(ENV_KINDS), done.stderr
    assert all(child_hash == own_hash for child_hash, own_hash in lines)
    assert len({own_hash for _, own_hash in lines}) == len(ENV_KINDS)


@pytest.fixture
def fast_thread_switches() -> Iterator[None]:
    """Switch threads a thousand times as often as usual, so that races show soon."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-3 * before)
    yield
    sys.setswitchinterval(before)


def test_environments_in_threads_do_not_affect_each_other(
    fast_thread_switches: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Environments and batches made and played in threads have the results of those played alone."""
    monkeypatch.setattr(thread_pool, "_num_threads", lambda: 2)

    def one(which: int) -> str:
        env = make(*ENV_KINDS[which % len(ENV_KINDS)])
        env.reset(seed=which)
        return play(env, 6, which)

    alone = [one(which) for which in range(2 * len(ENV_KINDS))]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(one, range(2 * len(ENV_KINDS)))) == alone
