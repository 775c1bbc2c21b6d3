"""Scores: intervals that are known, and the benchmark from the command line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env import cli
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.evaluation import benchmark as scoring


def test_wilson_interval_is_the_textbooks() -> None:
    """The bounds solve |share - p| = z sqrt(p (1 - p) / n); they stay in [0, 1] where every trial ended alike."""
    for successes, n in ((3, 10), (40, 50), (1, 500)):
        for p in scoring.wilson(successes, n):
            assert abs(successes / n - p) == pytest.approx(scoring.Z * math.sqrt(p * (1 - p) / n))
    assert scoring.wilson(0, 20)[0] == pytest.approx(0.0) and scoring.wilson(20, 20)[1] == pytest.approx(1.0)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Of a mean, and of the ratio of two."""
    rng = np.random.default_rng(0)
    held = []
    for _ in range(3000):
        y = rng.uniform(1.0, 3.0, 100)
        x = 1.5 * y + rng.normal(size=100)
        mean, ratio = scoring.mean_interval(y), scoring.ratio_interval(x, y)
        held.append((mean[0] < 2.0 < mean[1], ratio[0] < 1.5 < ratio[1]))
    assert (np.abs(np.mean(held, axis=0) - 0.95) < 0.02).all()


def test_the_benchmark(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It prints a row a set and writes every level's strokes, twice the same."""
    path = tmp_path / "scores.json"
    records = []
    for _ in range(2):
        cli.benchmark("random", ("easy",), levels=2, max_strokes=4, json=path)
        records.append(json.loads(path.read_text()))
    assert records[0] == records[1] and list(tmp_path.iterdir()) == [path]
    assert "held out" in capsys.readouterr().out
    train, held_out = records[0]["sets"]
    assert (train["levels"], train["first_level"], held_out["first_level"]) == ("train", 0, 1_000_000)
    assert len(train["by_level"]) == len(held_out["search_by_level"]) == 2
    assert train["strokes"] == np.mean([strokes for strokes, _ in train["by_level"]])
    assert train["relative"] == train["strokes"] / np.mean(train["search_by_level"])
    assert {"minigolf_env", "levels", "numpy"} <= set(records[0]["versions"])


def test_levels_are_played_together_as_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """A policy that takes many observations gets the levels' strokes that it would get alone."""

    class Aims:
        observation = "rays"

        def act(self, observation: NDArray[np.float32], env: MiniGolfEnv) -> NDArray[np.float32]:
            return np.asarray(observation[6:8] * np.float32(0.9))

    class AimsTogether(Aims):
        def act_many(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
            return np.asarray(observations[:, 6:8] * np.float32(0.9))

    sets = []
    for policy in (Aims(), AimsTogether()):
        monkeypatch.setattr(scoring, "load_policy", lambda name, seed, policy=policy: policy)
        sets.append(list(scoring.benchmark("aims", ("easy",), levels=4, max_strokes=4)))
    assert sets[0] == sets[1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"levels": 0}, "levels: expected at least 1, received 0"),
        ({"difficulties": ("hrad",)}, "did you mean 'hard'"),
        ({"name": "serach"}, "did you mean 'search'"),
    ],
)
def test_bad_requests_say_why(options: dict[str, object], message: str) -> None:
    """Before anything is played."""
    with pytest.raises(ValueError, match=message):
        next(scoring.benchmark(**({"name": "random"} | options)))  # type: ignore[arg-type]
