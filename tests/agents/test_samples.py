"""The sample programs for SAC and images on tiny budgets, with PPO where a law holds for all."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents import train_pixels, train_ppo, train_sac
from agents.run_evaluation import EvalCheckpointCallback
from agents.train_pixels import PixelsConfig
from agents.train_ppo import PPOConfig
from agents.train_sac import SACConfig

TINY: dict[str, Any] = {
    "total_timesteps": 64,
    "n_envs": 8,
    "eval_freq": 32,
    "n_eval_episodes": 2,
    "n_test_episodes": 2,
    "n_search_episodes": 0,
}

TINY_PPO = PPOConfig(**TINY, n_steps=4, batch_size=16, reward="strokes", putt_noise=(0.5, 0.015))
TINY_SAC = SACConfig(**TINY, learning_starts=16, gradient_steps=1, batch_size=8)
TINY_PIXELS = PixelsConfig(**TINY, n_steps=4, batch_size=16)


@pytest.mark.parametrize(("program", "config"), [(train_ppo, TINY_PPO), (train_sac, TINY_SAC)], ids=["PPO", "SAC"])
def test_sample_trains_and_evaluates(program: Any, config: Any, tmp_path: Path) -> None:
    """All time steps are used, the best model is evaluated, and another program cannot resume the run."""
    folder = tmp_path / "run"
    scores = program.main(dataclasses.replace(config, out=folder))
    history = json.loads((folder / "progress.json").read_text())
    assert history[-1]["timesteps"] >= TINY["total_timesteps"] and len(history) >= 2
    assert scores[-1].policy == ("SAC" if program is train_sac else "PPO") and scores[-1].episodes == 2
    assert (folder / "best.zip").is_file()
    other: Any = train_sac.main if program is train_ppo else train_ppo.main
    other_config: Any = SACConfig if program is train_ppo else PPOConfig
    with pytest.raises(SystemExit, match="of another"):
        other(other_config(resume=folder))


def test_sample_on_images_trains_and_evaluates(gl: None, tmp_path: Path) -> None:
    """The same holds for the sample that learns from images, where OpenGL works."""
    test_sample_trains_and_evaluates(train_pixels, TINY_PIXELS, tmp_path)


@pytest.mark.parametrize(
    ("program", "config"),
    [
        (train_ppo, PPOConfig(**TINY, n_steps=4, batch_size=16)),
        (train_sac, SACConfig(**TINY, learning_starts=16, gradient_steps=1, batch_size=16)),
    ],
    ids=["PPO", "SAC"],
)
def test_resumed_run_plays_other_tees(
    program: Any, config: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A resumed run starts from other tees than before, and logs to its folder even if that was moved."""
    first_observations: list[np.ndarray] = []
    on_training_start = EvalCheckpointCallback._on_training_start

    def record_observations(callback: EvalCheckpointCallback) -> None:
        on_training_start(callback)
        first_observations.append(np.array(callback.model._last_obs))  # type: ignore[attr-defined]

    monkeypatch.setattr(EvalCheckpointCallback, "_on_training_start", record_observations)
    before, after = tmp_path / "a", tmp_path / "b"
    program.main(dataclasses.replace(config, out=before))
    stored = json.loads((before / "config.json").read_text())
    (before / "config.json").write_text(json.dumps({**stored, "total_timesteps": 128}))
    before.rename(after)
    program.main(dataclasses.replace(config, resume=after))
    assert len(first_observations) == 2 and not np.array_equal(*first_observations)
    assert not before.exists() and list(after.glob("log_*"))
