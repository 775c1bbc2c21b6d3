"""Triangle records for the compiled code, with face normals that are right to the last bits even for slivers.

The cross product of two edges cancels: for a triangle a million times longer than high, plain float64 tilts the normal
by 1e-10, which over the triangle's length is more than the physics tolerates. Edges and products are therefore computed
with their rounding errors (error-free transformations: T. J. Dekker, "A floating-point technique for extending the
available precision", Numerische Mathematik 18, 1971), so that the normal is right to about 1e-16.
"""

from __future__ import annotations

import numpy as np

from minigolf_env.physics.types import TRIANGLE_DTYPE, FloatArray, RecordArray

DEGENERATE_AREA_RATIO = 1e-25
"""Largest ratio of a triangle's area to the product of its edges at which it has no normal: the precision of
double-double arithmetic ends there."""

SPLIT_FACTOR = 134217729.0
"""2**27 + 1: splits the 53 bits of a float64 significand in two halves (Dekker 1971)."""


def build_triangles(vertices: FloatArray) -> RecordArray:
    """Return triangles (n, 3, 3) as two-sided TRIANGLE_DTYPE records, numbered in order."""
    # Rotate the vertices so that the first is opposite the longest edge: dual_u + dual_v, the direction across that
    # edge, then stays accurate for triangles with one very short edge.
    opposite = np.linalg.norm(vertices[:, [2, 0, 1]] - vertices[:, [1, 2, 0]], axis=2)
    rotated = (opposite.argmax(axis=1)[:, None] + np.arange(3)) % 3
    vertices = vertices[np.arange(len(vertices))[:, None], rotated]

    records = np.zeros(len(vertices), TRIANGLE_DTYPE)
    records["a"] = vertices[:, 0]
    records["e"] = vertices[:, 1] - vertices[:, 0]
    records["f"] = vertices[:, 2] - vertices[:, 0]
    records["n"], records["dual_u"], records["dual_v"] = face_frames(vertices)
    records["triangle_id"] = np.arange(len(vertices))
    return records


def face_frames(triangles: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return n, dual_u and dual_v, each (n, 3), of triangles (n, 3, 3) with the vertex a and edges e and f from there.

    n is the unit normal by the right-hand rule. A point a + x of the plane is a + (x . dual_u) e + (x . dual_v) f:
    dual_u and dual_v (1/m) are the dual basis of the edges. All are zero where there is no area.
    """
    # Take the edges with their rounding errors.
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    e, e_error = _exact_difference(b, a)
    f, f_error = _exact_difference(c, a)

    # Scale by a power of two, so that neither tiny nor large triangles leave the range where products are exact.
    size = np.maximum(np.abs(e).max(axis=1), np.abs(f).max(axis=1))[:, None]
    unit = np.exp2(-np.floor(np.log2(np.where(size > 0.0, size, 1.0))))
    e, e_error = e * unit, e_error * unit
    f, f_error = f * unit, f_error * unit

    # Take the cross product e x f with its rounding errors.
    y, z = [1, 2, 0], [2, 0, 1]
    left, left_error = _exact_product(e[:, y], f[:, z])
    right, right_error = _exact_product(e[:, z], f[:, y])
    high, low = _exact_difference(left, right)
    edge_errors = e[:, y] * f_error[:, z] + e_error[:, y] * f[:, z] - e[:, z] * f_error[:, y] - e_error[:, z] * f[:, y]
    cross = high + (low + (left_error - right_error) + edge_errors)

    # Normalise it, and compute the dual basis.
    largest = np.abs(cross).max(axis=1, keepdims=True)
    length_e = np.linalg.norm(e, axis=1, keepdims=True)
    length_f = np.linalg.norm(f, axis=1, keepdims=True)
    is_degenerate = largest <= DEGENERATE_AREA_RATIO * length_e * length_f
    cross = np.where(is_degenerate, 0.0, cross / np.where(is_degenerate, 1.0, largest))
    length = np.where(is_degenerate, 1.0, np.linalg.norm(cross, axis=1, keepdims=True))
    n = cross / length
    scaled_length = np.where(is_degenerate, np.inf, length * largest) / unit
    return n, np.cross(f, n) / scaled_length, np.cross(n, e) / scaled_length


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
    t = SPLIT_FACTOR * a
    high = t - (t - a)
    return high, a - high
