"""The score of a player on a hole, a round or levels."""

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
from minigolf_env.courses import NINE, ROUND
from minigolf_env.courses.procedural import PROCEDURAL
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.evaluation import evaluate as evaluation
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.players.policies import load_policy


class Aims:
    """Putts straight at the cup, a little harder than it takes."""

    observation = "state"

    def act(self, observation: NDArray[np.float32], env: MiniGolfEnv) -> NDArray[np.float32]:
        """Return the putt (2,)."""
        return np.asarray(observation[6:8] * np.float32(0.9))


class AimsTogether(Aims):
    """The same for many balls."""

    def act_many(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the putts (N, 2)."""
        return np.asarray(observations[:, 6:8] * np.float32(0.9))


@pytest.mark.parametrize("noise", [(0.0, 0.0), (2.0, 0.05)])
def test_together_is_one_after_the_other(noise: tuple[float, float], monkeypatch: pytest.MonkeyPatch) -> None:
    """A batch gives the score of single episodes, whatever its size: with noise, and with episodes that end early."""
    monkeypatch.setattr(evaluation, "BATCH", 7)
    settings = {"episodes": 20, "max_strokes": 5, "quiet": True, "putt_noise": noise}
    one, many = (evaluate(policy, "aims", "straight", **settings) for policy in (Aims(), AimsTogether()))  # type: ignore[arg-type]
    assert one == many
    assert one.holed > 0.0 and 1.0 < one.strokes < 5.0


def test_the_command_says_the_same_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It prints the score and writes it with seeds and versions; a random player is far from par."""
    file, records = tmp_path / "score.json", []
    for _ in range(2):
        cli.evaluate("random", episodes=8, putt_noise=(1.0, 0.02), json=file)
        records.append(json.loads(file.read_text()))
    assert records[0] == records[1] and list(tmp_path.iterdir()) == [file]
    assert "mean strokes" in capsys.readouterr().out
    score = records[0]
    assert (score["policy"], score["course"], score["first_seed"]) == ("random", "dogleg", 1_000_000)
    assert score["putt_noise"] == [1.0, 0.02] and {"minigolf_env", "numba", "python"} <= set(score["versions"])
    low, high = score["strokes_interval"]
    assert 3.0 < score["strokes"] <= 10.0 and low < score["strokes"] < high


def test_search_plays_better_than_random() -> None:
    """Search holes out, in fewer strokes."""
    search, random = (evaluate(load_policy(name), name, episodes=2, quiet=True) for name in ("search", "random"))
    assert search.holed == 1.0 and search.strokes < random.strokes


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--policy", "serch"], "did you mean 'search'"),
        (["--policy", "no.zip"], "there is none at no.zip"),
        (["--episodes", "0"], "episodes: expected at least 1"),
        (["--difficulty", "easy"], "course='procedural'"),
        (["--first-seed", "-5"], "first_seed: expected at least 0"),
        (["--putt-noise", "-1", "0"], "putt_noise"),
    ],
)
def test_a_users_mistake_ends_with_one_line(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    """No traceback: the program exits with the message."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["evaluate", *words])
    assert caught.value.code == cli.FAILED and message in capsys.readouterr().err


def test_watching_changes_no_score(display: str, tmp_path: Path) -> None:
    """The putts are shown in a window meanwhile."""
    watched, blind = tmp_path / "watched.json", tmp_path / "blind.json"
    words = ["evaluate", "--policy", "random", "--episodes", "1", "--max-strokes", "1", "--json"]
    command = [sys.executable, "-m", "minigolf_env.cli", *words, str(watched), "--watch"]
    subprocess.run(command, env={**os.environ, "DISPLAY": display}, check=True, timeout=300)
    cli.main([*words, str(blind)])
    assert watched.read_text() == blind.read_text()


def test_levels_are_played_one_after_the_other() -> None:
    """Episode i on level first_seed + i, from the middle of its tee; in a batch as one by one."""
    settings = {"difficulty": "easy", "episodes": 4, "max_strokes": 3, "first_seed": 50}
    one, many = (evaluate(policy, "aims", PROCEDURAL, **settings) for policy in (Aims(), AimsTogether()))  # type: ignore[arg-type]
    assert one == many and (one.difficulty, one.first_seed) == ("easy", 50)


def test_a_round_is_played_hole_by_hole() -> None:
    """Though each episode is seeded: its strokes are those of the holes alone, in a batch as one by one."""
    aims = Aims()
    holes = [evaluate(aims, "aims", name, episodes=1, first_seed=7 + k, max_strokes=3) for k, name in enumerate(NINE)]
    one, many = (evaluate(p, "aims", ROUND, episodes=9, first_seed=7, max_strokes=3) for p in (aims, AimsTogether()))
    assert one == many and one.strokes == np.mean([hole.strokes for hole in holes])


def test_a_single_episode_is_json_too(tmp_path: Path) -> None:
    """Its interval has no ends: null, which any reader of JSON takes. The file's folder is made."""
    file = tmp_path / "new" / "score.json"
    cli.evaluate("search", episodes=1, json=file)
    score = json.loads(file.read_text(), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert score["strokes_interval"] == [None, None] and score["difficulty"] is None
