"""What happens on a lane: obstacles that stand on it and shapes of its ground. Lengths in metres.

A feature lays the piece of lane it needs. Each leaves a way of at least GAP past it, and none holds a ball: what rolls
in rolls out, slopes steeper than rolling resistance end in flat parts, and steps go down in the direction of play only.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from minigolf_env.courses.procedural.lane import QUARTER, Lane
from minigolf_env.courses.procedural.meshes import box, loft, prism, revolved
from minigolf_env.courses.procedural.portable_rng import Draws, circle

Feature: TypeAlias = Callable[[Lane, Draws], None]

HEIGHT = 0.12
"""Of borders and obstacles above the floor, m: what a ball thrown up by a cup's rim does not reach."""

ROOT = 0.05
"""How deep obstacles stand in the floor, m: there is no seam for a ball to find."""

GAP = 0.2
"""Narrowest way past an obstacle, m: five balls wide, nearly."""

STEP = 2.0**-5
"""Length of a drop in plan, m: steep, and still a function of the plan."""

ROLLING = 1.829**2 / (2.0 * 0.3048 * 10.0) / 9.81
"""Rolling resistance of the felt, a fast green of Stimp 10: the slope on which a ball neither speeds up nor slows."""

LEAST_SLOPE = ROLLING + 0.012
"""Felt is level or steeper: on gentler slopes balls creep for long, and rest where a putt along the slope is odd."""

SWELL = 6
"""Flat pieces a hump is made of: more would be gentler than LEAST_SLOPE at its top and its feet."""

RINGS = 4
"""The same of a mound, from its rim to its top."""


def block(lane: Lane, draws: Draws) -> None:
    """Stand a block askew in the middle."""
    lane.go(0.35)
    solid = box(draws.between(0.3, 0.5), draws.between(0.1, 0.15), -ROOT, HEIGHT)
    lane.stand("wood", solid, left=draws.between(-0.15, 0.15), turned=draws.integer(0, 11))
    lane.go(0.35)


def bollard(lane: Lane, draws: Draws) -> None:
    """Stand a round post with a pointed top, on which no ball comes to rest."""
    lane.go(0.3)
    r, h = draws.between(0.07, 0.13), HEIGHT
    profile = [(0.0, -ROOT), (r, -ROOT), (r, h), (0.6 * r, h + 0.05), (0.0, h + 0.07)]
    lane.stand("stone", revolved(profile, 32), left=draws.between(-0.15, 0.15))
    lane.go(0.3)


def rock(lane: Lane, draws: Draws) -> None:
    """Lay a rock of random shape."""
    lane.go(0.3)
    r = draws.between(0.13, 0.2)
    profile = [(0.0, -ROOT), (r, -ROOT), (r, 0.03), (0.85 * r, 0.09), (0.45 * r, 0.15), (0.0, 0.18)]
    swell = np.array([[draws.between(0.8, 1.2) for _ in range(9)] for _ in profile])
    lane.stand("stone", revolved(profile, 9, swell), left=draws.between(-0.12, 0.12), turned=draws.integer(0, 23))
    lane.go(0.3)


def cone(lane: Lane, draws: Draws) -> None:
    """Stand a cone or a pyramid: fast balls climb it."""
    lane.go(0.3)
    r = draws.between(0.12, 0.18)
    profile = [(0.0, -ROOT), (r, -ROOT), (r, 0.0), (0.0, draws.between(0.15, 0.3))]
    sides = draws.one_of((4, 5, 32))
    lane.stand("stone", revolved(profile, sides), left=draws.between(-0.15, 0.15), turned=draws.integer(0, 23))
    lane.go(0.3)


def wedge(lane: Lane, draws: Draws) -> None:
    """Stand a wedge with its edge to the player: it parts left from right."""
    lane.go(0.3)
    length, width = draws.between(0.25, 0.45), draws.between(0.15, 0.3)
    outline = [(-length / 2.0, 0.0), (length / 2.0, -width / 2.0), (length / 2.0, width / 2.0)]
    lane.stand("wood", prism(outline, -ROOT, HEIGHT), left=draws.between(-0.1, 0.1), turned=draws.integer(-1, 1))
    lane.go(0.3)


def pegs(lane: Lane, draws: Draws) -> None:
    """Stand a row of pegs across the lane, unevenly."""
    lane.go(0.3)
    r, many = 0.03, int((lane.width - GAP) / (GAP + 0.1))
    peg = revolved([(0.0, -ROOT), (r, -ROOT), (r, 0.1), (0.0, 0.13)], 16)
    spacing = lane.width / (many + 1)
    shift = draws.between(-0.04, 0.04)
    for k in range(many):
        lane.stand("stone", peg, draws.between(-0.1, 0.1), (k + 1) * spacing - lane.width / 2.0 + shift)
    lane.go(0.3)


def gate(lane: Lane, draws: Draws) -> None:
    """Narrow the lane to a gate."""
    lane.go(0.3)
    gap = draws.between(0.25, 0.4)
    middle = draws.between(-0.5, 0.5) * (lane.width - gap - 0.1)
    _wing(lane, lane.width / 2.0, middle + gap / 2.0)
    _wing(lane, -lane.width / 2.0, middle - gap / 2.0)
    lane.go(0.3)


def chicane(lane: Lane, draws: Draws) -> None:
    """Let two walls reach past the middle, one from each side."""
    lane.go(0.3)
    side, gap = draws.sign(), draws.between(0.28, 0.36)
    for turned in (side, -side):
        _wing(lane, turned * lane.width / 2.0, turned * (gap - lane.width / 2.0))
        lane.go(0.55)


def baffle(lane: Lane, draws: Draws) -> None:
    """Let a wall reach past the middle from one side."""
    lane.go(0.3)
    side = draws.sign()
    _wing(lane, side * lane.width / 2.0, side * (draws.between(0.28, 0.4) - lane.width / 2.0))
    lane.go(0.3)


def hoop(lane: Lane, draws: Draws) -> None:
    """Stand a hoop that the ball rolls through, or past."""
    lane.go(0.3)
    inner, thick = draws.between(0.13, 0.2), 0.03
    arch = circle(24)[:13]
    rings = []
    for c, s in [arch[0], *arch, arch[-1]]:
        out = [(thick * u, inner + thick + thick * v) for u, v in circle(8)]
        rings.append([(u, c * v, s * v) for u, v in out])
    ends = np.array(rings)
    ends[[0, -1], :, 2] -= ROOT
    lane.stand("wood", loft(ends), left=draws.between(-0.1, 0.1), turned=draws.integer(-1, 1))
    lane.go(0.3)


def mound(lane: Lane, draws: Draws) -> None:
    """Lay a round mound of felt that turns balls aside."""
    r = draws.between(0.25, 0.4) * min(1.0, lane.width)
    lane.go(r + 0.05)
    shares = [1.0 - k / RINGS for k in range(RINGS + 1)]
    height = _steep(
        draws.between(0.04, 0.07), [RINGS * (_bump(b) - _bump(a)) / r for a, b in itertools.pairwise(shares)]
    )
    rings = [(r * share, height * _bump(share)) for share in shares]
    lane.stand("felt", revolved([(0.0, -ROOT), (r, -ROOT), *rings], 32), left=draws.between(-0.2, 0.2))
    lane.go(r + 0.05)


def hump(lane: Lane, draws: Draws) -> None:
    """Let the ground swell across the lane."""
    _swell(lane, draws.between(0.04, 0.1), draws.between(0.8, 1.1), 1)


def ditch(lane: Lane, draws: Draws) -> None:
    """Let the ground sink across the lane."""
    _swell(lane, draws.between(0.03, 0.08), draws.between(0.8, 1.1), -1)


def rise(lane: Lane, draws: Draws) -> None:
    """Let the lane climb."""
    _slope(lane, draws.between(0.08, 0.16), draws.between(0.8, 1.2), 1)


def fall(lane: Lane, draws: Draws) -> None:
    """Let the lane descend."""
    _slope(lane, draws.between(0.08, 0.16), draws.between(0.8, 1.2), -1)


def jump(lane: Lane, draws: Draws) -> None:
    """Raise a ramp that ends in a drop: the ball flies."""
    lane.go(0.2)
    length = draws.between(0.5, 0.8)
    height = _steep(draws.between(0.06, 0.12), [1.0 / length])
    lane.go(length, height)
    lane.go(0.1)
    lane.go(STEP, -height)
    lane.go(0.7)


def drop(lane: Lane, draws: Draws) -> None:
    """Let the lane go on one step lower."""
    lane.go(0.2)
    lane.go(STEP, -draws.between(0.05, 0.12))
    lane.go(0.4)


def _slope(lane: Lane, height: float, length: float, sign: int) -> None:
    lane.go(0.15)
    # Gentler at both ends, so that the ball meets three small turns instead of two larger ones.
    pieces = ((0.15, 0.1), (0.7, 0.8), (0.15, 0.1))
    height = sign * _steep(height, [part / (share * length) for share, part in pieces])
    for share, part in pieces:
        lane.go(share * length, part * height)
    lane.go(0.25)


def _swell(lane: Lane, height: float, length: float, sign: int) -> None:
    lane.go(0.15)
    level, piece = lane.z, length / SWELL
    shares = [_bump(2.0 * k / SWELL - 1.0) for k in range(SWELL + 1)]
    height = sign * _steep(height, [(b - a) / piece for a, b in itertools.pairwise(shares)])
    for share in shares[1:]:
        lane.go(piece, level + height * share - lane.z)
    lane.z = level
    lane.go(0.25)


def _steep(height: float, slopes: list[float]) -> float:
    """Return a height, larger if need be, at which every slope is LEAST_SLOPE; ``slopes`` are those of height 1."""
    return max(height, LEAST_SLOPE / min(abs(slope) for slope in slopes))


def _wing(lane: Lane, border: float, end: float) -> None:
    """Stand a wall across the lane, from a border to an end, both as places left of the middle."""
    beyond = border + (0.03 if border > 0.0 else -0.03)
    wall = box(abs(beyond - end), 0.08, -ROOT, HEIGHT)
    lane.stand("wood", wall, left=(beyond + end) / 2.0, turned=QUARTER)


def _bump(share: float) -> float:
    """Return a hill's height at a share of its radius: 1 in the middle, 0 at the rim, level at both."""
    return (1.0 - share * share) * (1.0 - share * share)


FEATURES: dict[str, tuple[Feature, ...]] = {
    "easy": (block, bollard, rock, gate, wedge, cone),
    "medium": (block, bollard, rock, gate, wedge, cone, pegs, baffle, hoop, mound, hump, rise, fall),
    "hard": (bollard, rock, gate, wedge, cone, pegs, chicane, baffle, hoop, mound, hump, ditch, rise, fall, jump, drop),
}
"""What each difficulty draws from."""
