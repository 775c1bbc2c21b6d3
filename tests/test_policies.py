"""Players behind one interface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from minigolf_env.envs import MiniGolfEnv
from minigolf_env.policies import RandomPolicy, load_policy


def test_random_putts_fill_the_disc_evenly() -> None:
    """Uniform in the disc: the mean squared length is 1/2, no direction is preferred, and a seed repeats them."""
    env = MiniGolfEnv()
    observation, _ = env.reset(seed=0)
    policy = RandomPolicy(seed=1)
    putts = np.array([policy.act(observation, env) for _ in range(4000)])
    lengths = np.hypot(*putts.T)
    assert lengths.max() <= 1.0 + 1e-6
    assert (lengths**2).mean() == pytest.approx(0.5, abs=0.03)
    assert np.abs(putts.mean(axis=0)).max() < 0.03
    assert np.array_equal(putts[0], RandomPolicy(seed=1).act(observation, env))


def test_unknown_players_are_refused(tmp_path: Path) -> None:
    """The error guesses the name, or says that the file is not there."""
    with pytest.raises(ValueError, match="did you mean 'search'"):
        load_policy("serch")
    with pytest.raises(FileNotFoundError, match=r"\.zip"):
        load_policy(tmp_path / "model.zip")
