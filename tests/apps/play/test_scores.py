"""The score card, and the file of best scores with all that may be wrong with it."""

import json
from pathlib import Path

import pytest

from minigolf_env.apps.play.scores import BestScores, Card, Score, praise


def test_a_card_adds_up_the_holes_played() -> None:
    """Sums are over the holes that the human has played; marks tell practice and unfinished holes."""
    card = Card({"dogleg": 2, "hill_top": 3, "last": 4}, ["You", "search"])
    card.put("You", "dogleg", Score(3, True))
    card.put("search", "dogleg", Score(1, True))
    card.put("You", "hill_top", Score(10, False, practice=True))
    assert card.rows({"dogleg": 2, "last": 3}) == [
        ["Hole", "Par", "You", "search", "Best"],
        ["Dogleg", "2", "3", "1", "2"],
        ["Hill top", "3", "10 (out) *", "–", "–"],
        ["Last", "4", "–", "–", "3"],
        ["Total", "5", "13", "1", "2"],
    ]
    card.erase("dogleg")
    assert card.get("search", "dogleg") is None


@pytest.mark.parametrize(
    ("score", "words"),
    [
        (Score(1, True), "Hole in one!"),
        (Score(2, True), "Holed in 2: Par"),
        (Score(3, True), "Holed in 3: Bogey"),
        (Score(9, True), "Holed in 9"),
        (Score(10, False), "Not holed within 10 strokes"),
    ],
)
def test_scores_have_names(score: Score, words: str) -> None:
    """A finished hole is announced as golfers do."""
    assert praise(score, 2) == words


def test_the_best_score_is_kept(tmp_path: Path) -> None:
    """Only a better one replaces it; practice and unfinished holes never do; the next game finds it."""
    path = tmp_path / "new" / "scores.json"
    best = BestScores(path)
    assert best.offer("dogleg", Score(4, True))
    assert not best.offer("dogleg", Score(5, True))
    assert not best.offer("dogleg", Score(1, True, practice=True))
    assert not best.offer("dogleg", Score(1, False))
    assert BestScores(path).best == {"dogleg": 4}
    assert [file.name for file in path.parent.iterdir()] == ["scores.json"]


def test_two_games_at_once_lose_no_score(tmp_path: Path) -> None:
    """What another game wrote meanwhile stays."""
    first, second = BestScores(tmp_path / "s"), BestScores(tmp_path / "s")
    first.offer("dogleg", Score(2, True))
    second.offer("other", Score(3, True))
    assert not second.offer("dogleg", Score(3, True))
    assert BestScores(tmp_path / "s").best == {"dogleg": 2, "other": 3}


@pytest.mark.parametrize(
    "content",
    ["", "{", "[]", '{"version": 1, "best": {"dogleg": 0}}', '{"version": 1, "best": {"dogleg": "2"}}', "[" * 100_000],
)
def test_a_damaged_file_is_set_aside(tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str) -> None:
    """It is said once, the file is kept under another name, and scores are kept again."""
    path = tmp_path / "scores.json"
    path.write_text(content)
    best = BestScores(path)
    assert best.best == {}
    assert best.offer("dogleg", Score(2, True))
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "set aside as scores.json.damaged" in said
    assert (tmp_path / "scores.json.damaged").read_text() == content
    assert json.loads(path.read_text())["best"] == {"dogleg": 2}


def test_bytes_that_are_no_text_are_set_aside(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file that is not UTF-8 is a damaged one."""
    (tmp_path / "scores.json").write_bytes(b"\xff\xfe\x00")
    assert BestScores(tmp_path / "scores.json").best == {}
    assert "set aside" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_put_up_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The game goes on with the scores it knows, and says so once."""
    (tmp_path / "file").write_text("not a folder")
    best = BestScores(tmp_path / "file" / "scores.json")
    assert best.offer("dogleg", Score(3, True))
    assert best.offer("dogleg", Score(2, True))
    assert best.best == {"dogleg": 2}
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "cannot be" in said
