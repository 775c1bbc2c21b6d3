"""Course, Part, Tee and Cup: records that validate themselves, so that every Course that exists can be played.

Lengths are in metres, times in seconds, z points up.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np

from minigolf_env._validation import finite_array, one_of, positive_number, quote
from minigolf_env.physics import TriangleMesh, World

Point2: TypeAlias = tuple[float, float]
Point3: TypeAlias = tuple[float, float, float]
Material: TypeAlias = Literal["felt", "wood", "stone", "wall", "cup", "brick", "paint", "water"]
"""Texture that a part is drawn with; the physics depends on the part's Surface only."""
Color: TypeAlias = tuple[float, float, float]

GOLF_BALL_RADIUS = 0.02135
"""Radius of a golf ball, m: the smallest that the rules of golf allow (diameter 42.67 mm)."""

EARTH_GRAVITY: Point3 = (0.0, 0.0, -9.81)
"""Gravitational acceleration on Earth, m/s^2."""

DEFAULT_PAR = 2
"""Par of a course with a cup from Python or a .glb file that gives none; a TOML file must give it."""

STIMPMETER_SPEED = 1.829
"""Speed at which a stimpmeter releases the ball, m/s."""

CUP_LINER_THICKNESS = 0.003
"""Thickness of the cup's wall and bottom, m: the visible rim around the hole."""

EMBED_DEPTH = 0.05
"""Depth by which borders and obstacles reach into the floor, m, so that there is no seam for a ball to touch."""


class CourseError(ValueError):
    """Fault in a course or in a request for one; the message says what is wrong, what was expected, and what to do."""

    location: tuple[int | str, ...] = ()
    """Keys in the course file that lead to the fault, such as ("parts", 3) or ("cup",); empty where none does."""


@dataclass(frozen=True)
class Cup:
    """Cup that the ball is played into: a cylinder sunk into the floor.

    Raises:
        CourseError: a value is not finite, or a length not positive.
    """

    position: Point3
    """Centre of the rim, on the level of the floor, m."""
    radius: float = 0.054
    """Radius, m; the rules of golf require a diameter of 108 mm."""
    depth: float = 0.10
    """Depth from the rim to the bottom, m; the least that the rules of golf allow (101.6 mm), rounded."""

    def __post_init__(self) -> None:
        with course_errors("cup"):
            finite_array(self.position, (3,), "position", "give x, y, z of the rim's centre in metres.")
            positive_number(self.radius, "radius", "the rules of golf have 0.054 m.")
            positive_number(self.depth, "depth", "0.1 m suits a golf ball.")

    def check_ball_fits(self, ball_radius: float) -> None:
        """Raise a CourseError unless a ball of this radius (m) fits into the cup and rests below its rim."""
        for name, size in (("radius", self.radius), ("depth", self.depth)):
            if not size > ball_radius:
                raise CourseError(
                    f"cup {name}: expected more than the ball's radius, {ball_radius:g} m, received {quote(size)}; "
                    "the ball has to drop below the rim."
                )


@dataclass(frozen=True)
class Tee:
    """Rectangle in the xy-plane in which the ball's centre starts; one without extent is a point.

    Raises:
        CourseError: a value is not finite, or ``lower`` is above ``upper``.
    """

    lower: Point2
    """Corner of the rectangle with the smallest x and y, m."""
    upper: Point2
    """Corner of the rectangle with the largest x and y, m."""
    height: float
    """Level z of the floor below the ball, m; if the ball starts in the air, of the ball's lowest point."""

    def __post_init__(self) -> None:
        with course_errors("tee"):
            lower = finite_array(self.lower, (2,), "lower", "give x, y in metres.")
            upper = finite_array(self.upper, (2,), "upper", "give x, y in metres.")
            finite_array(self.height, (), "height", "give the floor's level in metres.")
            if not (lower <= upper).all():
                raise CourseError(f"expected lower <= upper, received {self.lower}, {self.upper}; swap the corners.")

    @property
    def centre(self) -> Point2:
        """Centre (x, y) of the rectangle, m."""
        return (self.lower[0] + self.upper[0]) / 2.0, (self.lower[1] + self.upper[1]) / 2.0


@dataclass(frozen=True, eq=False)
class Part:
    """Named solid of a course.

    Raises:
        CourseError: the mesh is not closed, the material is unknown, or the colour out of range.
    """

    name: str
    mesh: TriangleMesh
    """Closed mesh; its faces are wound so that their normals point to the side of the ball."""
    material: Material
    """Texture the part is drawn with; its physical properties are those of the mesh's surface."""
    color: Color | None = None
    """Colour the material is tinted with: sRGB red, green and blue in [0, 1]; None: the material's own colour."""

    def __post_init__(self) -> None:
        with course_errors(f"part {quote(self.name)}"):
            one_of(self.material, get_args(Material), "material")
            if self.color is not None:
                values = finite_array(self.color, (3,), "color", "give red, green, blue in [0, 1].")
                if not ((values >= 0.0) & (values <= 1.0)).all():
                    raise CourseError(f"color: expected values in [0, 1], received {self.color}; divide by 255.")
            if self.mesh.two_sided:  # A one-sided TriangleMesh is closed.
                raise CourseError(
                    f"mesh: expected a closed, one-sided TriangleMesh, received {quote(self.mesh)}; "
                    "close its holes and wind its faces consistently, so that no ball can enter it."
                )


@dataclass(frozen=True, eq=False)
class Course:
    """Closed meshes, a tee, and a cup if there is one. Immutable, compared by identity.

    Raises:
        CourseError: a field is not valid.
    """

    name: str
    """Name of the course."""
    parts: tuple[Part, ...]
    """Solids of the course, at least one."""
    tee: Tee
    """Start of the ball."""
    cup: Cup | None
    """Cup; None for a course in which a ball is only thrown (free-throw mode)."""
    par: int | None
    """Rounded mean number of strokes of a good player, >= 1; None without a cup."""
    bounds: tuple[Point3, Point3]
    """Lower and upper corner of the bounding box, m: a ball whose centre leaves it is out of bounds."""
    route: tuple[Point2, ...]
    """Polyline in the xy-plane from the tee's centre to the cup, m. It turns closely around inner corners of the lane
    and ignores obstacles. Empty without cup."""
    top_speed: float
    """Launch speed of a full putt, m/s."""
    ball_radius: float = GOLF_BALL_RADIUS
    """Radius of the ball, m."""
    gravity: Point3 = EARTH_GRAVITY
    """Gravitational acceleration, m/s^2."""

    def __post_init__(self) -> None:
        with course_errors(f"course {quote(self.name)}"):
            if not self.parts or not all(isinstance(part, Part) for part in self.parts):
                raise CourseError(f"parts: expected at least one Part, received {quote(self.parts)}.")
            positive_number(self.top_speed, "top_speed", "give the launch speed of a full putt in m/s.")
            positive_number(self.ball_radius, "ball_radius", "a golf ball has 0.02135 m.")
            finite_array(self.gravity, (3,), "gravity", "the Earth's is (0, 0, -9.81) m/s^2.")
            self._check_bounds()
            self._check_golf()

    def world(self, dt: float = 1 / 120, impact: str = "average") -> World:
        """Return the physics World of the course.

        Args:
            dt: time step, s.
            impact: impact model, as in World.

        Raises:
            ValueError: World does not accept ``dt`` or ``impact``.
            CourseError: a ball on the tee or in the cup would overlap a wall.
        """
        world = World(
            [part.mesh for part in self.parts],
            ball_radius=self.ball_radius,
            gravity=self.gravity,
            dt=dt,
            impact=impact,
            bounds=self.bounds,
        )
        for place, positions in self._required_positions().items():
            with course_errors(f"course {quote(self.name)}: {place}"):
                world.check_collision_free(sorted(set(positions)))
        return world

    def _required_positions(self) -> dict[str, list[Point3]]:
        """Return ball centres that must be in bounds and free of collision, on the "tee" and in the "cup"."""
        tee = zip(self.tee.lower, self.tee.centre, self.tee.upper, strict=True)
        height = self.tee.height + self.ball_radius
        positions = {"tee": [(x, y, height) for x, y in itertools.product(*tee)]}
        if self.cup is not None:
            x, y, rim = self.cup.position
            positions["cup"] = [(x, y, rim - self.cup.depth + self.ball_radius)]
        return positions

    def _check_bounds(self) -> None:
        lower, upper = finite_array(self.bounds, (2, 3), "bounds", "give the lower and the upper corner.")
        for place, positions in self._required_positions().items():
            for position in positions:
                if not (lower < position).all() or not (position < upper).all():
                    raise CourseError(
                        f"{place}: expected a ball within the bounds {self.bounds}, received {position}; "
                        f"move the {place}, or enlarge the bounds."
                    )

    def _check_golf(self) -> None:
        if self.cup is None:
            if self.par is not None or self.route:
                raise CourseError(
                    f"par and route: expected None and () without cup, received {quote(self.par)} and "
                    f"{quote(self.route)}; give a cup, or leave them out."
                )
            return
        if not self.gravity[2] < 0.0:
            raise CourseError(
                f"gravity: expected one that pulls down where there is a cup, received {quote(self.gravity)}; "
                "the Earth's is (0, 0, -9.81) m/s^2."
            )
        self.cup.check_ball_fits(self.ball_radius)
        if type(self.par) is not int or self.par < 1:
            raise CourseError(
                f"par: expected an integer >= 1, received {quote(self.par)}; count a good player's strokes."
            )
        route = finite_array(self.route, (None, 2), "route", "give x, y for each point.")
        ends = (self.tee.centre, self.cup.position[:2])
        if len(route) < 2 or not np.allclose(route[[0, -1]], ends, rtol=0.0, atol=1e-9):
            raise CourseError(
                f"route: expected points from the tee's centre to the cup, {ends[0]} to {ends[1]}, "
                f"received {quote(self.route)}; add the ends."
            )
        if (np.diff(route, axis=0) == 0.0).all(axis=1).any():
            raise CourseError(
                f"route: expected segments with a length, received {quote(self.route)}; remove repeated points."
            )

    def __deepcopy__(self, memo: dict[int, object]) -> Course:
        """Return the course itself: it is immutable, and caches of its world and its rendering use its identity."""
        return self


def rolling_resistance_from_stimp(stimp: float) -> float:
    """Return the rolling resistance of a green whose stimpmeter speed is given in feet (docs/physics.md)."""
    return STIMPMETER_SPEED**2 / (2.0 * 0.3048 * stimp) / 9.81


@contextmanager
def course_errors(subject: str, *location: int | str) -> Iterator[None]:
    """Convert ValueErrors into CourseErrors whose message begins with the subject of the fault.

    ``location`` are the keys in the course file that lead to the fault, if no error within knows better ones.
    """
    try:
        yield
    except ValueError as error:
        named = CourseError(f"{subject}: {error}")
        named.location = getattr(error, "location", ()) or location
        raise named from error
