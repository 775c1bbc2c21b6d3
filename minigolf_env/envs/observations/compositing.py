"""Compiled drawing of the ball into kept images of courses from above.

A pixel's surface is lit again as surface.frag lights it, with the ball's shadow and ambient occlusion; then the marker
of the ball is drawn, or its ghost where something hides it. The shader is the reference: images differ by rounding.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.physics.jit import device_function, kernel
from minigolf_env.physics.types import FloatArray, Vec3
from minigolf_env.physics.vec3 import dot, sub, vec3
from minigolf_env.rendering.dirty_rect import PixelRect
from minigolf_env.rendering.lighting import Lighting

NO_NORMAL = 128
"""Component of a G-buffer's normal that is 0; all three are 0 where the ball does not darken the surface."""

MIN_DISTANCE_SQ = 1e-12
"""Smallest square of the distance from the ball's centre to a surface that occlusion is computed with, m^2."""


class TopView(NamedTuple):
    """The G-buffer of a course without a ball, from straight above; x to the right, y up."""

    color: NDArray[np.uint8]
    """(S, S, 3) the image."""
    albedo_and_sunlight: NDArray[np.uint8]
    """(S, S, 4), see GBuffer."""
    normal: NDArray[np.uint8]
    """(S, S, 3), see GBuffer."""
    distance: NDArray[np.float32]
    """(S, S), see GBuffer."""
    focal_length: float
    """Size in pixels of a metre at a distance of 1 m."""
    eye_x: float
    """Position of the camera, m."""
    eye_y: float
    """Position of the camera, m."""
    eye_z: float
    """Position of the camera, m."""
    max_distance: float
    """Distance of the lowest surface that the ball can darken, m."""
    marker_radius: float
    """Radius of the marker, m."""


@kernel
def composite_range(
    first: int, last: int, view: TopView, lighting: Lighting, positions: FloatArray, images: NDArray[np.uint8]
) -> None:
    """Write the images first to last - 1 of (N, S, S, 3) with balls at positions (N, 3), m."""
    for i in range(first, last):
        image = images[i]
        for row in range(image.shape[0]):
            for column in range(image.shape[1]):
                for k in range(3):
                    image[row, column, k] = view.color[row, column, k]
        ball = vec3(positions[i])
        if ball.z < view.eye_z:
            darken_surroundings(view, lighting, ball, image)
            draw_marker(view, lighting, ball, image)


@device_function
def darken_surroundings(view: TopView, lighting: Lighting, ball: Vec3, image: NDArray[np.uint8]) -> None:
    """Draw the ball's shadow and ambient occlusion into an image (S, S, 3) of the course."""
    half_size = 0.5 * image.shape[0]
    rect = bound_surroundings(view, lighting, ball)
    for row in range(rect.top, rect.bottom):
        for column in range(rect.left, rect.right):
            # The surface of the pixel.
            normal_x = view.normal[row, column, 0]
            normal_y = view.normal[row, column, 1]
            normal_z = view.normal[row, column, 2]
            if normal_x == NO_NORMAL and normal_y == NO_NORMAL and normal_z == NO_NORMAL:
                continue
            normal = Vec3((normal_x - 128.0) / 127.0, (normal_y - 128.0) / 127.0, (normal_z - 128.0) / 127.0)
            depth = np.float64(view.distance[row, column])
            scale = depth / view.focal_length
            p = Vec3(
                view.eye_x + scale * (column + 0.5 - half_size),
                view.eye_y - scale * (row + 0.5 - half_size),
                view.eye_z - depth,
            )
            # The light that the ball leaves it.
            to_ball = sub(ball, p)
            distance_sq = max(dot(to_ball, to_ball), MIN_DISTANCE_SQ)
            sunlight = share_of_sun(lighting, view.marker_radius, to_ball, distance_sq)
            occlusion = occlusion_by_ball(lighting, view.marker_radius, to_ball, distance_sq, normal)
            if sunlight == 1.0 and occlusion == 0.0:
                continue
            direct = sunlight * view.albedo_and_sunlight[row, column, 3] / 255.0
            ambient = 1.0 - lighting.occlusion_strength * occlusion
            for k in range(3):
                root_albedo = view.albedo_and_sunlight[row, column, k] * (lighting.max_root_albedo / 255.0)
                value = shade(lighting, k, root_albedo * root_albedo, direct, ambient, normal.z)
                image[row, column, k] = to_byte(value)


@device_function
def bound_surroundings(view: TopView, lighting: Lighting, ball: Vec3) -> PixelRect:
    """Return the pixels that the ball may darken.

    They are bounded by cubes around its ambient occlusion, and around its shadow on the lowest surface.
    """
    size = view.color.shape[0]
    sun = sun_direction(lighting)
    distance = view.eye_z - ball.z
    reach = lighting.occlusion_range * view.marker_radius
    shadow_length = max(view.max_distance - distance, 0.0) / sun.z
    spread = 2.0 * view.marker_radius + lighting.penumbra_growth / sun.z * shadow_length
    nearest = distance - reach
    farthest = max(distance + reach, view.max_distance + spread)
    # Relative to the camera; rows run downwards.
    x = ball.x - view.eye_x
    y = view.eye_y - ball.y
    shadow_x = x - shadow_length * sun.x
    shadow_y = y + shadow_length * sun.y
    left = min(x - reach, shadow_x - spread)
    right = max(x + reach, shadow_x + spread)
    top = min(y - reach, shadow_y - spread)
    bottom = max(y + reach, shadow_y + spread)
    first_column, last_column = project_interval(left, right, nearest, farthest, view.focal_length, size)
    first_row, last_row = project_interval(top, bottom, nearest, farthest, view.focal_length, size)
    return PixelRect(first_column, first_row, last_column, last_row)


@device_function
def draw_marker(view: TopView, lighting: Lighting, ball: Vec3, image: NDArray[np.uint8]) -> None:
    """Draw the marker of a ball into an image (S, S, 3), or its ghost where the course hides it."""
    # The disc in pixels.
    distance = view.eye_z - ball.z
    radius = view.marker_radius * view.focal_length / distance
    half_size = 0.5 * image.shape[0]
    center_x = half_size + (ball.x - view.eye_x) * view.focal_length / distance
    center_y = half_size - (ball.y - view.eye_y) * view.focal_length / distance
    first_column, last_column = clip_interval(center_x - radius - 1.0, center_x + radius + 1.0, image.shape[1])
    first_row, last_row = clip_interval(center_y - radius - 1.0, center_y + radius + 1.0, image.shape[0])
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            u = (column + 0.5 - center_x) / radius
            v = (center_y - row - 0.5) / radius
            off_center = math.sqrt(u * u + v * v)
            opacity = min((1.0 - off_center) * radius + 0.5, 1.0)
            if opacity <= 0.0:
                continue
            # The sphere's point above the pixel, next to what the course has there.
            height = math.sqrt(max(1.0 - off_center * off_center, 0.0))
            point_distance = distance - view.marker_radius * height
            surface_distance = np.float64(view.distance[row, column])
            if point_distance < surface_distance:
                length = max(off_center, 1.0)
                direct = max(dot(Vec3(u / length, v / length, height), sun_direction(lighting)), 0.0)
                rise = smoothstep(-1.0, 0.6, height)
                ambient = lighting.min_ball_ambient + (1.0 - lighting.min_ball_ambient) * rise
                for k in range(3):
                    value = shade(lighting, k, lighting.marker_albedo, direct, ambient, height)
                    image[row, column, k] = to_byte(value * opacity + image[row, column, k] / 255.0 * (1.0 - opacity))
            elif point_distance > surface_distance:
                opacity *= lighting.ghost_opacity
                for k in range(3):
                    image[row, column, k] = to_byte(opacity + image[row, column, k] / 255.0 * (1.0 - opacity))


@device_function
def sun_direction(lighting: Lighting) -> Vec3:
    """Return the unit vector to the sun."""
    return Vec3(lighting.sun_direction[0], lighting.sun_direction[1], lighting.sun_direction[2])


@device_function
def share_of_sun(lighting: Lighting, radius: float, to_ball: Vec3, distance_sq: float) -> float:
    """Return the share of the sun's disc that a ball does not hide from a point, as surface.frag's sun_past_ball."""
    along = dot(to_ball, sun_direction(lighting))
    if along < 0.0:
        return 1.0
    off_axis = math.sqrt(max(distance_sq - along * along, 0.0))
    penumbra = lighting.penumbra_growth * along + lighting.contact_penumbra * radius
    return smoothstep(radius - penumbra, radius + penumbra, off_axis)


@device_function
def occlusion_by_ball(lighting: Lighting, radius: float, to_ball: Vec3, distance_sq: float, normal: Vec3) -> float:
    """Return the share of the sky above a point that a ball hides, as surface.frag's ambient occlusion."""
    cutoff = 1.0 / (lighting.occlusion_range * lighting.occlusion_range)
    solid_angle = min(max(radius * radius / distance_sq - cutoff, 0.0), 1.0)
    cosine = min(max(dot(normal, to_ball) / math.sqrt(distance_sq), 0.0), 1.0)
    return solid_angle * cosine


@device_function
def shade(lighting: Lighting, k: int, albedo: float, direct: float, ambient: float, normal_z: float) -> float:
    """Return channel k of the colour, 0 to 1, of a surface that shares of direct and of ambient light reach."""
    upward = 0.5 + 0.5 * normal_z
    ambient_light = lighting.groundlight[k] + (lighting.skylight[k] - lighting.groundlight[k]) * upward
    lit = albedo * (lighting.sunlight[k] * direct + ambient_light * ambient)
    return math.sqrt(lit * (1.0 + lit * lighting.tone_gain) / (1.0 + lit * lighting.tone_compression))


@device_function
def smoothstep(lower: float, upper: float, x: float) -> float:
    """Return 0 below ``lower``, 1 above ``upper``, and a smooth transition in between, as GLSL's."""
    t = min(max((x - lower) / (upper - lower), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@device_function
def to_byte(value: float) -> int:
    """Return a value of at least 0 as a byte, 255 for 1 and above."""
    return int(min(value, 1.0) * 255.0 + 0.5)


@device_function
def project_interval(
    lower: float, upper: float, nearest: float, farthest: float, focal_length: float, size: int
) -> tuple[int, int]:
    """Return the pixels of an axis that an interval may cover: the first and one past the last.

    Args:
        lower: lower end of the interval, relative to the camera, m.
        upper: upper end of the interval, m.
        nearest: smallest distance of the interval from the camera, m; none if it is not positive.
        farthest: greatest distance of the interval from the camera, m.
        focal_length: size in pixels of a metre at a distance of 1 m.
        size: number of pixels of the axis.
    """
    if nearest <= 0.0:
        return 0, size
    half_size = 0.5 * size
    return clip_interval(
        half_size + focal_length * min(lower / nearest, lower / farthest),
        half_size + focal_length * max(upper / nearest, upper / farthest),
        size,
    )


@device_function
def clip_interval(lower: float, upper: float, size: int) -> tuple[int, int]:
    """Return the pixels between two edges that an axis of some pixels has: the first and one past the last."""
    first = int(min(max(lower, 0.0), size))
    return first, max(first, math.ceil(min(max(upper, 0.0), size)))
