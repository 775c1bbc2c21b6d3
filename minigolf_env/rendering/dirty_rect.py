"""The dirty rectangle: the part of an image that ball, flag and lines may change.

While the camera stands still, the renderer copies a cached background and draws only this rectangle again. The
rectangle bounds the projections of axis-aligned boxes around everything that moves and around its shadow.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.courses import Course
from minigolf_env.rendering.camera import Camera
from minigolf_env.rendering.lighting import LIGHTING
from minigolf_env.rendering.props import CLOTH_LENGTH, POLE_HEIGHT, SUN_DIRECTION, flag_rest_position
from minigolf_env.rendering.scene_state import SceneState

FloatArray = NDArray[np.float64]

MAX_PENUMBRA_GROWTH = 0.1
"""Upper bound of the growth of a penumbra per metre of distance from the occluder; that of the ball is 0.08."""

PIXEL_ROUNDING = np.array([[-1.0], [2.0]])
"""Offsets added to the floored lower and upper edges: they round outwards and add a margin of one pixel."""

MIN_CLIP_W = 1e-6
"""Distance in front of the camera below which a box counts as behind it, m."""

NEAR_AND_FAR = np.array([[[-1.0]], [[1.0]]])
"""Signs of a box's half-extent towards the camera and away from it."""


class PixelRect(NamedTuple):
    """A rectangle of an image, in pixels from its upper left corner."""

    left: int
    top: int
    right: int
    bottom: int


def compute_dirty_rect(course: Course, camera: Camera, state: SceneState, size: tuple[int, int]) -> PixelRect:
    """Return the rectangle of an image of (width, height) pixels outside of which only the course is visible.

    The rectangle contains the ball with everything that it shades, the lines, and a lifted flag with its shadow.
    """
    cubes = _moving_cubes(course, state)
    centers = np.array([center for center, _ in cubes])
    half_extents = np.array([[half_extent] * 3 for _, half_extent in cubes])
    lower, upper = project_aabbs(centers, half_extents, camera.clip_from_world(size[0] / size[1]))
    # From clip coordinates, y up, to pixels, y down.
    left, right = lower[:, 0].min(), upper[:, 0].max()
    top, bottom = -upper[:, 1].max(), -lower[:, 1].min()
    pixels = (0.5 + 0.5 * np.array([[left, top], [right, bottom]])) * size
    corners = np.clip(np.floor(pixels) + PIXEL_ROUNDING, 0, size).astype(int).tolist()
    return PixelRect(*corners[0], *corners[1])


def project_aabbs(centers: FloatArray, half_extents: FloatArray, clip: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper bounds (N, 2) of axis-aligned boxes in the image, x and y in [-1, 1].

    Args:
        centers: centres (N, 3) of the boxes, m.
        half_extents: half sizes (N, 3) of the boxes, m.
        clip: matrix (4, 4) from world to clip coordinates. A box that reaches behind the camera has infinite bounds.
    """
    rows = clip[[0, 1, 3]]
    center = centers @ rows[:, :3].T + rows[:, 3]
    spread = half_extents @ np.abs(rows[:, :3]).T
    xy = np.stack([center - spread, center + spread])[..., :2]
    w = center[:, 2:] + spread[:, 2:] * NEAR_AND_FAR
    corners = xy[:, None] / np.maximum(w, MIN_CLIP_W)
    is_behind = w[0] < MIN_CLIP_W
    lower = np.where(is_behind, -np.inf, corners.min(axis=(0, 1)))
    upper = np.where(is_behind, np.inf, corners.max(axis=(0, 1)))
    return lower, upper


def _moving_cubes(course: Course, state: SceneState) -> list[tuple[FloatArray, float]]:
    """Return centres (3,) and half sizes, m, of cubes around everything that moves, and around its shadows."""
    ground = _lowest_point(course)
    # The ball with the surroundings that it darkens, and its shadow.
    radius = state.drawn_radius(course.ball_radius)
    shadow_distance = _max_shadow_distance(state.ball, ground)
    cubes = [
        (state.ball, LIGHTING.occlusion_range * radius),
        (state.ball - shadow_distance * SUN_DIRECTION, 2.0 * radius + MAX_PENUMBRA_GROWTH * shadow_distance),
    ]
    # A lifted flag: where it stood and where it is, each with the shadow of the cloth.
    rest = flag_rest_position(course)
    if not np.array_equal(state.flag, rest):
        for foot in (rest, state.flag):
            top = foot + np.array([0.0, 0.0, POLE_HEIGHT])
            shadow_distance = _max_shadow_distance(top, ground)
            shadow_size = 1.2 * CLOTH_LENGTH + MAX_PENUMBRA_GROWTH * shadow_distance
            cubes += [
                (foot, CLOTH_LENGTH),
                (top, 1.2 * CLOTH_LENGTH),
                (top - shadow_distance * SUN_DIRECTION, shadow_size),
            ]
    cubes += [(point, line.width) for line in state.lines for point in line.points]
    return cubes


@functools.lru_cache(maxsize=64)
def _lowest_point(course: Course) -> float:
    """Return the lowest z of a course, m."""
    return min(float(part.mesh.vertices[:, 2].min()) for part in course.parts)


def _max_shadow_distance(point: FloatArray, ground: float) -> float:
    """Return the greatest distance of a point (3,) to its shadow, m: the shadow is on the lowest ground."""
    return max(0.0, float(point[2]) - ground) / float(SUN_DIRECTION[2])
