"""The triangles as the kernels read them; face normals, right to the last bits even for slivers.

The cross product of two edges cancels: for a triangle a million times longer than high, plain float64 tilts the normal
by 1e-10, which over the triangle's length is more than the physics tolerates. Edges and products are therefore taken
with their rounding errors (error-free transformations: T. J. Dekker, "A floating-point technique for extending the
available precision", Numerische Mathematik 18, 1971), so that the normal is right to about 1e-16.
"""

from __future__ import annotations

import numpy as np

from minigolf_env.physics.types import TRIANGLE, FloatArray, RecordArray

FLAT = 1e-25
"""A triangle whose area is less than this share of its edges' product has no normal: float64 twice over ends there."""


def triangle_records(corners: FloatArray) -> RecordArray:
    """Return triangles (n, 3, 3) as two-sided TRIANGLE records, numbered in order."""
    # The first corner faces the longest edge: u + v, the direction across that edge, then keeps its digits in needles.
    opposite = np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2)
    turned = (opposite.argmax(axis=1)[:, None] + np.arange(3)) % 3
    corners = corners[np.arange(len(corners))[:, None], turned]
    records = np.zeros(len(corners), TRIANGLE)
    records["a"] = corners[:, 0]
    records["e"], records["f"] = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    records["n"], records["u"], records["v"] = face_frames(corners)
    records["number"] = np.arange(len(corners))
    return records


def face_frames(triangles: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return n, u and v, each (n, 3), of triangles (n, 3, 3) with a corner a and the edges e and f from there.

    n is the unit normal by the right-hand rule; a point a + x of the plane is a + (x . u) e + (x . v) f, so that u and
    v (1/m) are the edges' dual basis. All are zero where there is no area.
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    e, e_rest = _exact_difference(b, a)
    f, f_rest = _exact_difference(c, a)
    # A power of two, so that neither tiny nor large triangles leave the range where products are exact.
    size = np.maximum(np.abs(e).max(axis=1), np.abs(f).max(axis=1))[:, None]
    unit = np.exp2(-np.floor(np.log2(np.where(size > 0.0, size, 1.0))))
    e, e_rest, f, f_rest = e * unit, e_rest * unit, f * unit, f_rest * unit
    y, z = [1, 2, 0], [2, 0, 1]
    left, left_rest = _exact_product(e[:, y], f[:, z])
    right, right_rest = _exact_product(e[:, z], f[:, y])
    high, low = _exact_difference(left, right)
    edges = e[:, y] * f_rest[:, z] + e_rest[:, y] * f[:, z] - e[:, z] * f_rest[:, y] - e_rest[:, z] * f[:, y]
    cross = high + (low + (left_rest - right_rest) + edges)
    largest = np.abs(cross).max(axis=1, keepdims=True)
    flat = largest <= FLAT * np.linalg.norm(e, axis=1, keepdims=True) * np.linalg.norm(f, axis=1, keepdims=True)
    cross = np.where(flat, 0.0, cross / np.where(flat, 1.0, largest))
    length = np.where(flat, 1.0, np.linalg.norm(cross, axis=1, keepdims=True))
    n = cross / length
    longer = np.where(flat, np.inf, length * largest) / unit
    return n, np.cross(f, n) / longer, np.cross(n, e) / longer


def _exact_difference(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return s and r with s = fl(a - b) and s + r = a - b exactly."""
    s = a - b
    t = s - a
    return s, (a - (s - t)) - (b + t)


def _exact_product(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return p and r with p = fl(a b) and p + r = a b exactly."""
    p = a * b
    a_high, a_low = _split(a)
    b_high, b_low = _split(b)
    return p, a_low * b_low - (((p - a_high * b_high) - a_low * b_high) - a_high * b_low)


def _split(a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the upper and lower halves of the significands."""
    t = 134217729.0 * a  # 2**27 + 1: 53 bits are halved at 27
    high = t - (t - a)
    return high, a - high
