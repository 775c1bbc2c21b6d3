"""The benchmark: results, JSON report, batches and argument checks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.apps import commands
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.evaluation import benchmark as benchmark_module
from minigolf_env.evaluation.benchmark import benchmark


def test_command_prints_table_and_writes_reproducible_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table has a row for each set; the report has the strokes of every level and is the same twice."""
    path = tmp_path / "scores.json"
    reports = []
    for _ in range(2):
        commands.benchmark("random", ("easy",), levels=2, max_strokes=4, json=path)
        reports.append(json.loads(path.read_text()))
    assert reports[0] == reports[1] and list(tmp_path.iterdir()) == [path]
    assert "held out" in capsys.readouterr().out
    train, held_out = reports[0]["sets"]
    assert (train["level_set"], train["first_level"], held_out["first_level"]) == ("train", 0, 1_000_000)
    assert len(train["by_level"]) == len(held_out["search_by_level"]) == 2
    assert train["strokes"] == np.mean([strokes for strokes, _ in train["by_level"]])
    assert train["relative"] == train["strokes"] / np.mean(train["search_by_level"])
    assert {"minigolf_env", "levels", "numpy"} <= set(reports[0]["versions"])


def test_batch_policy_gets_same_results_as_single_policy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Levels played in a batch have the strokes of levels played one after another."""

    class Straight:
        observation = "rays"

        def act(self, observation: NDArray[np.float32], env: MiniGolfEnv) -> NDArray[np.float32]:
            return np.asarray(observation[6:8] * np.float32(0.9))

    class StraightBatch(Straight):
        def act_batch(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
            return np.asarray(observations[:, 6:8] * np.float32(0.9))

    results = []
    for policy in (Straight(), StraightBatch()):
        monkeypatch.setattr(benchmark_module, "load_policy", lambda name, seed, policy=policy: policy)
        results.append(list(benchmark("straight", ("easy",), num_levels=4, max_strokes=4)))
    assert results[0] == results[1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"num_levels": 0}, "levels: expected an integer from 1 to 1000000, received 0"),
        ({"num_levels": 10**12}, "levels: expected an integer from 1 to 1000000, received 1000000000000"),
        ({"difficulties": ("hrad",)}, "did you mean 'hard'"),
        ({"policy_name": "serach"}, "did you mean 'search'"),
    ],
)
def test_rejects_invalid_arguments(options: dict[str, object], message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Invalid arguments are rejected before any level is played."""
    monkeypatch.setattr(benchmark_module, "_evaluate_set", lambda *args: pytest.fail("levels were played"))
    with pytest.raises(ValueError, match=message):
        next(benchmark(**({"policy_name": "random"} | options)))  # type: ignore[arg-type]
