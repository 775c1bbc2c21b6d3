"""Evaluation of a policy on a hole, a round or levels."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env import cli
from minigolf_env.apps import commands
from minigolf_env.courses import ROUND_COURSE, ROUND_HOLES
from minigolf_env.courses.procedural import PROCEDURAL_COURSE
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.evaluation import evaluate as evaluate_module
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.players.policies import load_policy


class Straight:
    """A policy that putts straight at the cup, a little harder than necessary."""

    observation = "state"

    def act(self, observation: NDArray[np.float32], env: MiniGolfEnv) -> NDArray[np.float32]:
        """Return the putt (2,)."""
        return np.asarray(observation[6:8] * np.float32(0.9))


class StraightBatch(Straight):
    """The same policy for batches of observations."""

    def act_batch(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the putts (N, 2)."""
        return np.asarray(observations[:, 6:8] * np.float32(0.9))


@pytest.mark.parametrize("noise", [(0.0, 0.0), (2.0, 0.05)])
def test_batch_policy_gets_same_result_as_single_policy(
    noise: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Batches of any size give the result of single episodes, with noise and with episodes that end early."""
    monkeypatch.setattr(evaluate_module, "MAX_BATCH_EPISODES", 7)
    settings = {"episodes": 20, "max_strokes": 5, "quiet": True, "putt_noise": noise}
    single, batch = (evaluate(policy, "straight", "straight", **settings) for policy in (Straight(), StraightBatch()))  # type: ignore[arg-type]
    assert single == batch
    assert single.holed > 0.0 and 1.0 < single.strokes < 5.0


def test_command_prints_table_and_writes_reproducible_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The report has the seeds and the versions of libraries; a random policy is far from par."""
    file = tmp_path / "score.json"
    reports = []
    for _ in range(2):
        commands.evaluate("random", episodes=8, putt_noise=(1.0, 0.02), json=file)
        reports.append(json.loads(file.read_text()))
    assert reports[0] == reports[1] and list(tmp_path.iterdir()) == [file]
    assert "mean strokes" in capsys.readouterr().out
    score = reports[0]
    assert (score["policy"], score["course"], score["first_seed"]) == ("random", "dogleg", 1_000_000)
    assert score["putt_noise"] == [1.0, 0.02] and {"minigolf_env", "numba", "python"} <= set(score["versions"])
    low, high = score["strokes_interval"]
    assert 3.0 < score["strokes"] <= 10.0 and low < score["strokes"] < high


def test_search_scores_better_than_random() -> None:
    """Search holes out every time, in fewer strokes than the random policy."""
    search, random = (evaluate(load_policy(name), name, episodes=2, quiet=True) for name in ("search", "random"))
    assert search.holed == 1.0 and search.strokes < random.strokes


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--policy", "serch"], "did you mean 'search'"),
        (["--policy", "no.zip"], "there is none at no.zip"),
        (["--episodes", "0"], "--episodes: expected an integer from 1"),
        (["--difficulty", "easy"], "course='procedural'"),
        (["--first-seed", "-5"], "--first-seed: expected an integer >= 0"),
        (["--putt-noise", "-1", "0"], "--putt-noise"),
    ],
)
def test_command_reports_invalid_argument_without_traceback(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The program exits with the error message."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["evaluate", *words])
    assert caught.value.code == cli.EXIT_FAILED and message in capsys.readouterr().err


def test_watching_does_not_change_result(display: str, tmp_path: Path) -> None:
    """The putts are shown in a window during the evaluation; the report is the same."""
    watched = tmp_path / "watched.json"
    unwatched = tmp_path / "unwatched.json"
    words = ["evaluate", "--policy", "random", "--episodes", "1", "--max-strokes", "1", "--json"]
    command = [sys.executable, "-m", "minigolf_env.cli", *words, str(watched), "--watch"]
    subprocess.run(command, env={**os.environ, "DISPLAY": display}, check=True, timeout=300)
    cli.main([*words, str(unwatched)])
    assert watched.read_text() == unwatched.read_text()


def test_levels_are_played_in_order() -> None:
    """Episode i is on level first_seed + i, from the middle of its tee; a batch has the result of single episodes."""
    settings = {"difficulty": "easy", "episodes": 4, "max_strokes": 3, "first_seed": 50}
    single, batch = (
        evaluate(policy, "straight", PROCEDURAL_COURSE, **settings) for policy in (Straight(), StraightBatch())
    )  # type: ignore[arg-type]
    assert single == batch and (single.difficulty, single.first_seed) == ("easy", 50)


def test_round_is_played_hole_by_hole() -> None:
    """The mean strokes of a round are those of its holes evaluated alone, in a batch and one by one."""
    policy = Straight()
    holes = [
        evaluate(policy, "straight", name, episodes=1, first_seed=7 + k, max_strokes=3)
        for k, name in enumerate(ROUND_HOLES)
    ]
    single, batch = (
        evaluate(each, "straight", ROUND_COURSE, episodes=9, first_seed=7, max_strokes=3)
        for each in (policy, StraightBatch())
    )
    assert single == batch and single.strokes == np.mean([hole.strokes for hole in holes])


def test_report_of_single_episode_is_valid_json(tmp_path: Path) -> None:
    """Its interval is that of all possible scores. The folder of the file is made."""
    file = tmp_path / "new" / "score.json"
    commands.evaluate("search", episodes=1, json=file)
    score = json.loads(file.read_text(), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert score["strokes_interval"] == [1.0, 10.0] and score["difficulty"] is None
