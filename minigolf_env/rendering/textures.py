"""The few images that surfaces are painted with, made here so that none needs to be shipped. Numpy only."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

DIMPLES = 180
"""On the ball; real ones have 300 to 500, too small to see in a picture."""


def felt(size: int = 256) -> Image:
    """Return a tile (size, size, 1): short fibres and soft patches around the middle grey."""
    fibres = _noise(size, 1.0, seed=1) + 0.7 * _noise(size, 0.6, seed=2, stretch=3.0)
    return _grey(0.5 + 0.11 * fibres + 0.05 * _noise(size, 2.0, seed=3))


def wood(size: int = 256) -> Image:
    """Return a tile (size, size, 1) with the grain along x."""
    y = np.linspace(0.0, 2.0 * math.pi, size, endpoint=False)[:, None]
    bend = 0.35 * _noise(size, 2.2, seed=4, stretch=6.0)
    rings = np.sin(9.0 * y + 3.0 * bend) * 0.45 + np.sin(23.0 * y + 5.0 * bend) * 0.25
    pores = _noise(size, 0.7, seed=5, stretch=24.0)
    return _grey(0.55 + 0.16 * rings + 0.07 * pores)


def stone(size: int = 256) -> Image:
    """Return a tile (size, size, 1) of speckles and clouds."""
    return _grey(0.5 + 0.1 * _noise(size, 0.4, seed=6) + 0.1 * _noise(size, 1.8, seed=7))


def ball(size: int = 64) -> Image:
    """Return the six faces (6, size, size, 4) of the ball's cube map: bump normal in rgb, in a where it is white.

    The dimples' centres lie on a Fibonacci spiral; a coloured band shows how the ball rolls.
    """
    grid = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    t, s = np.meshgrid(grid, grid, indexing="ij")
    one = np.ones_like(s)
    # The faces +x, -x, +y, -y, +z, -z of an OpenGL cube map.
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    way = np.stack([np.stack(face, axis=-1) for face in faces])
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    height = 1.0 - 2.0 * (np.arange(DIMPLES) + 0.5) / DIMPLES
    turn = math.pi * (1.0 + math.sqrt(5.0)) * np.arange(DIMPLES)
    centres = np.stack([np.sqrt(1 - height**2) * np.cos(turn), np.sqrt(1 - height**2) * np.sin(turn), height], axis=-1)
    nearest = centres[np.argmax(way @ centres.T, axis=-1)]
    away = way - nearest
    depth = np.linalg.norm(away, axis=-1, keepdims=True) / math.sqrt(4.0 * math.pi / DIMPLES) * 2.0
    # The slope of a shallow bowl leans the normal towards the dimple's middle.
    lean = -away * np.where(depth < 0.8, 3.0, 0.0)
    normal = way + lean
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    band = (np.abs(way[..., 2]) < 0.11) | (way[..., 2] > 0.93)
    texels = np.concatenate([normal * 0.5 + 0.5, ~band[..., None]], axis=-1)
    return np.asarray(np.round(texels * 255.0), dtype=np.uint8)


def _noise(size: int, slope: float, seed: int, stretch: float = 1.0) -> NDArray[np.float64]:
    """Return tileable noise (size, size) of mean 0 and deviation 1 whose spectrum falls as 1 / frequency^slope.

    ``stretch`` > 1 draws it out along x. The seed is fixed: a texture is a picture, not chance.
    """
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal((size, size)))
    fy, fx = np.fft.fftfreq(size)[:, None] * size, np.fft.rfftfreq(size)[None, :] * size
    spectrum /= np.maximum(np.hypot(fx * stretch, fy), 1.0) ** slope
    spectrum[0, 0] = 0.0
    values = np.fft.irfft2(spectrum, (size, size))
    return np.asarray(values / values.std())


def _grey(values: NDArray[np.float64]) -> Image:
    return np.asarray(np.clip(values, 0.0, 1.0) * 255.0, dtype=np.uint8)[..., None]
