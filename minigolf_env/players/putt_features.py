"""Features of a putt with a given direction and strength, computed from an observation of bounce rays.

The line of a putt is traced with the walls that the nearest bounce ray hit. It is reflected off them as light is by
mirrors, which is how balls bounce off wooden borders. For each straight segment of the line, features describe by how
much it misses the cup, how it climbs, and how much roll the putt has left there. The features do not change when a
hole is moved or turned.

The features of a putt are NUM_FEATURES numbers of the order of 1. "Along" and "left" are relative to its direction:

    0-6     the slope along and left, the ground below, the height of the cup, the position on the level along and left,
            the fraction of the strokes that is left
    7-12    the distance to the cup, its component along, and its component left at four scales
    13-56   for each of the four segments: by how much the line misses the cup, at three scales; the length; how far
            along the segment is closest to the cup; is_exact; matches_neighbor; the direction along and left; the
            height of the end; the greatest height
    57-61   the roll distance as a fraction of the greatest, its square root first, and the roll beyond the cup at three
            scales
    62-73   for each of the four segments: the roll left next to the cup at two scales; how likely the ball drops
    74-75   the distance from the resting place to the cup, at two scales

Lengths are in metres. A putt has a direction, in radians counter-clockwise from x, and a roll distance (in names:
"roll"): how far it would roll on flat ground without walls, a measure of its energy. Arrays are for N balls, D
directions for each ball, and S roll distances for each direction.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses.course import EARTH_GRAVITY
from minigolf_env.courses.procedural.lane_features import FELT_ROLLING_RESISTANCE
from minigolf_env.courses.procedural.level import LEVEL_TOP_SPEED, WOOD_SURFACE
from minigolf_env.envs.observations.bounce_rays import (
    FEATURES_PER_SEGMENT,
    MAX_BOUNCE_RAY_LENGTH,
    NUM_BOUNCE_RAYS,
    NUM_SEGMENTS,
)
from minigolf_env.envs.observations.rays import CUP_DISTANCE_SCALE, NUM_CUP_FEATURES, NUM_GROUND_FEATURES
from minigolf_env.envs.observations.state import STATE_FEATURES

Array = NDArray[np.float32]

MAX_ROLL = LEVEL_TOP_SPEED**2 / (2.0 * FELT_ROLLING_RESISTANCE * -EARTH_GRAVITY[2])
"""Roll distance of a putt at top speed, m."""

ROLL_KEPT_PER_BOUNCE = WOOD_SURFACE.damping**2
"""Fraction of the roll distance that is left after a bounce."""

MIN_APPROACH_COSINE = 1e-3
"""A line hits a wall only if the cosine of the angle between it and the wall's inward normal is greater than this."""

PARALLEL_COSINE = 0.97
"""Two walls are the same wall only if the cosine of the angle between their normals is greater than this."""

SAME_WALL_DISTANCE = 0.04
"""Two walls are the same wall only if the end of one ray is closer than this to the plane of the other's wall, m."""

MAX_SEGMENT_LENGTH = 12.0
"""Longest segment, m: a line that is almost parallel to the wall of the nearest ray does not hit that wall."""

UNCERTAIN_SEGMENT_RANGE = 8.0
"""Length along which a segment that is not exact is searched for the cup, m."""

FEATURE_LENGTH_SCALE = 4.0
"""Length that counts as 1 in the features of distances, m."""

POSITION_FACTOR = 2.5
"""Factor of the ball's position within the bounds: the feature is 1 at 0.4 of the way from their middle to a side."""

DROP_MISS_SCALE = 0.04
"""Distance by which a line misses the cup at which the estimated chance to drop has fallen to 1/e, m."""

DROP_ROLL_SCALE = 3.0
"""Roll distance left at the cup at which the estimated chance to drop has fallen to 1/e, m."""

NUM_FEATURES = 20 + 14 * NUM_SEGMENTS
"""Number of features of a putt."""

REFLECTION_SIGNS = np.ones(NUM_FEATURES, np.float32)
"""Factors that exchange left and right in the features of a putt: -1 for components to the left, 1 for all others."""
REFLECTION_SIGNS[[1, 5, *range(9, 13), *(13 + 11 * i + k for i in range(NUM_SEGMENTS) for k in (0, 1, 2, 8))]] = -1.0

RAY_UNITS = np.array([MAX_BOUNCE_RAY_LENGTH, MAX_BOUNCE_RAY_LENGTH, 1.0, 1.0, 1.0, 1.0], np.float32)
"""Units of the numbers of a bounce ray's segment in the observation, m."""

STROKES_LEFT_INDEX = STATE_FEATURES.index("strokes left")
"""Index of the fraction of the strokes that is left, in an observation."""

GROUND_INDEX = len(STATE_FEATURES)
"""Index of the ground's depth in an observation."""

SLOPE_INDEX = GROUND_INDEX + 1
"""Index of the first component of the ground's slope in an observation."""

CUP_INDEX = GROUND_INDEX + NUM_GROUND_FEATURES
"""Index of the first component of the scaled vector to the cup in an observation."""

CUP_HEIGHT_INDEX = CUP_INDEX + 2
"""Index of the cup's height in an observation."""

FIRST_RAY_INDEX = CUP_INDEX + NUM_CUP_FEATURES
"""Index of the first number of the bounce rays in an observation."""


class PathSegment(NamedTuple):
    """A straight segment of the lines of putts, up to a wall.

    A line leaves the ball between two bounce rays: the nearest one, whose walls it is followed off, and the opposite
    one. The neighbor is the ray next to the nearest one on the other side.
    """

    start: Array
    """Start of the segment, relative to the ball, shape (N, D, 2)."""
    direction: Array
    """Unit vector along the segment, shape (N, D, 2)."""
    length: Array
    """Length up to the wall, shape (N, D)."""
    is_exact: NDArray[np.bool_]
    """True if the opposite ray hit the same walls up to this one, shape (N, D)."""
    matches_neighbor: NDArray[np.bool_]
    """True if the neighbor hit the same walls up to this one, shape (N, D)."""
    height: Array
    """Height of the end above the ball, shape (N, D)."""
    max_height: Array
    """Greatest height so far above the ball, shape (N, D)."""


def cup_position(observations: Array) -> Array:
    """Return the position of the cup relative to the ball in the xy-plane, shape (N, 2)."""
    scaled = observations[:, CUP_INDEX : CUP_INDEX + 2]
    return np.asarray(CUP_DISTANCE_SCALE * np.hypot(scaled[:, 0], scaled[:, 1])[:, None] * scaled)


def trace_lines(bounce_rays: Array, directions: Array) -> list[PathSegment]:
    """Return the NUM_SEGMENTS segments of lines in given directions, reflected off the walls that the bounce rays hit.

    Args:
        bounce_rays: segments of the bounce rays, shape (N, R, NUM_SEGMENTS, FEATURES_PER_SEGMENT).
        directions: directions of the lines, radians, shape (N, D).
    """
    # Choose the nearest ray, the opposite one, and the neighbor of the nearest one: see PathSegment.
    num_rays = bounce_rays.shape[1]
    ray_angles = directions * (num_rays / (2.0 * math.pi))
    nearest = np.rint(ray_angles).astype(np.int64)
    to_opposite = np.where(ray_angles >= nearest, 1, -1)
    rows = np.arange(len(bounce_rays))[:, None]
    chosen = [bounce_rays[rows, (nearest + step) % num_rays] for step in (0, to_opposite, -to_opposite)]
    # Follow the line from wall to wall.
    direction = np.stack([np.cos(directions), np.sin(directions)], axis=-1)
    start = np.zeros_like(direction)
    is_exact = np.ones(directions.shape, np.bool_)
    matches_neighbor = np.ones(directions.shape, np.bool_)
    segments = []
    for ray, opposite, neighbor in zip(*(np.moveaxis(rays, 2, 0) for rays in chosen), strict=True):
        end = ray[..., :2]
        normal = ray[..., 2:4]
        # Find where the line hits the ray's wall. A line without a wall is as long as the ray.
        approach = (direction * normal).sum(-1)
        hits = approach < -MIN_APPROACH_COSINE
        length = ((end - start) * normal).sum(-1) / np.where(hits, approach, np.float32(-1.0))
        hits &= (length >= 0.0) & (length < MAX_SEGMENT_LENGTH)
        length = np.where(hits, length, np.hypot(*np.moveaxis(end - start, -1, 0)))
        is_exact = is_exact & hits & _is_same_wall(opposite, end, normal)
        matches_neighbor = matches_neighbor & hits & _is_same_wall(neighbor, end, normal)
        segments.append(PathSegment(start, direction, length, is_exact, matches_neighbor, ray[..., 4], ray[..., 5]))
        # Reflect the line off the wall.
        start = start + length[..., None] * direction
        direction = direction - 2.0 * np.where(hits, approach, np.float32(0.0))[..., None] * normal
    return segments


def _is_same_wall(ray: Array, end: Array, normal: Array) -> NDArray[np.bool_]:
    """Return where segments of rays (N, D, 6) end at the wall through a point and with a normal, both (N, D, 2)."""
    is_parallel = (ray[..., 2:4] * normal).sum(-1) > PARALLEL_COSINE
    return np.asarray(is_parallel & (np.abs(((ray[..., :2] - end) * normal).sum(-1)) < SAME_WALL_DISTANCE))


def putt_features(observations: NDArray[Any], directions: NDArray[Any], roll_distances: NDArray[Any]) -> Array:
    """Return the features of putts, shape (N, D, S, NUM_FEATURES), scaled to the order of 1.

    Args:
        observations: observations of the kind "bounce_rays", shape (N, 2320).
        directions: directions of the putts, radians, shape (N, D).
        roll_distances: roll distances of the putts, m, shape (N, D, S).
    """
    # Trace the lines of the putts.
    observations = np.asarray(observations, dtype=np.float32)
    directions = np.asarray(directions, dtype=np.float32)
    roll = np.asarray(roll_distances, dtype=np.float32)
    ray_shape = (len(observations), NUM_BOUNCE_RAYS, NUM_SEGMENTS, FEATURES_PER_SEGMENT)
    bounce_rays = observations[:, FIRST_RAY_INDEX:].reshape(ray_shape) * RAY_UNITS
    segments = trace_lines(bounce_rays, directions)
    cup = cup_position(observations)[:, None]
    # Collect features by direction (N, D), and by direction and roll distance (N, D, S).
    first_direction = segments[0].direction
    by_direction = _surroundings(observations, first_direction)
    cup_distance = np.hypot(cup[..., 0], cup[..., 1])
    rest_to_cup = _resting_places(segments, roll) - cup[:, :, None]
    by_roll = [np.sqrt(roll / MAX_ROLL), roll / MAX_ROLL, *_scales(roll - cup_distance[..., None], 1.0, 6.0, 36.0)]
    height = np.zeros(directions.shape, np.float32)
    for segment in segments:
        miss, closest = _closest_to_cup(segment, cup)
        by_direction += _scales(miss, 0.05, 0.3, 2.0)
        by_direction += [segment.length / FEATURE_LENGTH_SCALE, closest / FEATURE_LENGTH_SCALE]
        by_direction += [segment.is_exact, segment.matches_neighbor]
        by_direction += [(segment.direction * first_direction).sum(-1), _cross(first_direction, segment.direction)]
        by_direction += [*_scales(segment.height - height, 0.1), *_scales(segment.max_height - height, 0.1)]
        # Estimate the chance that the ball drops: it must pass over the cup, and slowly enough.
        roll_at_cup = roll - closest[..., None]
        passes_over = np.exp(-np.square(miss / DROP_MISS_SCALE))[..., None]
        is_slow = np.where(roll_at_cup > 0.0, np.exp(-np.maximum(roll_at_cup, 0.0) / DROP_ROLL_SCALE), 0.0)
        by_roll += [*_scales(roll_at_cup, 1.0, 8.0), passes_over * is_slow]
        # Subtract the roll that the segment, its climb and the bounce at its end take.
        roll_used = segment.length + (segment.height - height) / FELT_ROLLING_RESISTANCE
        roll = (roll - roll_used[..., None]) * ROLL_KEPT_PER_BOUNCE
        height = segment.height
    by_roll += _scales(np.hypot(rest_to_cup[..., 0], rest_to_cup[..., 1]), FEATURE_LENGTH_SCALE, 0.5)
    # Join the features.
    features = np.empty((*roll.shape, len(by_direction) + len(by_roll)), np.float32)
    for k, column in enumerate([*(column[..., None] for column in by_direction), *by_roll]):
        features[..., k] = column
    return features


def _surroundings(observations: Array, direction: Array) -> list[NDArray[Any]]:
    """Return the features (N, D) that do not depend on walls, for putts along unit vectors (N, D, 2)."""
    cup = cup_position(observations)[:, None]

    def constant(index: int) -> Array:
        return np.broadcast_to(observations[:, index, None], direction.shape[:2])

    def components(vector: Array) -> list[Array]:
        return [(direction * vector).sum(-1), _cross(direction, vector)]

    cup_along, cup_left = components(cup)
    # The tee is in the middle of a level's bounds: if the cup is hidden, the lane leads away from the tee.
    position = POSITION_FACTOR * observations[:, None, :2]
    slope = observations[:, None, SLOPE_INDEX : SLOPE_INDEX + 2]
    # Few strokes left are a sign that the ball is in a place where putts behave unexpectedly.
    return [
        *components(slope),
        constant(GROUND_INDEX),
        constant(CUP_HEIGHT_INDEX),
        *components(position),
        constant(STROKES_LEFT_INDEX),
        np.hypot(cup_along, cup_left) / FEATURE_LENGTH_SCALE,
        cup_along / FEATURE_LENGTH_SCALE,
        *_scales(cup_left, 0.05, 0.2, 1.0, FEATURE_LENGTH_SCALE),
    ]


def _closest_to_cup(segment: PathSegment, cup: Array) -> tuple[Array, Array]:
    """Return by how much segments miss the cup, positive if it is on the left, and how far along they are closest."""
    to_cup = cup - segment.start
    # A segment that is not exact is searched beyond its wall: the cup may be behind it.
    longest = np.where(segment.is_exact, segment.length, UNCERTAIN_SEGMENT_RANGE)
    closest = np.clip((to_cup * segment.direction).sum(-1), 0.0, longest)
    offset = to_cup - closest[..., None] * segment.direction
    return np.copysign(np.hypot(offset[..., 0], offset[..., 1]), _cross(segment.direction, to_cup)), closest


def _resting_places(segments: list[PathSegment], roll: Array) -> Array:
    """Return where putts with roll distances (N, D, S) come to rest, relative to the ball, shape (N, D, S, 2)."""
    rest = np.zeros((*roll.shape, 2), np.float32)
    is_rolling = np.ones(roll.shape, np.bool_)
    for segment in segments:
        length = segment.length[..., None]
        rolled = roll if segment is segments[-1] else np.minimum(roll, length)
        end = segment.start[:, :, None] + rolled[..., None] * segment.direction[:, :, None]
        rest = np.where(is_rolling[..., None], end, rest)
        is_rolling &= roll > length
        roll = (roll - length) * ROLL_KEPT_PER_BOUNCE
    return rest


def putt_actions(directions: NDArray[Any], roll_distances: NDArray[Any]) -> Array:
    """Return the actions (..., 2) of putts with directions and roll distances (...)."""
    speed = np.sqrt(np.minimum(roll_distances / MAX_ROLL, 1.0))  # As a fraction of the top speed.
    return np.stack([speed * np.cos(directions), speed * np.sin(directions)], axis=-1).astype(np.float32)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _scales(lengths: Array, *scales: float) -> list[Array]:
    """Return lengths at several scales, each clipped to [-1, 1]: precise near 0, and still informative far away."""
    return [np.clip(lengths / scale, -1.0, 1.0) for scale in scales]
