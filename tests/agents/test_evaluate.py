"""The score of a player."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from agents import evaluate
from minigolf_env.courses import NINE
from minigolf_env.policies import load_policy


def test_fixed_seeds_give_the_same_score(tmp_path: Path) -> None:
    """Two evaluations agree, the file holds the score, and a random player is far from par."""
    file = tmp_path / "score.json"
    args = evaluate.Args(policy="random", episodes=8, json=file)
    score = evaluate.main(args)
    assert score == evaluate.evaluate(load_policy("random"), "random", args, quiet=True)
    assert json.loads(file.read_text())["strokes"] == score.strokes
    assert 3.0 < score.strokes <= 10.0
    assert score.strokes_interval[0] < score.strokes < score.strokes_interval[1]


def test_a_round_is_played_hole_by_hole() -> None:
    """Though each episode is seeded: its strokes are those of the holes alone."""
    holes = [evaluate.Args(course=name, episodes=1, first_seed=7 + k, max_strokes=2) for k, name in enumerate(NINE)]
    whole = evaluate.Args(course="round", episodes=9, first_seed=7, max_strokes=2)
    search = load_policy("search")
    alone = [evaluate.evaluate(search, "search", args, quiet=True).strokes for args in holes]
    assert evaluate.evaluate(search, "search", whole, quiet=True).strokes == np.mean(alone)


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
