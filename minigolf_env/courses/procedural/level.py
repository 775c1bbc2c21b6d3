"""Level as a Course: its meshes, tee, cup, bounds and route."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import quote
from minigolf_env.courses.course import (
    CUP_LINER_THICKNESS,
    EMBED_DEPTH,
    GOLF_BALL_RADIUS,
    Course,
    CourseError,
    Cup,
    Material,
    Part,
    Tee,
)
from minigolf_env.courses.procedural.lane_features import FELT_ROLLING_RESISTANCE, OBSTACLE_HEIGHT
from minigolf_env.courses.procedural.layout import (
    DIFFICULTY_NAMES,
    GENERATOR_VERSION,
    TEE_LENGTH,
    Layout,
    generate_layout,
)
from minigolf_env.courses.procedural.portable_rng import COSINE_RESOLUTION, PortableRng, unit_circle
from minigolf_env.courses.procedural.portable_solids import (
    ROOF_SLOPE,
    SolidMesh,
    extrude_surface_down,
    fill_between_loops,
    loft,
    merge_solids,
    revolve_profile,
)
from minigolf_env.physics import Surface, TriangleMesh

CUP_SIDES = 64
"""Number of sides of the cup."""

CUP_CORNER_RATIO = round(COSINE_RESOLUTION / math.cos(math.pi / CUP_SIDES)) / COSINE_RESOLUTION
"""Distance of the cup's corners from its axis, in radii, so that the whole circle of its radius is open."""

BORDER_WIDTH = 0.07
"""Width of the border, m."""

FLOOR_BELOW_LOWEST = 0.02
"""Thickness of the floor below its obstacles and its cup, m."""

MAX_CUP_RADIUS = 0.2
"""Largest radius of a cup, m: every level has room for it."""

TEE_HALF_SIZE = 0.15
"""Half the side of the tee square, m: for every heading of the lane, the square keeps clear of its borders."""

BOUNDS_HALF_SIZE = 10.0
"""Half the side of the bounds along x and y, around the tee, m; equal for all levels, so that observations have one
scale."""

BOUNDS_LEVELS = (-1.5, 1.5)
"""Lowest and highest level of the bounds, relative to the tee, m: no lane is so deep, and no ball flies so high."""

LEVEL_TOP_SPEED = 6.0
"""Launch speed of a full putt on levels, m/s, as on the dogleg."""

# Levels must not import pydantic, which loads slowly, and with it BUILTIN_SURFACES: a test compares both.
FELT_SURFACE = Surface(restitution=0.3, tangential=1.0, rolling=FELT_ROLLING_RESISTANCE)
"""Surface of the floor: facets of curved ground do not slow a ball, rolling resistance does."""

WOOD_SURFACE = Surface(damping=0.7)
"""Surface of borders and obstacles."""

LINING_SURFACE = Surface(damping=0.5, restitution=0.2, rolling=FELT_SURFACE.rolling)
"""Surface of the cup, as on the dogleg."""

OBSTACLE_PARTS: tuple[tuple[str, str, Material, Surface], ...] = (
    ("felt", "mounds", "felt", FELT_SURFACE),
    ("wood", "blocks", "wood", WOOD_SURFACE),
    ("stone", "stones", "stone", WOOD_SURFACE),
)
"""Kind of obstacle, and the name, material and surface of its part: the physics is fastest with one mesh for each
kind."""


def build_level(difficulty: str, level: int, cup_radius: float = Cup.radius) -> Course:
    """Return a level, the same for the same arguments on every machine.

    Args:
        difficulty: one of DIFFICULTY_NAMES.
        level: number of the level, >= 0.
        cup_radius: radius of the cup, m; nothing else of the level depends on it.

    Raises:
        CourseError: the ball does not fit into the cup, or the cup does not fit between the borders.
    """
    if cup_radius > MAX_CUP_RADIUS:
        raise CourseError(f"cup radius: expected at most {MAX_CUP_RADIUS} m, received {quote(cup_radius)}; give less.")
    rng = PortableRng(GENERATOR_VERSION, DIFFICULTY_NAMES.index(difficulty), level)
    layout = generate_layout(difficulty, rng)
    cup = Cup(layout.cup, cup_radius)
    cup.check_ball_fits(GOLF_BALL_RADIUS)
    tee = _build_tee(layout)
    low, high = BOUNDS_LEVELS
    return Course(
        name=f"procedural-v{GENERATOR_VERSION}-{difficulty}-{level}",
        parts=_build_parts(layout, cup),
        tee=tee,
        cup=cup,
        par=min(2 + layout.legs // 2, 4),
        bounds=((-BOUNDS_HALF_SIZE, -BOUNDS_HALF_SIZE, low), (BOUNDS_HALF_SIZE, BOUNDS_HALF_SIZE, high)),
        route=(tee.centre, *layout.lane.route),
        top_speed=LEVEL_TOP_SPEED,
    )


def _build_tee(layout: Layout) -> Tee:
    """Return a square in the flat part before the first feature; the level of the tee is 0."""
    c, s = layout.lane.start
    x = c * TEE_LENGTH / 2.0
    y = s * TEE_LENGTH / 2.0
    return Tee(lower=(x - TEE_HALF_SIZE, y - TEE_HALF_SIZE), upper=(x + TEE_HALF_SIZE, y + TEE_HALF_SIZE), height=0.0)


def _build_parts(layout: Layout, cup: Cup) -> tuple[Part, ...]:
    # Find the level of the bottom, below all obstacles and the cup.
    lane = layout.lane
    rim = cup.position[2]
    lowest = min(z for _, _, z in lane.points)
    bottom = min(lowest - EMBED_DEPTH, rim - cup.depth - CUP_LINER_THICKNESS) - FLOOR_BELOW_LOWEST
    # Build the lane, and one part for each kind of obstacle.
    parts = [
        _make_part("floor", [_build_floor(layout, cup, bottom)], "felt", FELT_SURFACE),
        _make_part("cup", [_build_cup_liner(cup)], "cup", LINING_SURFACE),
        _make_part("border", [_build_border(layout, bottom)], "wood", WOOD_SURFACE),
    ]
    solids: dict[str, list[SolidMesh]] = {}
    for kind, solid in lane.obstacles:
        solids.setdefault(kind, []).append(solid)
    for kind, name, material, surface in OBSTACLE_PARTS:
        if kind in solids:
            parts.append(_make_part(name, solids[kind], material, surface))
    return tuple(parts)


def _make_part(name: str, solids: list[SolidMesh], material: Material, surface: Surface) -> Part:
    solid = merge_solids(solids)
    return Part(name, TriangleMesh(solid.vertices, solid.faces, surface, name=name), material)


def _hole_corners(cup: Cup) -> NDArray[np.float64]:
    """Return the corners (CUP_SIDES, 3) of the hole in the floor, around the cup and its liner."""
    x, y, rim = cup.position
    distance = (cup.radius + CUP_LINER_THICKNESS) * CUP_CORNER_RATIO
    return np.array([(x + distance * c, y + distance * s, rim) for c, s in unit_circle(CUP_SIDES)])


def _build_floor(layout: Layout, cup: Cup, bottom: float) -> SolidMesh:
    """Return the floor: quads between cross-sections, with the hole in the flat piece that contains the cup."""
    lane = layout.lane
    points = np.concatenate([np.array(lane.points), _hole_corners(cup)])
    hole = list(range(len(lane.points), len(points)))
    faces: list[tuple[int, int, int]] = []
    for k, ((left, right), (next_left, next_right)) in enumerate(itertools.pairwise(lane.sections)):
        if k == layout.cup_section:
            faces += fill_between_loops([right, next_right, next_left, left], hole, points.tolist())
            continue
        if right != next_right:
            faces.append((right, next_right, next_left))
        if left != next_left:
            faces.append((right, next_left, left))
    return extrude_surface_down(points, np.array(faces), bottom)


def _build_cup_liner(cup: Cup) -> SolidMesh:
    """Return the cup's wall and bottom, its rim flush with the floor and sharing its edges."""
    x, y, rim = cup.position
    inner = cup.radius * CUP_CORNER_RATIO
    outer = (cup.radius + CUP_LINER_THICKNESS) * CUP_CORNER_RATIO
    under = -cup.depth - CUP_LINER_THICKNESS
    profile = [(0.0, under), (outer, under), (outer, 0.0), (inner, 0.0), (inner, -cup.depth), (0.0, -cup.depth)]
    return revolve_profile(profile, CUP_SIDES).transformed(x, y, rim)


def _build_border(layout: Layout, bottom: float) -> SolidMesh:
    """Return the border: a wall of constant height above the floor around the lane, its top sloping inwards."""
    # Offset the lane's boundary outwards, with mitred corners.
    inner = np.array([layout.lane.points[k] for k in layout.lane.boundary()])
    directions = np.roll(inner, -1, axis=0)[:, :2] - inner[:, :2]
    directions = directions / np.sqrt(directions[:, :1] * directions[:, :1] + directions[:, 1:] * directions[:, 1:])
    after = np.column_stack([directions[:, 1], -directions[:, 0]])
    before = np.roll(after, 1, axis=0)
    mitre = (before + after) / (1.0 + before[:, :1] * after[:, :1] + before[:, 1:] * after[:, 1:])
    outer = inner[:, :2] + BORDER_WIDTH * mitre
    # Join the cross-sections of the wall.
    top = inner[:, 2:] + OBSTACLE_HEIGHT
    low = np.full((len(inner), 1), bottom)
    corners = [(inner[:, :2], low), (inner[:, :2], top), (outer, top + ROOF_SLOPE * BORDER_WIDTH), (outer, low)]
    return loft(np.stack([np.column_stack(corner) for corner in corners], axis=1), cyclic=True)
