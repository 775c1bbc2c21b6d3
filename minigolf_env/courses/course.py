"""What a course is: records that check themselves, so that every Course that exists can be played.

Metres and seconds, z up. "In plan" means x and y.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np

from minigolf_env._validation import finite_array, one_of, positive_number
from minigolf_env.physics import TriangleMesh, World

Point2: TypeAlias = tuple[float, float]
Point3: TypeAlias = tuple[float, float, float]
Material: TypeAlias = Literal["felt", "wood", "stone", "wall", "cup", "brick", "paint", "water"]
Color: TypeAlias = tuple[float, float, float]

GOLF_BALL = 0.02135
"""Radius of a golf ball, m: the smallest the rules of golf allow (diameter 42.67 mm)."""

EARTH: Point3 = (0.0, 0.0, -9.81)
"""Gravity, m/s^2."""


class CourseError(ValueError):
    """A course, or a request for one, is at fault; the message says what, expected, received and remedy."""


@dataclass(frozen=True)
class Cup:
    """The hole to play: a cylinder sunk into the floor.

    Raises:
        CourseError: a value is not finite, or a length not positive.
    """

    position: Point3
    """Centre of the rim, on the floor's level, m."""
    radius: float = 0.054
    """m; the rules of golf's 108 mm across."""
    depth: float = 0.10
    """From the rim to the bottom, m; the least that the rules of golf allow (101.6 mm), rounded."""

    def __post_init__(self) -> None:
        with faults_of("cup"):
            finite_array(self.position, (3,), "position", "give x, y, z of the rim's centre in metres.")
            positive_number(self.radius, "radius", "the rules of golf have 0.054 m.")
            positive_number(self.depth, "depth", "0.1 m suits a golf ball.")

    def check_takes(self, ball_radius: float) -> None:
        """Raise a CourseError unless a ball of this radius (m) fits into the cup and lies below the rim there."""
        for what, size in (("radius", self.radius), ("depth", self.depth)):
            if not size > ball_radius:
                raise CourseError(
                    f"cup {what}: expected more than the ball's radius, {ball_radius:g} m, received {size!r}; "
                    "the ball has to drop below the rim."
                )


@dataclass(frozen=True)
class Tee:
    """The box in plan in which the ball's centre starts; a box without extent is a point.

    Raises:
        CourseError: a value is not finite, or ``lower`` is above ``upper``.
    """

    lower: Point2
    """Corner of the box with the smallest x and y, m."""
    upper: Point2
    """Corner with the largest, m."""
    height: float
    """Level z of the floor below the ball, m; where the ball starts in the air, that of the ball's lowest point."""

    def __post_init__(self) -> None:
        with faults_of("tee"):
            lower = finite_array(self.lower, (2,), "lower", "give x, y in metres.")
            upper = finite_array(self.upper, (2,), "upper", "give x, y in metres.")
            finite_array(self.height, (), "height", "give the floor's level in metres.")
            if not (lower <= upper).all():
                raise CourseError(f"expected lower <= upper, received {self.lower}, {self.upper}; swap the corners.")

    @property
    def centre(self) -> Point2:
        """The middle of the box in plan, m."""
        return (self.lower[0] + self.upper[0]) / 2.0, (self.lower[1] + self.upper[1]) / 2.0


@dataclass(frozen=True, eq=False)
class Part:
    """A named piece of a course.

    Raises:
        CourseError: the mesh is not closed, the material is unknown, or the colour out of range.
    """

    name: str
    mesh: TriangleMesh
    """Closed, its faces wound so that they look at the ball."""
    material: Material
    """What it looks like; how it plays is its mesh's surface."""
    color: Color | None = None
    """What the material is dyed, red, green and blue in [0, 1] (sRGB); None: its own colour."""

    def __post_init__(self) -> None:
        with faults_of(f"part {self.name!r}"):
            one_of(self.material, get_args(Material), "material")
            if self.color is not None:
                shares = finite_array(self.color, (3,), "color", "give red, green, blue in [0, 1].")
                if not ((shares >= 0.0) & (shares <= 1.0)).all():
                    raise CourseError(f"color: expected shares in [0, 1], received {self.color}; divide by 255.")
            if self.mesh.two_sided:  # A one-sided TriangleMesh is closed.
                raise CourseError(
                    f"mesh: expected a closed, one-sided TriangleMesh, received {self.mesh!r}; "
                    "close its holes and wind its faces alike, so that a ball has no way in."
                )


@dataclass(frozen=True, eq=False)
class Course:
    """A place to play: meshes, where the ball starts, and the cup if there is one. Immutable, compared by identity.

    Raises:
        CourseError: a field is not what it says below.
    """

    name: str
    parts: tuple[Part, ...]
    """At least one."""
    tee: Tee
    cup: Cup | None
    """None: a room to throw a ball in, without golf."""
    par: int | None
    """Strokes a good player needs, >= 1; None without cup."""
    bounds: tuple[Point3, Point3]
    """Lower and upper corner, m: a ball whose centre leaves the box is out of bounds."""
    route: tuple[Point2, ...]
    """The way of play in plan, m: from the tee's centre to the cup, turning tightly around inner corners of the lane;
    what a ball goes around on the way (obstacles) is left out. Empty without cup."""
    top_speed: float
    """Launch speed of a full putt, m/s."""
    ball_radius: float = GOLF_BALL
    """m."""
    gravity: Point3 = EARTH
    """m/s^2."""

    def __post_init__(self) -> None:
        with faults_of(f"course {self.name!r}"):
            if not self.parts or not all(isinstance(part, Part) for part in self.parts):
                raise CourseError(f"parts: expected at least one Part, received {self.parts!r:.80}.")
            positive_number(self.top_speed, "top_speed", "give the launch speed of a full putt in m/s.")
            positive_number(self.ball_radius, "ball_radius", "a golf ball has 0.02135 m.")
            finite_array(self.gravity, (3,), "gravity", "the Earth's is (0, 0, -9.81) m/s^2.")
            self._check_bounds()
            self._check_golf()

    def world(self, dt: float = 1 / 120, impact: str = "average") -> World:
        """Return the course's compiled physics; ``dt`` in seconds, ``impact`` as in World.

        Raises:
            ValueError: ``dt`` or ``impact`` is not what World takes.
            CourseError: a ball on the tee, or in the cup, would be in a wall.
        """
        world = World(
            [part.mesh for part in self.parts],
            ball_radius=self.ball_radius,
            gravity=self.gravity,
            dt=dt,
            impact=impact,
            bounds=self.bounds,
        )
        with faults_of(f"course {self.name!r}"):
            world.check_collision_free(sorted(set(self._places())))
        return world

    def _places(self) -> Iterator[Point3]:
        """Yield centres where the ball has to have room: over the tee, and at the cup's bottom."""
        tee = zip(self.tee.lower, self.tee.centre, self.tee.upper, strict=True)
        for x, y in itertools.product(*tee):
            yield x, y, self.tee.height + self.ball_radius
        if self.cup is not None:
            x, y, rim = self.cup.position
            yield x, y, rim - self.cup.depth + self.ball_radius

    def _check_bounds(self) -> None:
        lower, upper = finite_array(self.bounds, (2, 3), "bounds", "give the lower and the upper corner.")
        for place in self._places():
            if not (lower < place).all() or not (place < upper).all():
                raise CourseError(
                    f"bounds: expected a box around the ball at {place}, received {self.bounds}; enlarge the bounds."
                )

    def _check_golf(self) -> None:
        if self.cup is None:
            if self.par is not None or self.route:
                raise CourseError(
                    f"par and route: expected None and () without cup, received {self.par!r} and {self.route!r}; "
                    "give a cup, or leave them out."
                )
            return
        if not self.gravity[2] < 0.0:
            raise CourseError(
                f"gravity: expected one that pulls down where there is a cup, received {self.gravity!r}; "
                "the Earth's is (0, 0, -9.81) m/s^2."
            )
        self.cup.check_takes(self.ball_radius)
        if type(self.par) is not int or self.par < 1:
            raise CourseError(f"par: expected an integer >= 1, received {self.par!r}; count a good player's strokes.")
        route = finite_array(self.route, (None, 2), "route", "give one x, y a point.")
        ends = (self.tee.centre, self.cup.position[:2])
        if len(route) < 2 or not np.allclose(route[[0, -1]], ends, rtol=0.0, atol=1e-9):
            raise CourseError(
                f"route: expected points from the tee's centre to the cup, {ends[0]} to {ends[1]}, "
                f"received {self.route!r}; add the ends."
            )
        if (np.diff(route, axis=0) == 0.0).all(axis=1).any():
            raise CourseError(
                f"route: expected legs with a length, received {self.route!r}; leave repeated points out."
            )

    def __deepcopy__(self, memo: dict[int, object]) -> Course:
        """Return the course itself: it is immutable, and what is drawn and computed of it is kept by identity."""
        return self


@contextmanager
def faults_of(whose: str) -> Iterator[None]:
    """Turn the ValueErrors of checks into CourseErrors that say whose fault it is."""
    try:
        yield
    except ValueError as error:
        raise CourseError(f"{whose}: {error}") from error
