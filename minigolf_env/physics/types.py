"""Records of the physics: public results, surfaces, and the structured arrays that the compiled code reads.

SI units throughout (metres, seconds, kilograms), in a right-handed frame with z up. The compiled code works on ``Vec3``
and on numpy records. The public API returns plain arrays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import quote

FloatArray: TypeAlias = NDArray[np.float64]
RecordArray: TypeAlias = NDArray[np.void]

RELATIVE_TOLERANCE = 5e-13
"""Largest gap that counts as touching, divided by the scene's largest coordinate: half of the guaranteed 1e-12, so that
rounding cannot use up the guarantee."""

INT64_ZERO = cast(int, np.int64(0))
"""Zero as an int64. To numba a literal 0 has another type, for which it would compile the callees a second time."""

INT64_ONE = cast(int, np.int64(1))
"""One as an int64, for the same reason."""

BOOL_TRUE = cast(bool, np.bool_(True))
"""True as a numpy bool. To numba a literal True has another type, for which it would compile the callees again."""


class Vec3(NamedTuple):
    """A vector in compiled code: three floats in registers, about ten times as fast as a 3-element array."""

    x: float
    y: float
    z: float


class Status(IntEnum):
    """Final state of a shot."""

    REST = 0
    """The ball is at rest and stays there."""
    OUT_OF_BOUNDS = 1
    """The ball's centre left the world's bounds."""
    TIME_LIMIT = 2
    """``max_time`` ran out while the ball was moving."""


@dataclass(frozen=True)
class Surface:
    """A surface material: the velocity that an impact keeps, and the rolling resistance.

    Args:
        damping: d, ratio of the velocity after an impact to that before, in [0, 1] (the CS121 notes' damping factor).
        restitution: e, the same ratio for the normal velocity, in [0, 1]; ``damping`` unless given.
        tangential: tau, the same ratio for the tangential velocity, in [0, 1]; ``damping`` unless given.
        rolling: c >= 0, rolling resistance: on a level floor the ball decelerates by c |g|. A green of Stimp S feet
            has c = 1.829**2 / (2 * 0.3048 * S) / 9.81: 0.070 for S = 8, 0.047 for S = 12.

    Raises:
        ValueError: a value is outside its range or not finite.
    """

    damping: float = 0.7
    restitution: float | None = None
    tangential: float | None = None
    rolling: float = 0.05

    def __post_init__(self) -> None:
        for name in ("damping", "restitution", "tangential"):
            ratio = getattr(self, name)
            if ratio is None and name != "damping":
                continue
            if not (_is_number(ratio) and 0.0 <= ratio <= 1.0):
                raise ValueError(
                    f"Surface {name}: expected a number in [0, 1], received {quote(ratio)}; 1 keeps all speed."
                )
        if not (_is_number(self.rolling) and math.isfinite(self.rolling) and self.rolling >= 0.0):
            raise ValueError(
                f"Surface rolling: expected a finite number >= 0, received {quote(self.rolling)}; 0 rolls without "
                "braking."
            )

    @property
    def normal_restitution(self) -> float:
        """Ratio e of the normal speeds after and before an impact."""
        return float(self.damping if self.restitution is None else self.restitution)

    @property
    def tangential_restitution(self) -> float:
        """Ratio tau of the tangential velocities after and before an impact."""
        return float(self.damping if self.tangential is None else self.tangential)


class Hit(NamedTuple):
    """The first hit along a path; from ``sweep_batch`` every field has a leading axis (N,)."""

    hit: bool
    """True if the ball hits a triangle before the end of the path."""
    alpha: float
    """Hit fraction: the fraction of the path before the hit, in [0, 1]; 1 without a hit."""
    normal: FloatArray
    """(3,) unit contact normal, from the surface to the ball's centre; zeros without a hit."""
    triangle: int
    """Index of the triangle, counted through the world's meshes in order; -1 without a hit."""


class Shot(NamedTuple):
    """The result of a run of the ball; from ``simulate_batch`` every field has a leading axis (N,), without records."""

    position: FloatArray
    """(3,) the ball's centre at the end, m."""
    velocity: FloatArray
    """(3,) the ball's velocity at the end, m/s; zeros at rest."""
    status: Status
    """Final state of the run; an int8 array of ``Status`` values from a batch."""
    time: float
    """Time at which the run ended, s: exact for rest, a multiple of dt otherwise."""
    bounces: int
    """Number of impacts that did not become resting contacts."""
    exhausted: int
    """Number of time steps that used up their sub-steps and lost time (never a contact): 0 in all tests with closed
    meshes, speeds up to 1,000 m/s and dt up to 1/60 s; faster balls and longer steps may lose time."""
    path: FloatArray | None = None
    """(T, 3) the ball's centre at ``times``: the start, after every dt, and the end, m."""
    times: FloatArray | None = None
    """(T,) times of the positions in ``path``, s."""
    impacts: NDArray[np.void] | None = None
    """(bounces,) records of ``IMPACT_DTYPE``: time, place and triangle of each bounce."""
    num_substeps: NDArray[np.int64] | None = None
    """(T - 1,) number of sub-steps in each time step: 1 in flight, 2 while rolling, one more for a bounce."""


IMPACT_DTYPE = np.dtype(
    [
        ("time", "f8"),  # s
        ("position", "f8", 3),  # the ball's centre, m
        ("normal", "f8", 3),  # unit contact normal
        ("triangle", "i8"),
    ]
)
"""Record of one bounce."""

RESULT_DTYPE = np.dtype(
    [
        ("time", "f8"),  # s, at the end of the run
        ("status", "i8"),  # a ``Status``
        ("steps", "i8"),  # time steps begun
        ("bounces", "i8"),
        ("exhausted", "i8"),  # time steps that used up their sub-steps
    ]
)
"""Record of how one run ended."""

BVH_WIDTH = 8
"""Number of child slots of a BVH node: one SIMD vector of 512 bits, or several shorter ones."""

NODE_DTYPE = np.dtype(
    [
        ("center", "f8", (3, BVH_WIDTH)),  # centres of the child boxes, m; NaN in an empty slot
        ("half_extent", "f8", (3, BVH_WIDTH)),  # m
        ("child", "i8", (BVH_WIDTH,)),  # >= 0: row of a node; < 0: a leaf, -(BVH_WIDTH * first triangle + size)
        ("num_slots", "i8"),  # always BVH_WIDTH: the compiler vectorises a loop only if it does not know its length
    ]
)
"""Node of the bounding volume hierarchy: up to BVH_WIDTH child boxes, a column each."""

TRIANGLE_DTYPE = np.dtype(
    [
        ("n", "f8", (3,)),  # unit normal; zero without area, as dual_u and dual_v are
        ("a", "f8", (3,)),  # the first vertex, m
        (
            "dual_u",
            "f8",
            (3,),
        ),  # 1/m, dual basis of e, f: a + x in the plane is a + (x . dual_u) e + (x . dual_v) f
        ("dual_v", "f8", (3,)),  # 1/m
        ("e", "f8", (3,)),  # edge from a to the second vertex, m
        ("f", "f8", (3,)),  # edge from a to the third vertex, m
        ("triangle_id", "i8"),  # index in the caller's order
        ("surface", "i4"),  # row of the surface; one row for each mesh
        ("one_sided", "?"),  # only a ball that moves against n can hit it; false without area
    ],
    align=True,
)
"""Triangle record. The fields that a miss needs come first, in one cache line."""

SURFACE_DTYPE = np.dtype(
    [
        ("restitution", "f8"),  # e
        ("tangential", "f8"),  # tau
        ("rolling_coefficient", "f8"),  # c
    ]
)
"""Material record; see ``Surface``."""


class CompiledScene(NamedTuple):
    """A world as the compiled code reads it: immutable arrays of records, and numbers.

    The fields of one triangle or node share cache lines, and a call passes few arguments.
    """

    triangles: RecordArray
    """(n,) records of TRIANGLE_DTYPE, in the order of the BVH's leaves."""
    nodes: RecordArray
    """(M,) records of NODE_DTYPE; the root comes first."""
    surfaces: RecordArray
    """(k,) records of SURFACE_DTYPE."""
    radius: float
    """Radius of the ball, m."""
    eps: float
    """Largest gap that counts as touching: RELATIVE_TOLERANCE times the scene's largest coordinate, m."""
    gravity: Vec3
    """Acceleration of gravity, m/s^2."""
    dt: float
    """Duration of a time step, s."""
    conservative: bool
    """True: undamped impacts conserve energy, up to rounding; False: the CS121 notes' average-velocity response."""
    lower: Vec3
    """Lower corner of the world's bounds, m: a ball whose centre leaves the bounds is out."""
    upper: Vec3
    """Upper corner of the world's bounds, m."""


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.floating, np.integer)) and not isinstance(value, bool)
