"""Textures of the materials, generated so that the package contains no image files. Numpy only."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Texture = NDArray[np.uint8]

NUM_DIMPLES = 180
"""Number of dimples of the ball; real balls have 300 to 500, too small to be seen in an image."""


def felt_texture(size: int = 256) -> Texture:
    """Return a tileable texture (size, size, 1): short fibres and soft patches around the middle grey."""
    fibres = _noise(size, 1.0, seed=1) + 0.7 * _noise(size, 0.6, seed=2, stretch=3.0)
    return _to_grey(0.5 + 0.11 * fibres + 0.05 * _noise(size, 2.0, seed=3))


def wood_texture(size: int = 256) -> Texture:
    """Return a tileable texture (size, size, 1) with the grain along x."""
    y = np.linspace(0.0, 2.0 * math.pi, size, endpoint=False)[:, None]
    bend = 0.35 * _noise(size, 2.2, seed=4, stretch=6.0)
    rings = np.sin(9.0 * y + 3.0 * bend) * 0.45 + np.sin(23.0 * y + 5.0 * bend) * 0.25
    pores = _noise(size, 0.7, seed=5, stretch=24.0)
    return _to_grey(0.55 + 0.16 * rings + 0.07 * pores)


def stone_texture(size: int = 256) -> Texture:
    """Return a tileable texture (size, size, 1) of speckles and clouds."""
    return _to_grey(0.5 + 0.1 * _noise(size, 0.4, seed=6) + 0.1 * _noise(size, 1.8, seed=7))


def ball_texture(size: int = 64) -> Texture:
    """Return the six faces (6, size, size, 4) of the ball's cube map: normal in rgb, white (255) or red (0) in a.

    The dimples' centres lie on a Fibonacci spiral; a coloured band shows how the ball rolls.
    """
    # Direction of each texel: the faces +x, -x, +y, -y, +z, -z of an OpenGL cube map.
    grid = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    t, s = np.meshgrid(grid, grid, indexing="ij")
    ones = np.ones_like(s)
    faces = [(ones, -t, -s), (-ones, -t, s), (s, ones, t), (s, -ones, -t), (s, -t, ones), (-s, -t, -ones)]
    directions = np.stack([np.stack(face, axis=-1) for face in faces])
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    # The closest dimple, and the distance to its centre in dimple radii.
    height = 1.0 - 2.0 * (np.arange(NUM_DIMPLES) + 0.5) / NUM_DIMPLES
    azimuth = math.pi * (1.0 + math.sqrt(5.0)) * np.arange(NUM_DIMPLES)
    radius = np.sqrt(1 - height**2)
    centers = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=-1)
    closest = centers[np.argmax(directions @ centers.T, axis=-1)]
    offset = directions - closest
    distance = np.linalg.norm(offset, axis=-1, keepdims=True) / math.sqrt(4.0 * math.pi / NUM_DIMPLES) * 2.0
    # The slope of a shallow bowl tilts the normal towards the dimple's centre.
    tilt = -offset * np.where(distance < 0.8, 3.0, 0.0)
    normals = directions + tilt
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    is_red = (np.abs(directions[..., 2]) < 0.11) | (directions[..., 2] > 0.93)
    texels = np.concatenate([normals * 0.5 + 0.5, ~is_red[..., None]], axis=-1)
    return np.asarray(np.round(texels * 255.0), dtype=np.uint8)


def _noise(size: int, slope: float, seed: int, stretch: float = 1.0) -> NDArray[np.float64]:
    """Return tileable noise (size, size) of mean 0 and deviation 1 whose spectrum falls as 1 / frequency^slope.

    ``stretch`` > 1 elongates it along x. The RNG seed is fixed: a texture is the same in every process.
    """
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal((size, size)))
    frequency_y = np.fft.fftfreq(size)[:, None] * size
    frequency_x = np.fft.rfftfreq(size)[None, :] * size
    spectrum /= np.maximum(np.hypot(frequency_x * stretch, frequency_y), 1.0) ** slope
    spectrum[0, 0] = 0.0
    values = np.fft.irfft2(spectrum, (size, size))
    return np.asarray(values / values.std())


def _to_grey(values: NDArray[np.float64]) -> Texture:
    """Return values in [0, 1] as bytes with one channel."""
    return np.asarray(np.clip(values, 0.0, 1.0) * 255.0, dtype=np.uint8)[..., None]
