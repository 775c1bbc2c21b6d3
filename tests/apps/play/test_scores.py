"""Tests of the score card, and of the file of best scores with its failures."""

import json
from pathlib import Path

import pytest

from minigolf_env.apps.play.scores import BestScores, HoleScore, ScoreCard, score_message


def test_totals_are_over_the_holes_that_the_human_has_played() -> None:
    """Marks show practice scores and holes that were not holed out."""
    card = ScoreCard({"dogleg": 2, "hill_top": 3, "last": 4}, ["You", "search"])
    card.put("You", "dogleg", HoleScore(3, True))
    card.put("search", "dogleg", HoleScore(1, True))
    card.put("You", "hill_top", HoleScore(10, False, is_practice=True))
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
    ("score", "message"),
    [
        (HoleScore(1, True), "Hole in one!"),
        (HoleScore(2, True), "Holed in 2: Par"),
        (HoleScore(3, True), "Holed in 3: Bogey"),
        (HoleScore(9, True), "Holed in 9"),
        (HoleScore(10, False), "Not holed within 10 strokes"),
    ],
)
def test_finished_hole_is_announced_with_golfs_names(score: HoleScore, message: str) -> None:
    """The message has the number of strokes and the score's name relative to par."""
    assert score_message(score, 2) == message


def test_only_a_better_score_replaces_the_best(tmp_path: Path) -> None:
    """Practice scores and holes not holed out never do; the next game reads the best score."""
    path = tmp_path / "new" / "scores.json"
    best = BestScores(path)
    assert best.offer("dogleg", HoleScore(4, True))
    assert not best.offer("dogleg", HoleScore(5, True))
    assert not best.offer("dogleg", HoleScore(1, True, is_practice=True))
    assert not best.offer("dogleg", HoleScore(1, False))
    assert BestScores(path).strokes_by_hole == {"dogleg": 4}
    assert [file.name for file in path.parent.iterdir()] == ["scores.json"]


def test_two_games_at_once_keep_both_scores(tmp_path: Path) -> None:
    """Scores that another game has written since the start are kept."""
    first, second = BestScores(tmp_path / "s"), BestScores(tmp_path / "s")
    first.offer("dogleg", HoleScore(2, True))
    second.offer("other", HoleScore(3, True))
    assert not second.offer("dogleg", HoleScore(3, True))
    assert BestScores(tmp_path / "s").strokes_by_hole == {"dogleg": 2, "other": 3}


@pytest.mark.parametrize(
    "content",
    ["", "{", "[]", '{"version": 1, "best": {"dogleg": 0}}', '{"version": 1, "best": {"dogleg": "2"}}', "[" * 100_000],
)
def test_damaged_file_is_renamed(tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str) -> None:
    """One warning is printed, the damaged file keeps its content, and new scores are stored."""
    path = tmp_path / "scores.json"
    path.write_text(content)
    best = BestScores(path)
    assert best.strokes_by_hole == {}
    assert best.offer("dogleg", HoleScore(2, True))
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert "renamed to scores.json.damaged" in errors
    assert (tmp_path / "scores.json.damaged").read_text() == content
    assert json.loads(path.read_text())["best"] == {"dogleg": 2}


def test_file_that_is_not_utf8_is_renamed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Bytes that are not UTF-8 count as damage."""
    (tmp_path / "scores.json").write_bytes(b"\xff\xfe\x00")
    assert BestScores(tmp_path / "scores.json").strokes_by_hole == {}
    assert "renamed to" in capsys.readouterr().err


def test_folder_that_cannot_be_written_is_ignored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The game keeps the scores in memory and prints one warning."""
    (tmp_path / "file").write_text("not a folder")
    best = BestScores(tmp_path / "file" / "scores.json")
    assert best.offer("dogleg", HoleScore(3, True))
    assert best.offer("dogleg", HoleScore(2, True))
    assert best.strokes_by_hole == {"dogleg": 2}
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert "cannot be" in errors
