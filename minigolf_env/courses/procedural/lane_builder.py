"""Lane of a level: a strip of level cross-sections that is built piece by piece, like a turtle's path."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from minigolf_env.courses.course import Point2, Point3
from minigolf_env.courses.procedural.portable_rng import heading_vector
from minigolf_env.courses.procedural.portable_solids import VERTEX_GRID, SolidMesh

RIGHT_ANGLE_STEPS = 6
"""Number of heading steps in a right angle."""

ROUTE_CLEARANCE = 0.1
"""Distance at which the route passes an inner corner, m."""

MIN_LANE_SEPARATION = 0.2
"""Free width between two parts of a lane that pass each other, m: room for two borders and a gap between them."""

MIN_LOOP_LENGTH_RATIO = 1.6
"""Distance along the lane beyond which two samples must be apart in the xy-plane, in sums of their two widths."""

SQUARE_CORNER_RATIO = 0.71
"""Largest distance of the lane's edge from its centre line, in widths: half the diagonal of a square, rounded up."""

MAX_SAMPLE_SPACING = 0.3
"""Largest distance between samples of the centre line, m."""


@dataclass
class LaneBuilder:
    """Lane under construction: the pieces that were added, and the position and heading of the next one.

    Cross-sections are level, and the pieces between two of them are flat: only straight pieces slope.
    """

    width: float
    """Width of the last cross-section, m."""
    taper: float = 0.0
    """Change of width for each metre of straight lane, m."""
    x: float = 0.0
    """x of the centre of the last cross-section, m."""
    y: float = 0.0
    """y of the centre of the last cross-section, m."""
    z: float = 0.0
    """Level of the last cross-section, m."""
    heading: int = 0
    """Direction in which the lane continues, in steps of 15 degrees, counter-clockwise from x."""
    points: list[Point3] = field(default_factory=list)
    """End points of cross-sections, m."""
    sections: list[tuple[int, int]] = field(default_factory=list)
    """Left and right end of each cross-section, as indices of points."""
    route: list[Point2] = field(default_factory=list)
    """Corners of the route from the tee to the cup, m."""
    obstacles: list[tuple[str, SolidMesh]] = field(default_factory=list)
    """Kind and solid of each obstacle on the lane."""

    def __post_init__(self) -> None:
        self.start = self.direction
        self._add_section()

    @property
    def direction(self) -> Point2:
        """Unit vector of the heading."""
        return heading_vector(self.heading)

    def point_at(self, forward: float, left: float) -> Point2:
        """Return the point at a distance forward and to the left of the last cross-section's centre, m."""
        c, s = self.direction
        return self.x + forward * c - left * s, self.y + forward * s + left * c

    def add_straight(self, length: float, rise: float = 0.0, width: float | None = None) -> None:
        """Add a straight piece that rises by ``rise`` and ends with a width; None: the width that the taper gives."""
        self.x, self.y = self.point_at(length, 0.0)
        self.z = (
            round((self.z + rise) / VERTEX_GRID) * VERTEX_GRID
        )  # The level of the cup is exactly that of the floor.
        self.width = self.width + self.taper * length if width is None else width
        self._add_section()

    def add_turn(self, steps: int, outside: str) -> None:
        """Add a sharp turn around the inner corner; ``outside`` is the outer corner: "square", "cut" or "round"."""
        side = 1 if steps > 0 else -1
        pivot = self.point_at(0.0, side * self.width / 2.0)
        corner = self.sections[-1][0 if side > 0 else 1]
        begin = self.heading
        end = self.heading + steps
        # Find the outward directions across the lane before and after the turn, and their mitre.
        first = heading_vector(begin - side * RIGHT_ANGLE_STEPS)
        last = heading_vector(end - side * RIGHT_ANGLE_STEPS)
        mitre = 1.0 + first[0] * last[0] + first[1] * last[1]
        to_corner = ((first[0] + last[0]) / mitre, (first[1] + last[1]) / mitre)
        self.route.append((pivot[0] + ROUTE_CLEARANCE * to_corner[0], pivot[1] + ROUTE_CLEARANCE * to_corner[1]))
        # Add cross-sections from the inner corner to points of the outer corner.
        directions = [last]
        if outside == "square":
            directions = [to_corner, last]
        elif outside == "round":
            directions = [heading_vector(begin + side * k - side * RIGHT_ANGLE_STEPS) for k in range(1, abs(steps) + 1)]
        for u, v in directions:
            self._add_pivot_section(corner, side, (pivot[0] + self.width * u, pivot[1] + self.width * v))
        self.heading = end
        self.x = pivot[0] + self.width / 2.0 * last[0]
        self.y = pivot[1] + self.width / 2.0 * last[1]

    def add_bend(self, steps: int, radius: float) -> None:
        """Add a turn along an arc whose inner side has a radius, m."""
        side = 1 if steps > 0 else -1
        pivot = self.point_at(0.0, side * (self.width / 2.0 + radius))
        for _ in range(abs(steps)):
            self.heading += side
            c, s = heading_vector(self.heading - side * RIGHT_ANGLE_STEPS)
            self.x = pivot[0] + (radius + self.width / 2.0) * c
            self.y = pivot[1] + (radius + self.width / 2.0) * s
            self.route.append((pivot[0] + (radius + ROUTE_CLEARANCE) * c, pivot[1] + (radius + ROUTE_CLEARANCE) * s))
            self._add_section()

    def place_obstacle(
        self, kind: str, solid: SolidMesh, forward: float = 0.0, left: float = 0.0, rotation_steps: int = 0
    ) -> None:
        """Place a solid on the level of the last cross-section, its x axis forward or turned by heading steps."""
        x, y = self.point_at(forward, left)
        self.obstacles.append((kind, solid.transformed(x, y, self.z, heading_vector(self.heading + rotation_steps))))

    def boundary(self) -> list[int]:
        """Return the indices of the points around the lane, counter-clockwise."""
        around = [right for _, right in self.sections] + [left for left, _ in reversed(self.sections)]
        return [point for point, before in zip(around, [around[-1], *around[:-1]], strict=True) if point != before]

    def max_coordinate(self) -> float:
        """Return the largest absolute x or y of the lane, m."""
        return max(max(abs(x), abs(y)) for x, y, _ in self.points)

    def overlaps_itself(self) -> bool:
        """Return whether two parts of the lane that are far apart along it are close in the xy-plane."""
        samples = list(self._samples())
        for i, (x, y, along, width) in enumerate(samples):
            for u, v, other_along, other_width in samples[i + 1 :]:
                distance = SQUARE_CORNER_RATIO * (width + other_width) + MIN_LANE_SEPARATION
                is_close = (x - u) * (x - u) + (y - v) * (y - v) < distance * distance
                if is_close and other_along - along > MIN_LOOP_LENGTH_RATIO * (width + other_width):
                    return True
        return False

    def _samples(self) -> Iterator[tuple[float, float, float, float]]:
        """Yield points of the centre line: x, y, the distance along the lane from the tee, and the width there, m."""
        along = 0.0
        before = None
        for left, right in self.sections:
            a = self.points[left]
            b = self.points[right]
            width = ((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) ** 0.5
            center = (a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0
            if before is not None:
                length = ((center[0] - before[0]) ** 2 + (center[1] - before[1]) ** 2) ** 0.5
                pieces = 1 + int(length / MAX_SAMPLE_SPACING)
                for k in range(1, pieces + 1):
                    fraction = k / pieces
                    x = before[0] + fraction * (center[0] - before[0])
                    y = before[1] + fraction * (center[1] - before[1])
                    yield x, y, along + fraction * length, width
                along += length
            before = center

    def _add_section(self) -> None:
        """Add the cross-section at the present position."""
        left = self.point_at(0.0, self.width / 2.0)
        right = self.point_at(0.0, -self.width / 2.0)
        self.points += [(*left, self.z), (*right, self.z)]
        self.sections.append((len(self.points) - 2, len(self.points) - 1))

    def _add_pivot_section(self, corner: int, side: int, outer: Point2) -> None:
        """Add a cross-section from an inner corner, on the left if ``side`` is 1, to an outer point."""
        self.points.append((*outer, self.z))
        new = len(self.points) - 1
        self.sections.append((corner, new) if side > 0 else (new, corner))
