"""A round of golf without a window: whose turn it is, what was struck, what may be taken back.

The rules are MiniGolfEnv's: each player has one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.apps.play.aim import Aim
from minigolf_env.apps.play.scores import BestScores, Card, Score, praise
from minigolf_env.courses import NINE, ROUND, Course, list_courses, par_of
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.physics import World
from minigolf_env.players.policies import Policy
from minigolf_env.players.search import search

FloatArray = NDArray[np.float64]

YOU = "You"
"""The human's name."""

BEYOND = 0.3
"""How far a prediction goes on after the first bounce, m."""

LOOK_AHEAD = 8.0
"""And how long the ball moves in it at most, s."""

UPRIGHT = 0.7
"""A contact whose normal points up by more than this is with the ground: no bounce that a player aims at."""


class Stroke(NamedTuple):
    """A ball that was struck, or thrown."""

    who: str
    path: FloatArray
    """(T, 3) the ball's centre at ``times``, m."""
    times: FloatArray
    """(T,) s."""
    lies: FloatArray
    """(3,) where the ball lies then, m."""
    status: str
    """As in MiniGolfEnv's info."""


class Game:
    """A round over the bundled holes, alone or against a policy that plays each hole after you.

    Args:
        hole: the first; "round": of a round of nine.
        best: the best scores so far.
        opponent: a policy that plays too; None: nobody does.
        rival: what it is called on the card.

    Raises:
        ValueError: there is no such hole.
    """

    elevation = 0.0
    """Of strokes above the horizon at first, degrees: putts roll."""

    def __init__(self, hole: str, best: BestScores, opponent: Policy | None = None, rival: str = "opponent") -> None:
        holes = list(NINE) if hole == ROUND else list_courses()
        hole = holes[0] if hole == ROUND else hole
        self.holes = holes if hole in holes else [hole]
        self.best = best
        self.rival = rival
        self._policy = opponent
        players = [YOU] if opponent is None else [YOU, rival]
        self.card = Card({name: par_of(name) or 0 for name in self.holes}, players)
        self.start(hole)

    def start(self, hole: str) -> None:
        """Go to a hole's tee; its row on the card becomes empty."""
        self.hole = hole
        seen = "state" if self._policy is None else self._policy.observation
        self._env, self._rival_env = MiniGolfEnv(hole, tee="fixed"), MiniGolfEnv(hole, tee="fixed", observation=seen)
        self._env.reset(seed=0)
        self._seen, _ = self._rival_env.reset(seed=0)
        self._past: list[dict[str, Any]] = []
        self._practice = False
        self.card.erase(hole)

    @property
    def course(self) -> Course:
        """Where the present hole is played."""
        return self._env.task.course

    @property
    def top_speed(self) -> float:
        """Of a full putt, m/s."""
        return self._env.task.top_speed

    @property
    def strokes(self) -> int:
        """Of the human, at this hole."""
        return int(self._env.get_state()["strokes"])

    @property
    def ball(self) -> FloatArray:
        """Where the human's ball lies (3,), m."""
        return np.array(self._env.get_state()["position"])

    @property
    def practice(self) -> bool:
        """Whether strokes of this hole were taken back."""
        return self._practice

    @property
    def is_over(self) -> bool:
        """Whether the human has finished the hole."""
        return bool(self._env.get_state()["over"])

    @property
    def awaits_rival(self) -> bool:
        """Whether it is the opponent's turn."""
        return self._policy is not None and self.is_over and self.card.get(self.rival, self.hole) is None

    @property
    def shown(self) -> FloatArray:
        """The ball (3,), m, of the player whose turn it is."""
        env = self._rival_env if self.awaits_rival else self._env
        return np.array(env.get_state()["position"])

    def velocity(self, aim: Aim) -> FloatArray:
        """Return what a stroke launches the ball with (3,), m/s."""
        return np.asarray(self._env.task.launch_velocity(np.array([aim.x, aim.y])))

    def strike(self, aim: Aim) -> Stroke:
        """Play the human's putt."""
        self._past.append(self._env.get_state())
        stroke, score = self._play(self._env, YOU, np.array([aim.x, aim.y]))
        if score is not None:
            self.card.put(YOU, self.hole, score._replace(practice=self._practice))
            self.best.offer(self.hole, score._replace(practice=self._practice))
        return stroke

    def undo(self) -> bool:
        """Take back the human's last stroke of this hole; return whether there was one."""
        if not self._past:
            return False
        self._env.set_state(self._past.pop())
        self._practice = True
        self.card.erase(self.hole)
        self._seen, _ = self._rival_env.reset(seed=0)
        return True

    def next_hole(self) -> None:
        """Go to the next hole, after the last to the first."""
        self.start(self.holes[(self.holes.index(self.hole) + 1) % len(self.holes)])

    def rival_choice(self) -> NDArray[np.float32]:
        """Return the putt that the opponent chooses; it may take long, and changes nothing: call it in a thread."""
        if self._policy is None:
            raise ValueError("opponent: expected one, there is none; give the Game one.")
        return self._policy.act(self._seen, self._rival_env)

    def rival_strike(self, putt: NDArray[np.float32]) -> Stroke:
        """Play the opponent's putt."""
        stroke, score = self._play(self._rival_env, self.rival, putt)
        if score is not None:
            self.card.put(self.rival, self.hole, score)
        return stroke

    def hint(self) -> Aim:
        """Return the putt that search finds best; it looks at a copy of the game: call it in a thread."""
        env = MiniGolfEnv(self.course, tee="fixed")
        env.reset(seed=0)
        env.set_state({"position": tuple(self.ball)})
        x, y = search(env).action.tolist()
        return Aim(x, y)

    def foresee(self, aim: Aim) -> FloatArray:
        """Return the way (K, 3), m, up to the first bounce and a little on."""
        return foreseen(self._env.task.world, self.ball, self.velocity(aim))

    def way(self, aim: Aim) -> FloatArray:
        """Return the whole way (T, 3), m."""
        return self._env.task.simulate_path(self.ball, self.velocity(aim))[0]

    def verdict(self, who: str) -> str:
        """Return how to announce that a player has finished the hole; empty before."""
        score = self.card.get(who, self.hole)
        return "" if score is None else praise(score, self.card.pars[self.hole])

    def _play(self, env: MiniGolfEnv, who: str, putt: FloatArray | NDArray[np.float32]) -> tuple[Stroke, Score | None]:
        """Return a putt, and the player's score if it was the last of the hole."""
        before = np.array(env.get_state()["position"])
        path, times = env.task.simulate_path(before, env.task.launch_velocity(np.asarray(putt, dtype=np.float64)))
        seen, _, over, _, info = env.step(putt)
        if env is self._rival_env:
            self._seen = seen
        stroke = Stroke(who, path, times, np.array(env.get_state()["position"]), info["status"])
        return stroke, Score(info["strokes"], info["is_success"]) if over else None


def foreseen(world: World, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return the way (K, 3), m, of a ball up to its first bounce off something other than the ground, and BEYOND."""
    shot = world.simulate(position, velocity, LOOK_AHEAD, record=True)
    path, times, contacts = np.asarray(shot.path), np.asarray(shot.times), shot.contacts
    if contacts is None or not len(bounces := contacts[contacts["normal"][:, 2] < UPRIGHT]):
        return path
    first = bounces[0]
    before, after = path[times < first["time"]], path[times > first["time"]]
    way = np.concatenate([first["position"][None], after])
    gone = np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))
    return np.concatenate([before, way[: 1 + np.searchsorted(gone, BEYOND)]])
