"""Face normals are accurate to the last bits, also for slivers."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from minigolf_env.physics.triangles import face_frames
from tests.physics.scenes import FloatArray


def exact_normal(triangle: FloatArray) -> FloatArray:
    """Return the unit normal from exact rational products and a 50-digit root."""
    a, b, c = ([Fraction(x) for x in corner.tolist()] for corner in triangle)
    e, f = [y - x for x, y in zip(a, b)], [y - x for x, y in zip(a, c)]
    n = [e[(k + 1) % 3] * f[(k + 2) % 3] - e[(k + 2) % 3] * f[(k + 1) % 3] for k in range(3)]
    with mpmath.workdps(50):
        parts = [mpmath.mpf(x.numerator) / x.denominator for x in n]
        length = mpmath.sqrt(sum(x * x for x in parts))
        return np.array([float(x / length) for x in parts])


@pytest.mark.parametrize("height", [1.0, 1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_normals_are_exact(height: float, size: float) -> None:
    """A triangle of any shape, size and place has the exact normal to within 1e-15."""
    rng = np.random.default_rng(1)
    triangles = rng.uniform(-1, 1, (100, 3, 3)) * size
    along = triangles[:, 0] + rng.random((100, 1)) * (triangles[:, 1] - triangles[:, 0])
    triangles[:, 2] = along + height * size * rng.normal(size=(100, 3))
    exact = np.array([exact_normal(triangle) for triangle in triangles])
    assert np.abs(face_frames(triangles)[0] - exact).max() < 1e-15


def test_triangles_without_area_have_zero_normals() -> None:
    """Points, segments and collinear corners get zeros, without NaN or a warning."""
    a, b = np.array([0.25, 1.5, -2.0]), np.array([1.25, -0.5, 3.0])
    flat = np.array([[a, a, a], [a, a, b], [a, b, a], [b, a, a], [a, 0.5 * (a + b), b], 0.0 * np.array([a, a, b])])
    assert not any(frame.any() for frame in face_frames(flat))


def test_reversed_winding_negates_the_normal() -> None:
    """Reversing a triangle negates its normal exactly; rotating its corners keeps it up to rounding."""
    triangles = np.random.default_rng(2).uniform(-1, 1, (100, 3, 3))
    n, over, round_ = (face_frames(triangles[:, order])[0] for order in ([0, 1, 2], [0, 2, 1], [1, 2, 0]))
    assert np.array_equal(over, -n)
    assert round_ == pytest.approx(n, abs=1e-15)


@pytest.mark.parametrize("height", [1.0, 1e-3, 1e-9])
def test_dual_basis_gives_coordinates_along_the_edges(height: float) -> None:
    """With the dual basis u and v of the edges, x e + y f + z n has the coordinates x, y and z."""
    rng = np.random.default_rng(4)
    triangles = rng.uniform(-1, 1, (100, 3, 3))
    triangles[:, 2] = triangles[:, 1] + height * rng.normal(size=(100, 3))
    e, f = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    n, u, v = face_frames(triangles)
    for first, second, product in ((u, e, 1), (u, f, 0), (v, e, 0), (v, f, 1), (u, n, 0), (v, n, 0)):
        size = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        assert (np.abs(np.sum(first * second, axis=1) - product) <= 1e-14 * size).all()


@pytest.mark.parametrize("k", [-1000, -60, 60, 500])
def test_scaling_by_powers_of_two_keeps_the_bits_of_normals(k: int) -> None:
    """A power of two in every coordinate changes no bit of a normal, and divides the dual basis."""
    triangles = np.random.default_rng(3).uniform(-1, 1, (100, 3, 3))
    frames = face_frames(triangles)
    scaled = face_frames(triangles * 2.0**k)
    assert np.array_equal(scaled[0], frames[0])
    assert all(np.array_equal(scaled[i] * 2.0**k, frames[i]) for i in (1, 2))
