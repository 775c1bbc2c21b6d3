"""Vector algebra on ``Vec3``, compiled and inlined into the kernels."""

from __future__ import annotations

import math

from minigolf_env.physics.jit import device_function
from minigolf_env.physics.types import FloatArray, Vec3


@device_function
def vec3(row: FloatArray) -> Vec3:
    """Read the vector from an array (3,)."""
    return Vec3(row[0], row[1], row[2])


@device_function
def store(row: FloatArray, a: Vec3) -> None:
    """Write a vector to an array (3,)."""
    row[0] = a.x
    row[1] = a.y
    row[2] = a.z


@device_function
def add(a: Vec3, b: Vec3) -> Vec3:
    """Return a + b."""
    return Vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@device_function
def sub(a: Vec3, b: Vec3) -> Vec3:
    """Return a - b."""
    return Vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@device_function
def scale(a: Vec3, k: float) -> Vec3:
    """Return k a."""
    return Vec3(a.x * k, a.y * k, a.z * k)


@device_function
def mul_add(a: Vec3, k: float, b: Vec3) -> Vec3:
    """Return a + k b."""
    return Vec3(a.x + k * b.x, a.y + k * b.y, a.z + k * b.z)


@device_function
def dot(a: Vec3, b: Vec3) -> float:
    """Return a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@device_function
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return a x b."""
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@device_function
def norm(a: Vec3) -> float:
    """Return |a|."""
    return math.sqrt(dot(a, a))


@device_function
def select(condition: bool, a: Vec3, b: Vec3) -> Vec3:
    """Return a if the condition holds, else b; branch-free, for SIMD loops."""
    return Vec3(a.x if condition else b.x, a.y if condition else b.y, a.z if condition else b.z)


@device_function
def column(rows: FloatArray, i: int) -> Vec3:
    """Read the vector from column i of an array (3, N)."""
    return Vec3(rows[0, i], rows[1, i], rows[2, i])


@device_function
def store_column(rows: FloatArray, i: int, a: Vec3) -> None:
    """Write a vector to column i of an array (3, N)."""
    rows[0, i] = a.x
    rows[1, i] = a.y
    rows[2, i] = a.z
