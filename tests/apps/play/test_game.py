"""A round without a window: turns, undo, the opponent, predictions, throws."""

from pathlib import Path

import numpy as np
import pytest

from minigolf_env.apps.play.aim import Aim
from minigolf_env.apps.play.game import YOU, Game
from minigolf_env.apps.play.scores import BestScores
from minigolf_env.apps.play.throwing import Throwing
from minigolf_env.courses import NINE, list_courses, load_course
from minigolf_env.envs.observations import OBSERVATIONS
from minigolf_env.players.network import Layer, Network
from minigolf_env.players.policies import ModelPolicy, Policy, SearchPolicy

SOFT = Aim(0.1, 0.0)


def new_game(folder: Path, opponent: Policy | None = None) -> Game:
    """Return a round on the dogleg."""
    return Game("dogleg", BestScores(folder / "scores.json"), opponent, "search")


def row(game: Game) -> list[str]:
    """Return what the card says of the dogleg."""
    return next(cells for cells in game.card.rows({}) if cells[0] == "Dogleg")


def test_a_stroke_is_what_the_environment_plays(tmp_path: Path) -> None:
    """The path shown begins where the ball was struck and ends where it lies."""
    game = new_game(tmp_path)
    start = game.ball
    stroke = game.strike(SOFT)
    assert stroke.status == "rest"
    assert np.array_equal(stroke.path[0], start)
    assert np.array_equal(stroke.path[-1], stroke.lies)
    assert np.array_equal(game.ball, stroke.lies)
    assert (game.strokes, game.is_over) == (1, False)


def test_a_hint_holes_out_and_is_kept(tmp_path: Path) -> None:
    """Search finds a hole in one from the tee; asking changes nothing; playing it ends the hole."""
    game = new_game(tmp_path)
    before = game.ball
    hint = game.hint()
    assert np.array_equal(game.ball, before)
    assert np.array_equal(game.way(hint)[-1], game.strike(hint).lies)
    assert game.is_over
    assert game.verdict(YOU) == "Hole in one!"
    assert BestScores(tmp_path / "scores.json").best == {"dogleg": 1}


def test_undo_takes_back_and_makes_it_practice(tmp_path: Path) -> None:
    """The ball lies where it lay; the score is marked, and is never a best one."""
    game = new_game(tmp_path)
    assert not game.undo()
    start = game.ball
    game.strike(SOFT)
    game.strike(SOFT)
    assert game.undo() and game.undo() and not game.undo()
    assert np.array_equal(game.ball, start)
    assert (game.strokes, game.practice) == (0, True)
    game.strike(game.hint())
    assert row(game) == ["Dogleg", "2", "1 *", "–"]
    assert game.best.best == {}
    assert game.undo() and not game.is_over
    assert game.verdict(YOU) == ""


def test_the_next_hole_begins_anew(tmp_path: Path) -> None:
    """After the last hole comes the first; its row is empty again and nothing can be taken back."""
    game = new_game(tmp_path)
    start = game.ball
    game.strike(SOFT)
    game.undo()
    game.strike(SOFT)
    for _ in game.holes:
        game.next_hole()
    assert game.hole == "dogleg"
    assert np.array_equal(game.ball, start)
    assert not game.practice and not game.undo()


def test_a_round_has_nine_holes(tmp_path: Path) -> None:
    """From the first; a game that starts at one hole goes through all there are."""
    game = Game("round", BestScores(tmp_path / "scores.json"))
    assert (game.hole, game.holes, len(game.card.pars)) == ("straight", list(NINE), 9)
    for _ in range(9):
        game.next_hole()
    assert game.hole == "straight" and new_game(tmp_path).holes == list_courses()


def test_strokes_run_out(tmp_path: Path) -> None:
    """The last stroke ends the hole, and such a score is no best one."""
    game = new_game(tmp_path)
    while not game.is_over:
        game.strike(SOFT)
    assert "10 (out)" in row(game)
    assert game.best.best == {}


def test_the_opponent_plays_after_the_human(tmp_path: Path) -> None:
    """From the same tee, until it has finished; undo takes its score away too."""
    game = new_game(tmp_path, SearchPolicy())
    tee = game.ball
    assert not game.awaits_rival
    game.strike(game.hint())
    assert game.awaits_rival
    assert np.array_equal(game.shown, tee)
    stroke = game.rival_strike(game.rival_choice())
    assert (stroke.who, stroke.status) == ("search", "holed")
    assert not game.awaits_rival
    assert row(game) == ["Dogleg", "2", "1", "1", "–"]
    game.undo()
    assert game.card.get("search", "dogleg") is None


def test_the_opponent_sees_what_it_was_trained_with(tmp_path: Path) -> None:
    """A model of "rays" gets them."""
    inputs = OBSERVATIONS["rays"].space().shape[0]
    rays = Network((Layer(np.zeros((inputs, 2), np.float32), np.array([0.1, 0.0], np.float32)),))
    rays.save(tmp_path / "rays.npz")
    game = new_game(tmp_path, ModelPolicy(tmp_path / "rays.npz"))
    game.strike(game.hint())
    assert game.rival_choice().tolist() == pytest.approx([0.1, 0.0])


def test_without_an_opponent_nobody_chooses(tmp_path: Path) -> None:
    """Asking for its putt says what is missing."""
    with pytest.raises(ValueError, match="opponent: expected one"):
        new_game(tmp_path).rival_choice()


def test_a_prediction_is_the_putt_up_to_its_first_bounce(tmp_path: Path) -> None:
    """It agrees with the path to the border and goes on a little."""
    game = new_game(tmp_path)
    aim = Aim(0.0, 0.5)  # Straight at a border.
    way, path = game.foresee(aim), game.way(aim)
    border = 1.25 - load_course("dogleg").ball_radius
    assert way[:, 1].max() == pytest.approx(border, abs=1e-6)
    bounce = int(np.argmax(way[:, 1]))
    assert np.array_equal(way[:bounce], path[:bounce])
    assert 0.05 < border - way[-1, 1] < 0.35


def test_a_soft_putt_is_foreseen_to_its_end(tmp_path: Path) -> None:
    """Without a bounce the prediction is the whole path."""
    game = new_game(tmp_path)
    assert np.array_equal(game.foresee(SOFT), game.way(SOFT))


def test_a_throw_starts_at_the_tee_and_bounces() -> None:
    """Speed and elevation are the aim's; the next throw starts there again."""
    room = Throwing(load_course("room"))
    aim = Aim(0.5, 0.0, elevation=30.0)
    assert np.linalg.norm(room.velocity(aim)) == pytest.approx(3.0)
    assert room.velocity(aim)[2] == pytest.approx(1.5)
    stroke = room.strike(aim)
    assert np.array_equal(stroke.path[0], room.ball)
    assert np.array_equal(stroke.lies, room.ball)
    assert room.strokes == 1
    assert len(room.foresee(aim)) < len(stroke.path)
