"""A level as a Course: meshes, tee, cup, bounds and route."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses.course import GOLF_BALL, Course, CourseError, Cup, Material, Part, Tee
from minigolf_env.courses.procedural.features import HEIGHT, ROLLING, ROOT
from minigolf_env.courses.procedural.layout import DIFFICULTIES, GENERATOR, TEE_LENGTH, Layout, lay_out
from minigolf_env.courses.procedural.meshes import PITCH, Solid, between_loops, loft, merged, revolved, slab
from minigolf_env.courses.procedural.portable_rng import FINE, Draws, circle
from minigolf_env.physics import Surface, TriangleMesh

SIDES = 64
"""Of the cup."""

CORNER = round(FINE / math.cos(math.pi / SIDES)) / FINE
"""How far the cup's corners are from its axis, in radii: all within the radius is open."""

LINER = 0.003
"""Thickness of the cup's wall and bottom, m."""

BORDER = 0.07
"""Width of the border, m."""

SLAB = 0.02
"""What the floor reaches below the lowest place, m."""

WIDEST_CUP = 0.2
"""Largest radius of a cup, m: every level has room for it."""

TEE_HALF = 0.15
"""Half a side of the tee box, m: whichever way the lane leads, the box keeps clear of its borders."""

REACH = 10.0
"""Half a side of the bounds in plan, around the tee, m: the same for all levels: observations have one scale."""

AIR = (-1.5, 1.5)
"""Levels between which the ball is in bounds, from the tee, m: no lane is so deep, no ball flies so high."""

TOP_SPEED = 6.0
"""m/s, as on the dogleg."""

FELT = Surface(restitution=0.3, tangential=1.0, rolling=ROLLING)
"""Curved ground does not brake, rolling does."""

WOOD = Surface(damping=0.7)
"""Borders and obstacles."""

LINING = Surface(damping=0.5, restitution=0.2, rolling=FELT.rolling)
"""The cup, as the dogleg's."""

OBSTACLES: tuple[tuple[str, str, Material, Surface], ...] = (
    ("felt", "mounds", "felt", FELT),
    ("wood", "blocks", "wood", WOOD),
    ("stone", "stones", "stone", WOOD),
)
"""Each kind of obstacle: what its part is called, looks like and plays like; one mesh a kind costs least."""


def build_level(difficulty: str, level: int, cup_radius: float = Cup.radius) -> Course:
    """Return a level, the same for the same arguments on every machine.

    Args:
        difficulty: one of DIFFICULTIES.
        level: its number, >= 0.
        cup_radius: m; nothing else of the level depends on it.

    Raises:
        CourseError: the ball does not fit into the cup, or the cup not between the borders.
    """
    if cup_radius > WIDEST_CUP:
        raise CourseError(f"cup radius: expected at most {WIDEST_CUP} m, received {cup_radius!r}; give less.")
    layout = lay_out(difficulty, Draws(GENERATOR, DIFFICULTIES.index(difficulty), level))
    cup = Cup(layout.cup, cup_radius)
    cup.check_takes(GOLF_BALL)
    tee = _tee(layout)
    return Course(
        name=f"procedural-v{GENERATOR}-{difficulty}-{level}",
        parts=_parts(layout, cup),
        tee=tee,
        cup=cup,
        par=min(2 + layout.legs // 2, 4),
        bounds=((-REACH, -REACH, AIR[0]), (REACH, REACH, AIR[1])),
        route=(tee.centre, *layout.lane.route),
        top_speed=TOP_SPEED,
    )


def _tee(layout: Layout) -> Tee:
    """Return a square in the flat part before the first feature; the level of the tee is 0."""
    c, s = layout.lane.start
    x, y, half = c * TEE_LENGTH / 2.0, s * TEE_LENGTH / 2.0, TEE_HALF
    return Tee(lower=(x - half, y - half), upper=(x + half, y + half), height=0.0)


def _parts(layout: Layout, cup: Cup) -> tuple[Part, ...]:
    lane, rim = layout.lane, cup.position[2]
    lowest = min(z for _, _, z in lane.points)
    bottom = min(lowest - ROOT, rim - cup.depth - LINER) - SLAB
    solids: dict[str, list[Solid]] = {}
    for kind, solid in lane.obstacles:
        solids.setdefault(kind, []).append(solid)
    parts = [
        _part("floor", [_floor(layout, cup, bottom)], "felt", FELT),
        _part("cup", [_liner(cup)], "cup", LINING),
        _part("border", [_border(layout, bottom)], "wood", WOOD),
    ]
    for kind, name, material, surface in OBSTACLES:
        if kind in solids:
            parts.append(_part(name, solids[kind], material, surface))
    return tuple(parts)


def _part(name: str, solids: list[Solid], material: Material, surface: Surface) -> Part:
    solid = merged(solids)
    return Part(name, TriangleMesh(solid.vertices, solid.faces, surface, name=name), material)


def _hole(cup: Cup) -> NDArray[np.float64]:
    """Return the corners (SIDES, 3) of the hole in the floor, around the cup's circle and its liner."""
    x, y, rim = cup.position
    reach = (cup.radius + LINER) * CORNER
    return np.array([(x + reach * c, y + reach * s, rim) for c, s in circle(SIDES)])


def _floor(layout: Layout, cup: Cup, bottom: float) -> Solid:
    """Return the floor: quadrangles between cross-sections, and a cell with a hole in it."""
    lane = layout.lane
    points = np.concatenate([np.array(lane.points), _hole(cup)])
    hole = list(range(len(lane.points), len(points)))
    faces: list[tuple[int, int, int]] = []
    for k, ((l0, r0), (l1, r1)) in enumerate(itertools.pairwise(lane.sections)):
        if k == layout.cell:
            faces += between_loops([r0, r1, l1, l0], hole, points.tolist())
            continue
        if r0 != r1:
            faces.append((r0, r1, l1))
        if l0 != l1:
            faces.append((r0, l1, l0))
    return slab(points, np.array(faces), bottom)


def _liner(cup: Cup) -> Solid:
    """Return the cup's wall and bottom, its rim flush with the floor and sharing its edges."""
    x, y, rim = cup.position
    inner, outer = cup.radius * CORNER, (cup.radius + LINER) * CORNER
    under = -cup.depth - LINER
    profile = [(0.0, under), (outer, under), (outer, 0.0), (inner, 0.0), (inner, -cup.depth), (0.0, -cup.depth)]
    return revolved(profile, SIDES).moved(x, y, rim)


def _border(layout: Layout, bottom: float) -> Solid:
    """Return the border: a wall around the lane, as high above the floor everywhere, its top falling inwards."""
    inner = np.array([layout.lane.points[k] for k in layout.lane.ring()])
    ways = np.roll(inner, -1, axis=0)[:, :2] - inner[:, :2]
    ways = ways / np.sqrt(ways[:, :1] * ways[:, :1] + ways[:, 1:] * ways[:, 1:])
    after = np.column_stack([ways[:, 1], -ways[:, 0]])
    before = np.roll(after, 1, axis=0)
    mitre = (before + after) / (1.0 + before[:, :1] * after[:, :1] + before[:, 1:] * after[:, 1:])
    outer = inner[:, :2] + BORDER * mitre
    top, low = inner[:, 2:] + HEIGHT, np.full((len(inner), 1), bottom)
    corners = [(inner[:, :2], low), (inner[:, :2], top), (outer, top + PITCH * BORDER), (outer, low)]
    return loft(np.stack([np.column_stack(corner) for corner in corners], axis=1), cyclic=True)
