"""Features of a lane: obstacles on it, and shapes of its ground. Lengths are in metres.

A feature adds the piece of lane that it needs. Each leaves a path of at least MIN_GAP past it, and none traps a ball:
a ball that rolls in can roll out, slopes that are steeper than rolling resistance end in flat parts, and steps only
go down in the direction of play.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from minigolf_env.courses.course import EMBED_DEPTH, rolling_resistance_from_stimp
from minigolf_env.courses.procedural.lane_builder import RIGHT_ANGLE_STEPS, LaneBuilder
from minigolf_env.courses.procedural.portable_rng import PortableRng, unit_circle
from minigolf_env.courses.procedural.portable_solids import loft, make_box, make_prism, revolve_profile

LaneFeature: TypeAlias = Callable[[LaneBuilder, PortableRng], None]

OBSTACLE_HEIGHT = 0.12
"""Height of borders and obstacles above the floor, m: more than a ball can jump when it hits the rim of the cup."""

MIN_GAP = 0.2
"""Width of the narrowest path past an obstacle, m: nearly five balls."""

DROP_LENGTH = 2.0**-5
"""Horizontal length of a drop, m: short, but not 0, so that the height is still a function of x and y."""

FELT_ROLLING_RESISTANCE = rolling_resistance_from_stimp(10.0)
"""Rolling resistance of felt, a fast green of Stimp 10; on a slope of this steepness a ball keeps its speed."""

MIN_SLOPE = FELT_ROLLING_RESISTANCE + 0.012
"""Smallest slope of felt that is not level: on gentler slopes balls roll slowly for a long time, and come to rest
where a putt along the slope behaves unexpectedly."""

HUMP_PIECES = 6
"""Number of flat pieces of a hump; with more, its top and ends would be gentler than MIN_SLOPE."""

MOUND_RINGS = 4
"""Number of rings of facets of a mound, from its rim to its top; with more, some would be gentler than MIN_SLOPE."""


def add_block(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a block near the middle, turned by a random angle."""
    lane.add_straight(0.35)
    solid = make_box(rng.uniform(0.3, 0.5), rng.uniform(0.1, 0.15), -EMBED_DEPTH, OBSTACLE_HEIGHT)
    lane.place_obstacle("wood", solid, left=rng.uniform(-0.15, 0.15), rotation_steps=rng.integer(0, 11))
    lane.add_straight(0.35)


def add_bollard(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a round post with a pointed top, on which no ball comes to rest."""
    lane.add_straight(0.3)
    r = rng.uniform(0.07, 0.13)
    h = OBSTACLE_HEIGHT
    profile = [(0.0, -EMBED_DEPTH), (r, -EMBED_DEPTH), (r, h), (0.6 * r, h + 0.05), (0.0, h + 0.07)]
    lane.place_obstacle("stone", revolve_profile(profile, 32), left=rng.uniform(-0.15, 0.15))
    lane.add_straight(0.3)


def add_rock(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a rock of random shape."""
    lane.add_straight(0.3)
    r = rng.uniform(0.13, 0.2)
    profile = [(0.0, -EMBED_DEPTH), (r, -EMBED_DEPTH), (r, 0.03), (0.85 * r, 0.09), (0.45 * r, 0.15), (0.0, 0.18)]
    radius_factors = np.array([[rng.uniform(0.8, 1.2) for _ in range(9)] for _ in profile])
    lane.place_obstacle(
        "stone",
        revolve_profile(profile, 9, radius_factors),
        left=rng.uniform(-0.12, 0.12),
        rotation_steps=rng.integer(0, 23),
    )
    lane.add_straight(0.3)


def add_cone(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a cone or a pyramid, which fast balls climb."""
    lane.add_straight(0.3)
    r = rng.uniform(0.12, 0.18)
    profile = [(0.0, -EMBED_DEPTH), (r, -EMBED_DEPTH), (r, 0.0), (0.0, rng.uniform(0.15, 0.3))]
    sides = rng.choice((4, 5, 32))
    lane.place_obstacle(
        "stone", revolve_profile(profile, sides), left=rng.uniform(-0.15, 0.15), rotation_steps=rng.integer(0, 23)
    )
    lane.add_straight(0.3)


def add_wedge(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a wedge whose edge points to the player and deflects balls to the left or right."""
    lane.add_straight(0.3)
    length = rng.uniform(0.25, 0.45)
    width = rng.uniform(0.15, 0.3)
    outline = [(-length / 2.0, 0.0), (length / 2.0, -width / 2.0), (length / 2.0, width / 2.0)]
    lane.place_obstacle(
        "wood",
        make_prism(outline, -EMBED_DEPTH, OBSTACLE_HEIGHT),
        left=rng.uniform(-0.1, 0.1),
        rotation_steps=rng.integer(-1, 1),
    )
    lane.add_straight(0.3)


def add_pegs(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add an uneven row of pegs across the lane."""
    lane.add_straight(0.3)
    r = 0.03
    num_pegs = int((lane.width - MIN_GAP) / (MIN_GAP + 0.1))
    peg = revolve_profile([(0.0, -EMBED_DEPTH), (r, -EMBED_DEPTH), (r, 0.1), (0.0, 0.13)], 16)
    spacing = lane.width / (num_pegs + 1)
    shift = rng.uniform(-0.04, 0.04)
    for k in range(num_pegs):
        lane.place_obstacle("stone", peg, rng.uniform(-0.1, 0.1), (k + 1) * spacing - lane.width / 2.0 + shift)
    lane.add_straight(0.3)


def add_gate(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add two walls that leave a narrow gate between them."""
    lane.add_straight(0.3)
    gap = rng.uniform(0.25, 0.4)
    middle = rng.uniform(-0.5, 0.5) * (lane.width - gap - 0.1)
    _place_wall(lane, lane.width / 2.0, middle + gap / 2.0)
    _place_wall(lane, -lane.width / 2.0, middle - gap / 2.0)
    lane.add_straight(0.3)


def add_chicane(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add two walls that extend past the middle, one from each side."""
    lane.add_straight(0.3)
    first_side = rng.sign()
    gap = rng.uniform(0.28, 0.36)
    for side in (first_side, -first_side):
        _place_wall(lane, side * lane.width / 2.0, side * (gap - lane.width / 2.0))
        lane.add_straight(0.55)


def add_baffle(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a wall that extends past the middle from one side."""
    lane.add_straight(0.3)
    side = rng.sign()
    _place_wall(lane, side * lane.width / 2.0, side * (rng.uniform(0.28, 0.4) - lane.width / 2.0))
    lane.add_straight(0.3)


def add_hoop(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a hoop that the ball rolls through or past."""
    lane.add_straight(0.3)
    inner = rng.uniform(0.13, 0.2)
    tube_radius = 0.03
    arch = unit_circle(24)[:13]
    rings = []
    for c, s in [arch[0], *arch, arch[-1]]:
        circle = [(tube_radius * u, inner + tube_radius + tube_radius * v) for u, v in unit_circle(8)]
        rings.append([(u, c * v, s * v) for u, v in circle])
    tube = np.array(rings)
    tube[[0, -1], :, 2] -= EMBED_DEPTH
    lane.place_obstacle("wood", loft(tube), left=rng.uniform(-0.1, 0.1), rotation_steps=rng.integer(-1, 1))
    lane.add_straight(0.3)


def add_mound(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a round mound of felt, which deflects balls."""
    r = rng.uniform(0.25, 0.4) * min(1.0, lane.width)
    lane.add_straight(r + 0.05)
    fractions = [1.0 - k / MOUND_RINGS for k in range(MOUND_RINGS + 1)]
    slopes = [MOUND_RINGS * (_bump_height(b) - _bump_height(a)) / r for a, b in itertools.pairwise(fractions)]
    height = _steepen(rng.uniform(0.04, 0.07), slopes)
    rings = [(r * fraction, height * _bump_height(fraction)) for fraction in fractions]
    profile = [(0.0, -EMBED_DEPTH), (r, -EMBED_DEPTH), *rings]
    lane.place_obstacle("felt", revolve_profile(profile, 32), left=rng.uniform(-0.2, 0.2))
    lane.add_straight(r + 0.05)


def add_hump(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a hump of the ground across the lane."""
    _add_bump(lane, rng.uniform(0.04, 0.1), rng.uniform(0.8, 1.1), 1)


def add_ditch(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a ditch across the lane."""
    _add_bump(lane, rng.uniform(0.03, 0.08), rng.uniform(0.8, 1.1), -1)


def add_rise(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a slope up."""
    _add_slope(lane, rng.uniform(0.08, 0.16), rng.uniform(0.8, 1.2), 1)


def add_fall(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a slope down."""
    _add_slope(lane, rng.uniform(0.08, 0.16), rng.uniform(0.8, 1.2), -1)


def add_jump(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a ramp that ends in a drop, over which the ball flies."""
    lane.add_straight(0.2)
    length = rng.uniform(0.5, 0.8)
    height = _steepen(rng.uniform(0.06, 0.12), [1.0 / length])
    lane.add_straight(length, height)
    lane.add_straight(0.1)
    lane.add_straight(DROP_LENGTH, -height)
    lane.add_straight(0.7)


def add_drop(lane: LaneBuilder, rng: PortableRng) -> None:
    """Add a step down, after which the lane continues."""
    lane.add_straight(0.2)
    lane.add_straight(DROP_LENGTH, -rng.uniform(0.05, 0.12))
    lane.add_straight(0.4)


def _add_slope(lane: LaneBuilder, height: float, length: float, sign: int) -> None:
    lane.add_straight(0.15)
    # Make both ends gentler, so that the ball passes three small changes of slope instead of two larger ones.
    pieces = ((0.15, 0.1), (0.7, 0.8), (0.15, 0.1))  # Fractions of the length and the height.
    height = sign * _steepen(height, [rise / (run * length) for run, rise in pieces])
    for run, rise in pieces:
        lane.add_straight(run * length, rise * height)
    lane.add_straight(0.25)


def _add_bump(lane: LaneBuilder, height: float, length: float, sign: int) -> None:
    lane.add_straight(0.15)
    level = lane.z
    piece = length / HUMP_PIECES
    heights = [_bump_height(2.0 * k / HUMP_PIECES - 1.0) for k in range(HUMP_PIECES + 1)]
    height = sign * _steepen(height, [(b - a) / piece for a, b in itertools.pairwise(heights)])
    for fraction in heights[1:]:
        lane.add_straight(piece, level + height * fraction - lane.z)
    lane.z = level
    lane.add_straight(0.25)


def _steepen(height: float, slopes: list[float]) -> float:
    """Return a height, increased if some slope would be less than MIN_SLOPE; ``slopes`` are those at height 1."""
    return max(height, MIN_SLOPE / min(abs(slope) for slope in slopes))


def _place_wall(lane: LaneBuilder, border: float, end: float) -> None:
    """Place a wall across the lane from a border to an end, both given as distances to the left of the middle."""
    beyond = border + (0.03 if border > 0.0 else -0.03)
    wall = make_box(abs(beyond - end), 0.08, -EMBED_DEPTH, OBSTACLE_HEIGHT)
    lane.place_obstacle("wood", wall, left=(beyond + end) / 2.0, rotation_steps=RIGHT_ANGLE_STEPS)


def _bump_height(fraction: float) -> float:
    """Return a hill's relative height at a fraction of its radius: 1 in the middle, 0 at the rim, level at both."""
    return (1.0 - fraction * fraction) * (1.0 - fraction * fraction)


FEATURES_BY_DIFFICULTY: dict[str, tuple[LaneFeature, ...]] = {
    "easy": (add_block, add_bollard, add_rock, add_gate, add_wedge, add_cone),
    "medium": (
        add_block,
        add_bollard,
        add_rock,
        add_gate,
        add_wedge,
        add_cone,
        add_pegs,
        add_baffle,
        add_hoop,
        add_mound,
        add_hump,
        add_rise,
        add_fall,
    ),
    "hard": (
        add_bollard,
        add_rock,
        add_gate,
        add_wedge,
        add_cone,
        add_pegs,
        add_chicane,
        add_baffle,
        add_hoop,
        add_mound,
        add_hump,
        add_ditch,
        add_rise,
        add_fall,
        add_jump,
        add_drop,
    ),
}
"""Features that the levels of each difficulty can have."""
