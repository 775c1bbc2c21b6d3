"""The lane of a level: a strip of level cross-sections, laid piece by piece from the tee to the end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from minigolf_env.courses.course import Point2, Point3
from minigolf_env.courses.procedural.meshes import GRAIN, Solid
from minigolf_env.courses.procedural.portable_rng import direction

QUARTER = 6
"""Steps of heading in a right angle."""

CLEAR = 0.1
"""How far off an inner corner the route passes, m."""

APART = 0.2
"""Free width between two parts of a lane that pass each other, m: room for two borders and a view between them."""

CORNER = 0.71
"""How far the corners of a square are from its middle, in sides: a lane reaches so far from its middle line."""


@dataclass
class Lane:
    """A lane under construction: where it has got to, and what has been laid.

    A cross-section is level, and pieces between two of them are flat: they slope along straight pieces only.
    """

    width: float
    """Present width, m."""
    taper: float = 0.0
    """What a metre of straight lane adds to the width, m."""
    x: float = 0.0
    y: float = 0.0
    """The middle of the last cross-section, m."""
    z: float = 0.0
    """Its level, m."""
    heading: int = 0
    """Steps of 15 degrees, counter-clockwise from x."""
    points: list[Point3] = field(default_factory=list)
    """Ends of cross-sections, m."""
    sections: list[tuple[int, int]] = field(default_factory=list)
    """Each cross-section's left and right end, as numbers of points."""
    route: list[Point2] = field(default_factory=list)
    obstacles: list[tuple[str, Solid]] = field(default_factory=list)
    """Kind and solid of what stands on the lane."""

    def __post_init__(self) -> None:
        self.start = self.ahead
        self._lay()

    @property
    def ahead(self) -> Point2:
        """Unit vector of the heading."""
        return direction(self.heading)

    def at(self, along: float, left: float) -> Point2:
        """Return the place ``along`` metres ahead of the last cross-section's middle and ``left`` metres beside it."""
        c, s = self.ahead
        return self.x + along * c - left * s, self.y + along * s + left * c

    def go(self, length: float, rise: float = 0.0, width: float | None = None) -> None:
        """Lay a straight piece that rises by ``rise`` and ends with a width; None: as the taper has it."""
        self.x, self.y = self.at(length, 0.0)
        self.z = round((self.z + rise) / GRAIN) * GRAIN  # Where the cup is to be, exactly.
        self.width = self.width + self.taper * length if width is None else width
        self._lay()

    def turn(self, steps: int, outside: str) -> None:
        """Turn sharply around the inner corner; ``outside``: "square", "cut" or "round" is the outer one."""
        side = 1 if steps > 0 else -1
        pivot = self.at(0.0, side * self.width / 2.0)
        corner = self.sections[-1][0 if side > 0 else 1]
        begin, end = self.heading, self.heading + steps
        first, last = direction(begin - side * QUARTER), direction(end - side * QUARTER)
        mitre = 1.0 + first[0] * last[0] + first[1] * last[1]
        to_corner = (first[0] + last[0]) / mitre, (first[1] + last[1]) / mitre
        self.route.append((pivot[0] + CLEAR * to_corner[0], pivot[1] + CLEAR * to_corner[1]))
        ways = [last]
        if outside == "square":
            ways = [to_corner, last]
        elif outside == "round":
            ways = [direction(begin + side * k - side * QUARTER) for k in range(1, abs(steps) + 1)]
        for way in ways:
            self._lay_around(corner, side, (pivot[0] + self.width * way[0], pivot[1] + self.width * way[1]))
        self.heading = end
        self.x, self.y = pivot[0] + self.width / 2.0 * last[0], pivot[1] + self.width / 2.0 * last[1]

    def bend(self, steps: int, radius: float) -> None:
        """Turn along an arc whose inner side has a radius, m."""
        side = 1 if steps > 0 else -1
        pivot = self.at(0.0, side * (self.width / 2.0 + radius))
        for _ in range(abs(steps)):
            self.heading += side
            c, s = direction(self.heading - side * QUARTER)
            self.x = pivot[0] + (radius + self.width / 2.0) * c
            self.y = pivot[1] + (radius + self.width / 2.0) * s
            self.route.append((pivot[0] + (radius + CLEAR) * c, pivot[1] + (radius + CLEAR) * s))
            self._lay()

    def stand(self, kind: str, solid: Solid, along: float = 0.0, left: float = 0.0, turned: int = 0) -> None:
        """Put a solid onto the level of the last cross-section; its x axis looks ahead, or ``turned`` by steps."""
        x, y = self.at(along, left)
        self.obstacles.append((kind, solid.moved(x, y, self.z, direction(self.heading + turned))))

    def ring(self) -> list[int]:
        """Return the numbers of the points around the lane, counter-clockwise."""
        around = [right for _, right in self.sections] + [left for left, _ in reversed(self.sections)]
        return [point for point, before in zip(around, [around[-1], *around[:-1]], strict=True) if point != before]

    def spread(self) -> float:
        """Return the largest coordinate in plan, m."""
        return max(max(abs(x), abs(y)) for x, y, _ in self.points)

    def overlaps(self) -> bool:
        """Return whether two parts of the lane, far from each other along it, are close in plan."""
        spots = list(self._spots())
        for i, (x, y, way, wide) in enumerate(spots):
            for u, v, way_there, wide_there in spots[i + 1 :]:
                reach = CORNER * (wide + wide_there) + APART
                near = (x - u) * (x - u) + (y - v) * (y - v) < reach * reach
                if near and way_there - way > 1.6 * (wide + wide_there):
                    return True
        return False

    def _spots(self) -> Iterator[tuple[float, float, float, float]]:
        """Yield places in the middle of the lane: x, y, the way from the tee, and the width there, m."""
        way, before = 0.0, None
        for left, right in self.sections:
            a, b = self.points[left], self.points[right]
            wide = ((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) ** 0.5
            spot = (a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0
            if before is not None:
                length = ((spot[0] - before[0]) ** 2 + (spot[1] - before[1]) ** 2) ** 0.5
                pieces = 1 + int(length / 0.3)
                for k in range(1, pieces + 1):
                    share = k / pieces
                    x, y = before[0] + share * (spot[0] - before[0]), before[1] + share * (spot[1] - before[1])
                    yield x, y, way + share * length, wide
                way += length
            before = spot

    def _lay(self) -> None:
        left, right = self.at(0.0, self.width / 2.0), self.at(0.0, -self.width / 2.0)
        self.points += [(*left, self.z), (*right, self.z)]
        self.sections.append((len(self.points) - 2, len(self.points) - 1))

    def _lay_around(self, corner: int, side: int, outer: Point2) -> None:
        self.points.append((*outer, self.z))
        new = len(self.points) - 1
        self.sections.append((corner, new) if side > 0 else (new, corner))
