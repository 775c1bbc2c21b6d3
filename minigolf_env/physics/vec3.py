"""Vector algebra on ``Vec3``, compiled and inlined into the kernels."""

from __future__ import annotations

import math

from minigolf_env.physics.jit import kernel
from minigolf_env.physics.types import FloatArray, Vec3


@kernel
def vec3(row: FloatArray) -> Vec3:
    """Read the vector (3,) out of an array."""
    return Vec3(row[0], row[1], row[2])


@kernel
def store(row: FloatArray, a: Vec3) -> None:
    """Write a vector into an array (3,)."""
    row[0], row[1], row[2] = a.x, a.y, a.z


@kernel
def add(a: Vec3, b: Vec3) -> Vec3:
    """Return a + b."""
    return Vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@kernel
def sub(a: Vec3, b: Vec3) -> Vec3:
    """Return a - b."""
    return Vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@kernel
def scale(a: Vec3, k: float) -> Vec3:
    """Return k a."""
    return Vec3(a.x * k, a.y * k, a.z * k)


@kernel
def along(a: Vec3, k: float, b: Vec3) -> Vec3:
    """Return a + k b."""
    return Vec3(a.x + k * b.x, a.y + k * b.y, a.z + k * b.z)


@kernel
def dot(a: Vec3, b: Vec3) -> float:
    """Return a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@kernel
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return a x b."""
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@kernel
def norm(a: Vec3) -> float:
    """Return |a|."""
    return math.sqrt(dot(a, a))


@kernel
def choose(first: bool, a: Vec3, b: Vec3) -> Vec3:
    """Return a or b, without a branch."""
    return Vec3(a.x if first else b.x, a.y if first else b.y, a.z if first else b.z)


@kernel
def column(rows: FloatArray, i: int) -> Vec3:
    """Read the vector in column i of an array (3, N)."""
    return Vec3(rows[0, i], rows[1, i], rows[2, i])


@kernel
def put(rows: FloatArray, i: int, a: Vec3) -> None:
    """Write a vector into column i of an array (3, N)."""
    rows[0, i], rows[1, i], rows[2, i] = a.x, a.y, a.z
