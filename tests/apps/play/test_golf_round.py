"""Tests of a round without a window: turns, undo, the opponent, predictions, throws."""

from pathlib import Path

import numpy as np
import pytest

from minigolf_env.apps.play.aim import Aim
from minigolf_env.apps.play.golf_round import GolfRound
from minigolf_env.apps.play.scores import BestScores
from minigolf_env.apps.play.stroke import HUMAN_NAME
from minigolf_env.apps.play.throw_mode import ThrowMode
from minigolf_env.courses import ROUND_HOLES, list_courses, load_course
from minigolf_env.envs.observations import OBSERVATIONS
from minigolf_env.players.mlp import MLP, Layer
from minigolf_env.players.mlp_policy import MLPPolicy
from minigolf_env.players.model_files import save_model
from minigolf_env.players.policies import ModelPolicy, Policy, SearchPolicy

SOFT_PUTT = Aim(0.1, 0.0)


def new_round(folder: Path, opponent: Policy | None = None) -> GolfRound:
    """Return a round on the dogleg."""
    return GolfRound("dogleg", BestScores(folder / "scores.json"), opponent, "search")


def card_row(golf: GolfRound) -> list[str]:
    """Return the dogleg's row of the score card."""
    return next(cells for cells in golf.card.rows({}) if cells[0] == "Dogleg")


def test_stroke_has_the_path_of_the_environments_step(tmp_path: Path) -> None:
    """The path starts at the ball and ends at its next position."""
    golf = new_round(tmp_path)
    start = golf.ball
    stroke = golf.strike(SOFT_PUTT)
    assert stroke.status == "rest"
    assert np.array_equal(stroke.path[0], start)
    assert np.array_equal(stroke.path[-1], stroke.next_position)
    assert np.array_equal(golf.ball, stroke.next_position)
    assert (golf.strokes, golf.is_over) == (1, False)


def test_hint_holes_out_and_the_score_is_stored(tmp_path: Path) -> None:
    """Search finds a hole-in-one from the tee; asking for it changes nothing; playing it ends the hole."""
    golf = new_round(tmp_path)
    before = golf.ball
    hint = golf.hint()
    assert np.array_equal(golf.ball, before)
    assert np.array_equal(golf.full_path(hint)[-1], golf.strike(hint).next_position)
    assert golf.is_over
    assert golf.score_message(HUMAN_NAME) == "Hole in one!"
    assert BestScores(tmp_path / "scores.json").strokes_by_hole == {"dogleg": 1}


def test_undo_restores_the_ball_and_marks_the_score_as_practice(tmp_path: Path) -> None:
    """A practice score is marked on the card and never stored as a best score."""
    golf = new_round(tmp_path)
    assert not golf.undo()
    start = golf.ball
    golf.strike(SOFT_PUTT)
    golf.strike(SOFT_PUTT)
    assert golf.undo() and golf.undo() and not golf.undo()
    assert np.array_equal(golf.ball, start)
    assert (golf.strokes, golf.is_practice) == (0, True)
    golf.strike(golf.hint())
    assert card_row(golf) == ["Dogleg", "2", "1 *", "–"]
    assert golf.best_scores.strokes_by_hole == {}
    assert golf.undo() and not golf.is_over
    assert golf.score_message(HUMAN_NAME) == ""


def test_next_hole_starts_with_a_clear_row_and_no_undo(tmp_path: Path) -> None:
    """The first hole follows the last; its row is empty again and there is nothing to undo."""
    golf = new_round(tmp_path)
    start = golf.ball
    golf.strike(SOFT_PUTT)
    golf.undo()
    golf.strike(SOFT_PUTT)
    for _ in golf.holes:
        golf.next_hole()
    assert golf.hole == "dogleg"
    assert np.array_equal(golf.ball, start)
    assert not golf.is_practice and not golf.undo()


def test_round_has_nine_holes(tmp_path: Path) -> None:
    """A game that starts at a single hole continues through all bundled holes."""
    golf = GolfRound("round", BestScores(tmp_path / "scores.json"))
    assert (golf.hole, golf.holes, len(golf.card.pars)) == ("straight", list(ROUND_HOLES), 9)
    for _ in range(9):
        golf.next_hole()
    assert golf.hole == "straight" and new_round(tmp_path).holes == list_courses()


def test_stroke_limit_ends_the_hole(tmp_path: Path) -> None:
    """A score at the stroke limit is not a best score."""
    golf = new_round(tmp_path)
    while not golf.is_over:
        golf.strike(SOFT_PUTT)
    assert "10 (out)" in card_row(golf)
    assert golf.best_scores.strokes_by_hole == {}


def test_opponent_plays_the_hole_after_the_human(tmp_path: Path) -> None:
    """It starts at the same tee and plays until it holes out; undo removes its score too."""
    golf = new_round(tmp_path, SearchPolicy())
    tee = golf.ball
    assert not golf.is_opponents_turn
    golf.strike(golf.hint())
    assert golf.is_opponents_turn
    assert np.array_equal(golf.displayed_ball, tee)
    stroke = golf.opponent_strike(golf.opponent_putt())
    assert (stroke.player, stroke.status) == ("search", "holed")
    assert not golf.is_opponents_turn
    assert card_row(golf) == ["Dogleg", "2", "1", "1", "–"]
    golf.undo()
    assert golf.card.get("search", "dogleg") is None


def test_opponent_receives_the_observation_of_its_model(tmp_path: Path) -> None:
    """A model for the observation "rays" receives rays."""
    inputs = OBSERVATIONS["rays"].space().shape[0]
    layer = Layer(np.zeros((inputs, 2), np.float32), np.array([0.1, 0.0], np.float32))
    save_model(MLPPolicy(MLP((layer,))), tmp_path / "rays.npz")
    golf = new_round(tmp_path, ModelPolicy(tmp_path / "rays.npz"))
    golf.strike(golf.hint())
    assert golf.opponent_putt().tolist() == pytest.approx([0.1, 0.0])


def test_rejects_opponents_putt_without_an_opponent(tmp_path: Path) -> None:
    """The error message says that the opponent is missing."""
    with pytest.raises(ValueError, match="opponent: expected a policy"):
        new_round(tmp_path).opponent_putt()


def test_prediction_ends_shortly_after_the_first_bounce(tmp_path: Path) -> None:
    """The prediction equals the full path up to the border and ends within PREDICTION_AFTER_BOUNCE."""
    golf = new_round(tmp_path)
    aim = Aim(0.0, 0.5)  # Perpendicular to a border.
    prediction = golf.predict_path(aim)
    path = golf.full_path(aim)
    border = 1.25 - load_course("dogleg").ball_radius
    assert prediction[:, 1].max() == pytest.approx(border, abs=1e-6)
    bounce = int(np.argmax(prediction[:, 1]))
    assert np.array_equal(prediction[:bounce], path[:bounce])
    assert 0.05 < border - prediction[-1, 1] < 0.35


def test_prediction_without_a_bounce_is_the_full_path(tmp_path: Path) -> None:
    """A soft putt is predicted until it rests."""
    golf = new_round(tmp_path)
    assert np.array_equal(golf.predict_path(SOFT_PUTT), golf.full_path(SOFT_PUTT))


def test_throw_starts_at_the_tee_and_bounces() -> None:
    """The aim gives speed and elevation; the next throw starts at the tee again."""
    room = ThrowMode(load_course("room"))
    aim = Aim(0.5, 0.0, elevation=30.0)
    assert np.linalg.norm(room.launch_velocity(aim)) == pytest.approx(3.0)
    assert room.launch_velocity(aim)[2] == pytest.approx(1.5)
    stroke = room.strike(aim)
    assert np.array_equal(stroke.path[0], room.ball)
    assert np.array_equal(stroke.next_position, room.ball)
    assert room.strokes == 1
    assert len(room.predict_path(aim)) < len(stroke.path)
