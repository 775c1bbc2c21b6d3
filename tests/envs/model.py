"""What an episode is, said again in a few lines: a model that tests play beside an environment, to the last bit.

It shares no rule with the package: it holds the public physics, the public courses, and numpy's generators.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from minigolf_env.courses import ROUND_HOLES, Course, Cup, load_course
from minigolf_env.courses.procedural import level_name
from minigolf_env.physics import Status, World

WORLDS: dict[str, tuple[Course, World]] = {}
"""By the course's name: they are built once."""


@dataclass(frozen=True)
class Rules:
    """The options of an environment that the model knows."""

    course: str = "dogleg"
    start_level: int = 0
    num_levels: int = 3
    max_strokes: int = 10
    tee: str = "random"
    putt_noise: tuple[float, float] = (0.0, 0.0)
    reward: str = "shaped"
    observation: str = "state"

    @property
    def options(self) -> dict[str, Any]:
        """The environment's arguments."""
        levels = () if self.course == "procedural" else ("start_level", "num_levels")
        return {name: value for name, value in vars(self).items() if name not in levels}

    @property
    def key(self) -> str | None:
        """What a hole's number is called; None: the hole has none."""
        return {"procedural": "level", "round": "hole"}.get(self.course)

    @property
    def first(self) -> int | None:
        """The number of the hole on which a ball lies that is put there before the first reset."""
        return {"procedural": self.start_level, "round": 1}.get(self.course)


@dataclass
class Model:
    """One episode. Without generator, nothing has begun."""

    rules: Rules
    rng: np.random.Generator | None = None
    hole: int | None = None
    position: tuple[float, ...] = ()
    strokes: int = 0
    over: bool = False
    last: tuple[str, float, int] = ("tee", 0.0, 0)
    """Status, time (s) and bounces of the last stroke."""

    @property
    def name(self) -> str:
        """The course that is played."""
        hole = self.rules.first if self.hole is None else self.hole
        if hole is None:
            return self.rules.course
        return ROUND_HOLES[hole - 1] if self.rules.course == "round" else level_name("easy", hole)

    @property
    def scene(self) -> tuple[Course, World, Cup]:
        """The course, its physics, its cup."""
        if self.name not in WORLDS:
            course = load_course(self.name)
            WORLDS[self.name] = course, course.world()
        course, world = WORLDS[self.name]
        assert course.cup is not None
        return course, world, course.cup

    def reset(self, seed: int | None, hole: int | None = None, position: tuple[float, ...] | None = None) -> None:
        """Begin an episode."""
        anew = seed is not None or self.rng is None
        if anew:
            self.rng, _ = seeding.np_random(seed)
        assert self.rng is not None
        if self.rules.course == "round":
            self.hole = hole or (1 if anew or self.hole is None else self.hole % len(ROUND_HOLES) + 1)
        elif self.rules.course == "procedural":
            drawn = self.rules.start_level + int(self.rng.integers(self.rules.num_levels)) if hole is None else hole
            self.hole = drawn
        self.position = self.sample_start() if position is None else position
        self.strokes, self.over, self.last = 0, False, ("tee", 0.0, 0)

    def sample_start(self) -> tuple[float, ...]:
        """Return where the ball lies, by the stream of random numbers."""
        assert self.rng is not None
        tee = self.scene[0].tee
        x, y = self.rng.random(2) if self.rules.tee == "random" else (0.5, 0.5)
        (a, b), (c, d) = tee.lower, tee.upper
        return float(a + x * (c - a)), float(b + y * (d - b)), tee.height + self.scene[0].ball_radius

    def aim(self, putt: Any) -> Any:
        """Return a putt; a number is a straight putt at the cup with that share of the top speed."""
        if not isinstance(putt, float):
            return putt
        if not self.position:
            return (0.0, putt)
        x, y = np.subtract(self.scene[2].position[:2], self.position[:2])
        return putt * x / np.hypot(x, y), putt * y / np.hypot(x, y)

    def step(self, action: Any) -> None:
        """Play a putt."""
        course, world, cup = self.scene
        assert self.rng is not None and not self.over
        x, y = (float(number) for number in action)
        share = course.top_speed / max(float(np.hypot(x, y)), 1.0)
        x, y = x * share, y * share
        if any(self.rules.putt_noise):
            turn, stretch = self.rng.standard_normal(2) * (
                math.radians(self.rules.putt_noise[0]),
                self.rules.putt_noise[1],
            )
            cos, sin, scale = np.cos(turn), np.sin(turn), max(0.0, 1.0 + stretch)
            x, y = (cos * x - sin * y) * scale, (sin * x + cos * y) * scale
        shot = world.simulate(self.position, (x, y, 0.0), 30.0)
        away = math.dist(shot.position[:2], cup.position[:2])
        holed = shot.status != Status.OUT_OF_BOUNDS and away < cup.radius and shot.position[2] < cup.position[2]
        if holed or shot.status == Status.REST:
            self.position = tuple(shot.position.tolist())
        self.strokes += 1
        self.over = holed or self.strokes == self.rules.max_strokes
        self.last = "holed" if holed else shot.status.name.lower(), shot.time, shot.bounces

    @property
    def state(self) -> dict[str, Any]:
        """What get_state returns."""
        assert self.rng is not None
        number = {} if self.rules.key is None else {self.rules.key: self.hole}
        state = {"position": self.position, "strokes": self.strokes, "over": self.over, **number}
        return state | {"np_random": self.rng.bit_generator.state}

    @property
    def above_the_tee(self) -> tuple[float, float, float]:
        """A place where a ball can be put (3,), m."""
        tee = self.scene[0].tee
        (a, b), (c, d) = tee.lower, tee.upper
        return 0.5 * (a + c), 0.5 * (b + d), tee.height + 2.0 * self.scene[0].ball_radius

    @property
    def info(self) -> dict[str, Any]:
        """What reset and step tell."""
        status, time, bounces = self.last
        number = {} if self.rules.key is None else {self.rules.key: self.hole}
        told = {"strokes": self.strokes, "is_success": status == "holed", "status": status, "shot_time": time}
        return told | {"bounces": bounces, "course": self.name, **number}

    def enter(self, state: dict[str, Any]) -> None:
        """Go on from a state, whose optional keys may be missing."""
        self.position = tuple(float(number) for number in state["position"])
        self.strokes, self.over = state.get("strokes", 0), bool(state.get("over", False))
        self.hole = state.get(self.rules.key, self.rules.first if self.hole is None else self.hole)
        if "np_random" in state:
            self.rng, _ = seeding.np_random(0)
            self.rng.bit_generator.state = state["np_random"]

    def is_seen(self, observation: np.ndarray) -> bool:
        """Return whether an observation tells where the ball lies and how many strokes are left."""
        lower, upper = np.array(self.scene[0].bounds)
        place = 2.0 * (np.array(self.position) - lower) / (upper - lower) - 1.0
        left = 1.0 - self.strokes / self.rules.max_strokes
        return bool(np.allclose([*observation[:3], observation[9]], [*np.clip(place, -1.0, 1.0), left], atol=1e-6))
