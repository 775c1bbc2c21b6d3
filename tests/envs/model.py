"""A short reference model of an episode, which tests compare with the environment bit for bit.

It shares no rule with the package: it uses the public physics, the public courses and numpy's generators.
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
"""Courses and worlds by name; each is built once."""


@dataclass(frozen=True)
class Rules:
    """Arguments of an environment that the model supports."""

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
    def index_name(self) -> str | None:
        """The key of a level's or hole's number; None: the course has no numbers."""
        return {"procedural": "level", "round": "hole"}.get(self.course)

    @property
    def default_index(self) -> int | None:
        """The number of the level or hole before the first reset."""
        return {"procedural": self.start_level, "round": 1}.get(self.course)


@dataclass
class Model:
    """Reference model of one environment."""

    rules: Rules
    rng: np.random.Generator | None = None
    """RNG of the environment; None before the first reset."""
    hole: int | None = None
    position: tuple[float, ...] = ()
    strokes: int = 0
    over: bool = False
    last: tuple[str, float, int] = ("tee", 0.0, 0)
    """Status, time (s) and bounces of the last stroke."""

    @property
    def name(self) -> str:
        """The name of the course."""
        hole = self.rules.default_index if self.hole is None else self.hole
        if hole is None:
            return self.rules.course
        return ROUND_HOLES[hole - 1] if self.rules.course == "round" else level_name("easy", hole)

    @property
    def course_world_cup(self) -> tuple[Course, World, Cup]:
        """The course, its world and its cup."""
        if self.name not in WORLDS:
            course = load_course(self.name)
            WORLDS[self.name] = course, course.world()
        course, world = WORLDS[self.name]
        assert course.cup is not None
        return course, world, course.cup

    def reset(self, seed: int | None, hole: int | None = None, position: tuple[float, ...] | None = None) -> None:
        """Start an episode."""
        is_restart = seed is not None or self.rng is None
        if is_restart:
            self.rng, _ = seeding.np_random(seed)
        assert self.rng is not None
        if self.rules.course == "round":
            self.hole = hole or (1 if is_restart or self.hole is None else self.hole % len(ROUND_HOLES) + 1)
        elif self.rules.course == "procedural":
            drawn = self.rules.start_level + int(self.rng.integers(self.rules.num_levels)) if hole is None else hole
            self.hole = drawn
        self.position = self.sample_start() if position is None else position
        self.strokes, self.over, self.last = 0, False, ("tee", 0.0, 0)

    def sample_start(self) -> tuple[float, ...]:
        """Return where the ball starts, drawn from the generator."""
        assert self.rng is not None
        tee = self.course_world_cup[0].tee
        x, y = self.rng.random(2) if self.rules.tee == "random" else (0.5, 0.5)
        (a, b), (c, d) = tee.lower, tee.upper
        return float(a + x * (c - a)), float(b + y * (d - b)), tee.height + self.course_world_cup[0].ball_radius

    def to_action(self, putt: Any) -> Any:
        """Return the action of a putt; a number is a straight putt at the cup with that fraction of the top speed."""
        if not isinstance(putt, float):
            return putt
        if not self.position:
            return (0.0, putt)
        x, y = np.subtract(self.course_world_cup[2].position[:2], self.position[:2])
        return putt * x / np.hypot(x, y), putt * y / np.hypot(x, y)

    def step(self, action: Any) -> None:
        """Play a putt."""
        course, world, cup = self.course_world_cup
        assert self.rng is not None and not self.over
        x, y = (float(number) for number in action)
        share = course.top_speed / max(math.sqrt(x * x + y * y), 1.0)
        x, y = x * share, y * share
        if any(self.rules.putt_noise):
            turn, stretch = self.rng.standard_normal(2) * (
                math.radians(self.rules.putt_noise[0]),
                self.rules.putt_noise[1],
            )
            cos, sin, scale = np.cos(turn), np.sin(turn), max(0.0, 1.0 + stretch)
            x, y = (cos * x - sin * y) * scale, (sin * x + cos * y) * scale
        shot = world.simulate(self.position, (x, y, 0.0), 30.0)
        distance = math.dist(shot.position[:2], cup.position[:2])
        holed = shot.status != Status.OUT_OF_BOUNDS and distance < cup.radius and shot.position[2] < cup.position[2]
        if holed or shot.status == Status.REST:
            self.position = tuple(shot.position.tolist())
        self.strokes += 1
        self.over = holed or self.strokes == self.rules.max_strokes
        self.last = "holed" if holed else shot.status.name.lower(), shot.time, shot.bounces

    @property
    def state(self) -> dict[str, Any]:
        """The state that get_state returns."""
        assert self.rng is not None
        number = {} if self.rules.index_name is None else {self.rules.index_name: self.hole}
        state = {"position": self.position, "strokes": self.strokes, "over": self.over, **number}
        return state | {"np_random": self.rng.bit_generator.state}

    @property
    def above_the_tee(self) -> tuple[float, float, float]:
        """A place where a ball can start (3,), m."""
        tee = self.course_world_cup[0].tee
        (a, b), (c, d) = tee.lower, tee.upper
        return 0.5 * (a + c), 0.5 * (b + d), tee.height + 2.0 * self.course_world_cup[0].ball_radius

    @property
    def info(self) -> dict[str, Any]:
        """The info that reset and step return."""
        status, time, bounces = self.last
        number = {} if self.rules.index_name is None else {self.rules.index_name: self.hole}
        info = {"strokes": self.strokes, "is_success": status == "holed", "status": status, "shot_time": time}
        return info | {"bounces": bounces, "course": self.name, **number}

    def resume(self, state: dict[str, Any]) -> None:
        """Resume a state, whose optional keys may be missing."""
        self.position = tuple(float(number) for number in state["position"])
        self.strokes, self.over = state.get("strokes", 0), bool(state.get("over", False))
        self.hole = state.get(self.rules.index_name, self.rules.default_index if self.hole is None else self.hole)
        if "np_random" in state:
            self.rng, _ = seeding.np_random(0)
            self.rng.bit_generator.state = state["np_random"]

    def is_observed(self, observation: np.ndarray) -> bool:
        """Return true if an observation encodes the ball's place and the strokes left."""
        lower, upper = np.array(self.course_world_cup[0].bounds)
        place = 2.0 * (np.array(self.position) - lower) / (upper - lower) - 1.0
        left = 1.0 - self.strokes / self.rules.max_strokes
        return bool(np.allclose([*observation[:3], observation[9]], [*np.clip(place, -1.0, 1.0), left], atol=1e-6))
