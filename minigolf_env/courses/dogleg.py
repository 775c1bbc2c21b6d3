r"""The dogleg: an L-shaped hole of par 2 whose cup lies round the corner.

::

                          _______
                         /   o   \      cup
                        |         |
                        |    O    |     bollard
     ___________________|         |
    |                             |
    | tee      //                 |     block
    |                            /
    |__________________________/

The outer corner and those behind the cup are cut at 45 degrees, so that banks pay: from every tee there are holes in
one, though no straight putt can reach the cup.
"""

from __future__ import annotations

from shapely import Polygon, box
from shapely.affinity import rotate

from minigolf_env.courses.course import GOLF_BALL, Course, Cup, Part, Tee
from minigolf_env.courses.solids import ROOT, disc, extruded, floor_with_cup, part, revolved
from minigolf_env.physics import Surface

LANE = Polygon([(0, 0), (3, 0), (4, 1), (4, 2.1), (3.6, 2.5), (3.15, 2.5), (2.75, 2.1), (2.75, 1.25), (0, 1.25)])
"""Where the ball rolls, m: 1.25 m wide, the standard of minigolf."""

TEE = Tee(lower=(0.2, 0.325), upper=(0.5, 0.925), height=0.0)

CUP = (3.45, 2.1, 0.0)
"""The rim's centre, m."""

INNER_CORNER = (2.85, 1.15)
"""Where the route turns: 0.1 m off both borders that meet at the inner corner, m."""

BLOCK = rotate(box(1.7, 0.545, 2.1, 0.705), -30.0)
"""Outline of the block, m; it stands across the middle of the first leg and leaves 0.45 m on either side."""

BOLLARD, BOLLARD_RADIUS = (3.3, 1.5), 0.11
"""The bollard's axis and radius, m; it hides the cup from the corner."""

HEIGHT = 0.12
"""Of borders and obstacles, m: of 50,000 balls aimed at the cup from nearby, at any speed, none was thrown so high."""

BORDER = 0.07
"""Width of the border, m."""

AIR = (-0.3, 2.0)
"""Levels between which the ball is in bounds, m: far below the floor, and higher than it can fly."""

TOP_SPEED = 6.0
"""m/s: at 4.5 half as many putts are holes in one."""

STIMP = 10.0
"""Speed of the felt, in feet on a stimpmeter: a fast green."""

FELT = Surface(restitution=0.3, tangential=1.0, rolling=1.829**2 / (2.0 * 0.3048 * STIMP) / 9.81)
"""Landing costs a ball no speed along the floor; rolling brakes it."""

WOOD = Surface(damping=0.7)
"""Borders and obstacles: the seed's single damping."""

LINING = Surface(damping=0.5, restitution=0.2, rolling=FELT.rolling)
"""The cup: takes so much speed that the ball soon lies still, and that no ball striking the rim at TOP_SPEED clears the
border. It brakes a rolling ball no more than felt, or balls would hang on the rim."""


def build(cup_radius: float = Cup.radius) -> Course:
    """Return the dogleg with a cup of the given radius, m.

    Raises:
        CourseError: the ball does not fit into the cup, or the cup not between borders and obstacles.
    """
    cup = Cup(CUP, cup_radius)
    cup.check_takes(GOLF_BALL)
    outside = LANE.buffer(BORDER, join_style="mitre")
    left, front, right, back = outside.bounds
    return Course(
        name="dogleg",
        parts=(*_floor(cup), part("border", extruded(outside - LANE, -ROOT, HEIGHT), "wood", WOOD), *_obstacles()),
        tee=TEE,
        cup=cup,
        par=2,
        bounds=((left, front, AIR[0]), (right, back, AIR[1])),
        route=(TEE.centre, INNER_CORNER, CUP[:2]),
        top_speed=TOP_SPEED,
    )


def _floor(cup: Cup) -> tuple[Part, Part]:
    under_border = LANE.buffer(BORDER / 2.0, join_style="mitre")
    clear = LANE - BLOCK - disc(BOLLARD, BOLLARD_RADIUS)
    return floor_with_cup(under_border, clear, cup, FELT, LINING)


def _obstacles() -> tuple[Part, Part]:
    r = BOLLARD_RADIUS
    # No flat top, on which a ball could come to rest.
    bollard = [(0.0, -ROOT), (r, -ROOT), (r, HEIGHT), (0.6 * r, HEIGHT + 0.05), (0.0, HEIGHT + 0.07)]
    return (
        part("block", extruded(BLOCK, -ROOT, HEIGHT), "wood", WOOD),
        part("bollard", revolved(bollard, BOLLARD), "stone", WOOD),
    )
