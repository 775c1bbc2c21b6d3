"""The words of the physics: every record that crosses a room's border, each field with its unit.

SI units throughout (metres, seconds, kilograms); a right-handed frame with z up. Records of ``Vec3`` go through the
compiled kernels, records of plain arrays come out of the public doors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
RecordArray: TypeAlias = NDArray[np.void]

TOLERANCE = 5e-13
"""Touching, as a share of the scene's scale: half of the guaranteed 1e-12, so that rounding cannot use it up."""


ZERO = cast(int, np.int64(0))
"""Where the kernels' counters start: to numba a plain 0 is a type of its own, for which it compiles callees again."""

TRUE = cast(bool, np.bool_(True))
"""What kernels tell kernels in place of a plain True, which to numba is a type of its own, too."""


class Vec3(NamedTuple):
    """A vector of the kernels: three floats in registers, an order of magnitude faster than a 3-element array."""

    x: float
    y: float
    z: float


class Status(IntEnum):
    """How a shot ended."""

    REST = 0
    """The ball lies still and will for ever."""
    OUT_OF_BOUNDS = 1
    """The ball's centre left the world's bounds."""
    TIME_LIMIT = 2
    """``max_time`` ran out while the ball was moving."""


@dataclass(frozen=True)
class Surface:
    """What a ball meets: how much velocity an impact keeps, and how strongly the surface brakes a rolling ball.

    Args:
        damping: d, the share of velocity kept by an impact, in [0, 1] (the seed's damping factor).
        restitution: e, the share of the normal velocity kept, in [0, 1]; ``damping`` unless given.
        tangential: t, the share of the tangential velocity kept, in [0, 1]; ``damping`` unless given.
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
            share = getattr(self, name)
            if share is None and name != "damping":
                continue
            if not (_is_number(share) and 0.0 <= share <= 1.0):
                raise ValueError(f"Surface {name}: expected a number in [0, 1], received {share!r}; 1 keeps all speed.")
        if not (_is_number(self.rolling) and math.isfinite(self.rolling) and self.rolling >= 0.0):
            raise ValueError(
                f"Surface rolling: expected a finite number >= 0, received {self.rolling!r}; 0 rolls without braking."
            )

    @property
    def normal_share(self) -> float:
        """e, the share of the normal velocity that an impact keeps."""
        return float(self.damping if self.restitution is None else self.restitution)

    @property
    def tangential_share(self) -> float:
        """t, the share of the tangential velocity that an impact keeps."""
        return float(self.damping if self.tangential is None else self.tangential)


class Hit(NamedTuple):
    """The first collision along a path; from ``sweep_batch`` every field has a leading axis (N,)."""

    hit: bool
    """Whether the ball collides before the end of the path."""
    alpha: float
    """Share of the path before the collision, in [0, 1]; 1 when there is none."""
    normal: FloatArray
    """(3,) unit vector from the surface to the ball's centre at the collision; zeros when there is none."""
    triangle: int
    """The triangle, counted through the world's meshes in order; -1 when there is none."""


class Shot(NamedTuple):
    """A run of the ball; from ``simulate_batch`` every field has a leading axis (N,) and the records are None."""

    position: FloatArray
    """(3,) the ball's centre at the end, m."""
    velocity: FloatArray
    """(3,) its velocity at the end, m/s; zeros at rest."""
    status: Status
    """How the run ended; an int8 array of ``Status`` values from a batch."""
    time: float
    """When the run ended, s: exact for rest, a multiple of dt otherwise."""
    bounces: int
    """Impacts that did not become lasting contacts."""
    exhausted: int
    """Time steps whose sub-steps ran out (time was lost there, never a contact); 0 for any sane input."""
    path: FloatArray | None = None
    """(T, 3) the ball's centre at ``times``: the start, after every dt, and the end, m."""
    times: FloatArray | None = None
    """(T,) s."""
    contacts: NDArray[np.void] | None = None
    """(bounces,) records of ``IMPACT``: when, where and on which triangle the ball bounced."""
    sub_steps: NDArray[np.int64] | None = None
    """(T - 1,) the pieces that each time step was made of: 1 in flight, 2 while rolling, one more for a bounce."""


IMPACT = np.dtype([("time", "f8"), ("position", "f8", 3), ("normal", "f8", 3), ("triangle", "i8")])
"""One bounce: time (s), the ball's centre (m), the unit normal, the triangle."""

RESULT = np.dtype([("time", "f8"), *((name, "i8") for name in ("status", "steps", "bounces", "exhausted"))])
"""How a run ended: its time (s) and Status, the time steps begun, the bounces, the exhausted steps."""

WIDTH = 8
"""Boxes of a node: one vector of 512 bits, or some shorter ones."""

NODE = np.dtype(
    [
        *((name, "f8", (3, WIDTH)) for name in ("middle", "half")),
        ("inside", "i8", (WIDTH,)),
        ("width", "i8"),
    ]
)
"""Up to WIDTH boxes of the bounding volume hierarchy, a column each: the middle (not a number where there is no box)
and half extents (m); what is inside: the row of another node, or minus WIDTH times a leaf's first triangle, and minus
the number of its triangles. The width is WIDTH: the compiler makes vector instructions of a loop only if it does not
know how long it is."""

TRIANGLE = np.dtype(
    [
        *((vector, "f8", (3,)) for vector in "nauvef"),
        ("number", "i8"),
        ("surface", "i4"),
        ("one_sided", "?"),
    ],
    align=True,
)
"""A triangle: its corner a and the edges e and f from there (m); the unit normal n; u and v (1/m), with which a point
a + x of its plane is a + (x . u) e + (x . v) f; n, u and v are zero without area. The caller's number; its row among
the surfaces; whether only a ball that moves against n can collide (never without area). First what a miss asks for."""

SURFACE = np.dtype([("restitution", "f8"), ("tangential", "f8"), ("rolling", "f8")])
"""What an impact keeps of the normal and the tangential velocity, and the rolling resistance."""


class Scene(NamedTuple):
    """The compiled world: everything immutable that the kernels read.

    Few arrays of whole records: what belongs to a triangle or a node shares a cache line, and a call passes little.
    """

    triangles: RecordArray
    """(n,) of TRIANGLE, in the order of the tree's leaves."""
    nodes: RecordArray
    """(M,) of NODE."""
    surfaces: RecordArray
    """(k,) of SURFACE."""
    radius: float
    """The ball's radius, m."""
    eps: float
    """Closer than this is touching: TOLERANCE times the scene's scale, m."""
    gravity: Vec3
    """m/s^2."""
    dt: float
    """s."""
    conservative: bool
    """Impacts conserve energy exactly instead of using the seed's average velocity."""
    lower: Vec3
    """Bounds of the world, m: a ball whose centre leaves them is out."""
    upper: Vec3


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.floating, np.integer)) and not isinstance(value, bool)
