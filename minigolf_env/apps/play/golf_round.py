"""The rules of a round of golf, without a window: whose turn it is, the strokes, the score card, undo.

Each player has a MiniGolfEnv, so that the rules are the environment's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env.apps.play.aim import Aim
from minigolf_env.apps.play.scores import BestScores, HoleScore, ScoreCard, score_message
from minigolf_env.apps.play.stroke import HUMAN_NAME, FloatArray, PlayedStroke, path_to_first_bounce
from minigolf_env.courses import ROUND_COURSE, ROUND_HOLES, Course, list_courses, par_of
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.players.policies import Policy
from minigolf_env.players.search import search


class GolfRound:
    """A round on the bundled holes, alone or against a policy that plays each hole after the human.

    Args:
        hole: the first hole; "round" starts a round of nine.
        best_scores: the best scores so far.
        opponent: the policy to play against; None to play alone.
        opponent_name: name of the opponent on the score card.

    Raises:
        ValueError: there is no such hole.
    """

    default_elevation = 0.0
    """Elevation of a stroke before the player changes it, degrees above the horizon; putts have 0."""

    def __init__(
        self, hole: str, best_scores: BestScores, opponent: Policy | None = None, opponent_name: str = "opponent"
    ) -> None:
        holes = list(ROUND_HOLES) if hole == ROUND_COURSE else list_courses()
        first_hole = holes[0] if hole == ROUND_COURSE else hole
        self.holes = holes if first_hole in holes else [first_hole]
        self.best_scores = best_scores
        self.opponent_name = opponent_name
        self._opponent = opponent
        players = [HUMAN_NAME] if opponent is None else [HUMAN_NAME, opponent_name]
        self.card = ScoreCard({name: par_of(name) or 0 for name in self.holes}, players)
        self.start_hole(first_hole)

    def start_hole(self, hole: str) -> None:
        """Put the ball on the tee of a hole and clear the hole's row on the score card."""
        self.hole = hole
        observation = "state" if self._opponent is None else self._opponent.observation
        self._env = MiniGolfEnv(hole, tee="fixed")
        self._opponent_env = MiniGolfEnv(hole, tee="fixed", observation=observation)
        self._env.reset(seed=0)
        self._opponent_observation, _ = self._opponent_env.reset(seed=0)
        self._undo_states: list[dict[str, Any]] = []
        self._is_practice = False
        self.card.erase(hole)

    @property
    def course(self) -> Course:
        """Course of the current hole."""
        return self._env.task.course

    @property
    def top_speed(self) -> float:
        """Speed of a putt at full power, m/s."""
        return self._env.task.top_speed

    @property
    def strokes(self) -> int:
        """Number of strokes that the human has played on this hole."""
        return int(self._env.get_state()["strokes"])

    @property
    def ball(self) -> FloatArray:
        """Centre of the human's ball (3,), m."""
        return np.array(self._env.get_state()["position"])

    @property
    def is_practice(self) -> bool:
        """True if a stroke of this hole was undone; such a score is never kept as a best score."""
        return self._is_practice

    @property
    def is_over(self) -> bool:
        """True if the human has finished the hole."""
        return bool(self._env.get_state()["over"])

    @property
    def is_opponents_turn(self) -> bool:
        """True if the human has finished the hole and the opponent has not."""
        return self._opponent is not None and self.is_over and self.card.get(self.opponent_name, self.hole) is None

    @property
    def displayed_ball(self) -> FloatArray:
        """Centre (3,), m, of the ball of the player whose turn it is."""
        env = self._opponent_env if self.is_opponents_turn else self._env
        return np.array(env.get_state()["position"])

    def launch_velocity(self, aim: Aim) -> FloatArray:
        """Return the velocity (3,), m/s, at which a stroke launches the ball."""
        return np.asarray(self._env.task.launch_velocity(np.array([aim.x, aim.y])))

    def strike(self, aim: Aim) -> PlayedStroke:
        """Play the human's putt."""
        self._undo_states.append(self._env.get_state())
        stroke, score = self._play(self._env, HUMAN_NAME, np.array([aim.x, aim.y]))
        if score is not None:
            score = score._replace(is_practice=self._is_practice)
            self.card.put(HUMAN_NAME, self.hole, score)
            self.best_scores.offer(self.hole, score)
        return stroke

    def undo(self) -> bool:
        """Undo the human's last stroke on this hole; return False if there is none."""
        if not self._undo_states:
            return False
        self._env.set_state(self._undo_states.pop())
        self._is_practice = True
        self.card.erase(self.hole)
        self._opponent_observation, _ = self._opponent_env.reset(seed=0)
        return True

    def next_hole(self) -> None:
        """Start the next hole; the first hole follows the last."""
        self.start_hole(self.holes[(self.holes.index(self.hole) + 1) % len(self.holes)])

    def opponent_putt(self) -> NDArray[np.float32]:
        """Return the action that the opponent chooses.

        This may take seconds and changes nothing, so call it in a thread.

        Raises:
            ValueError: there is no opponent.
        """
        if self._opponent is None:
            raise ValueError("opponent: expected a policy, received none; pass one to GolfRound.")
        return self._opponent.act(self._opponent_observation, self._opponent_env)

    def opponent_strike(self, putt: NDArray[np.float32]) -> PlayedStroke:
        """Play the opponent's putt."""
        stroke, score = self._play(self._opponent_env, self.opponent_name, putt)
        if score is not None:
            self.card.put(self.opponent_name, self.hole, score)
        return stroke

    def hint(self) -> Aim:
        """Return the best putt that search finds.

        This may take seconds and works on a copy of the environment, so call it in a thread.
        """
        env = MiniGolfEnv(self.course, tee="fixed")
        env.reset(seed=0)
        env.set_state({"position": tuple(self.ball)})
        x, y = search(env).action.tolist()
        return Aim(x, y)

    def predict_path(self, aim: Aim) -> FloatArray:
        """Return the path (K, 3), m, to shortly after the first bounce."""
        return path_to_first_bounce(self._env.task.world, self.ball, self.launch_velocity(aim))

    def full_path(self, aim: Aim) -> FloatArray:
        """Return the path (T, 3), m, until the ball rests."""
        return self._env.task.simulate_path(self.ball, self.launch_velocity(aim))[0]

    def score_message(self, player: str) -> str:
        """Return the announcement of a player's score; empty while the player has not finished the hole."""
        score = self.card.get(player, self.hole)
        return "" if score is None else score_message(score, self.card.pars[self.hole])

    def _play(
        self, env: MiniGolfEnv, player: str, putt: FloatArray | NDArray[np.float32]
    ) -> tuple[PlayedStroke, HoleScore | None]:
        """Play a putt; return it, and the player's score if it finished the hole."""
        start = np.array(env.get_state()["position"])
        path, times = env.task.simulate_path(start, env.task.launch_velocity(np.asarray(putt, dtype=np.float64)))
        observation, _, terminated, _, info = env.step(putt)
        if env is self._opponent_env:
            self._opponent_observation = observation
        stroke = PlayedStroke(player, path, times, np.array(env.get_state()["position"]), info["status"])
        return stroke, HoleScore(info["strokes"], info["is_success"]) if terminated else None
