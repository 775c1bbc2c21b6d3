"""The score of a player."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from agents import evaluate
from minigolf_env.policies import load_policy


def test_wilson_interval_is_the_textbooks() -> None:
    """The bounds solve |share - p| = z sqrt(p (1 - p) / n); they stay in [0, 1] where every trial ended alike."""
    for successes, n in ((3, 10), (40, 50), (1, 500)):
        for p in evaluate.wilson(successes, n):
            assert abs(successes / n - p) == pytest.approx(evaluate.Z * math.sqrt(p * (1 - p) / n))
    assert evaluate.wilson(0, 20)[0] == pytest.approx(0.0) and evaluate.wilson(20, 20)[1] == pytest.approx(1.0)


def test_fixed_seeds_give_the_same_score(tmp_path: Path) -> None:
    """Two evaluations agree, the file holds the score, and a random player is far from par."""
    file = tmp_path / "score.json"
    args = evaluate.Args(policy="random", episodes=8, json=file)
    score = evaluate.main(args)
    assert score == evaluate.evaluate(load_policy("random"), "random", args, quiet=True)
    assert json.loads(file.read_text())["strokes"] == score.strokes
    assert 3.0 < score.strokes <= 10.0
    assert score.strokes_interval[0] < score.strokes < score.strokes_interval[1]


@pytest.mark.parametrize(
    "args", [evaluate.Args(policy="serch"), evaluate.Args(policy="no.zip"), evaluate.Args(episodes=0)], ids=str
)
def test_a_users_mistake_ends_with_one_line(args: evaluate.Args) -> None:
    """No traceback: the program exits with the message."""
    with pytest.raises(SystemExit, match="expected"):
        evaluate.main(args)


def test_search_plays_better_than_random() -> None:
    """Search holes out, in fewer strokes."""
    args = evaluate.Args(episodes=2)
    search, random = (evaluate.evaluate(load_policy(name), name, args, quiet=True) for name in ("search", "random"))
    assert search.holed == 1.0 and search.strokes < random.strokes
