"""The room: a ball bounces among closed meshes, without golf.

With the seed's response (``impact="average"``) and this damping, about one ball in five ends up trembling by a tenth of
a millimetre until the time limit; with "conservative" every ball comes to rest.
"""

from __future__ import annotations

import trimesh
from shapely import box
from shapely.affinity import rotate

from minigolf_env.courses.course import Course, Tee
from minigolf_env.courses.solids import extruded, part, revolved
from minigolf_env.physics import Surface

WALLS = box(-2.0, -1.5, 2.0, 1.5)
"""Outline of the room, m."""

CEILING = 2.5
"""m."""

SUNK = 0.05
"""How deep what stands on the floor reaches below it, m: no seam for a ball to find."""

BALL = 0.1
"""The ball's radius, m: a toy ball, in proportion to the room."""

RUBBER = Surface(damping=0.8)
"""Everything: the seed's single damping factor."""


def build() -> Course:
    """Return the room: a crate, a torus and a cone on its floor, and a globe in the air."""
    crate = extruded(rotate(box(0.7, 0.4, 1.4, 1.0), 20.0), -SUNK, 0.5)
    torus = trimesh.creation.torus(major_radius=0.4, minor_radius=0.12)
    torus.apply_translation((-1.2, -0.7, 0.07))
    cone = revolved([(0.0, -SUNK), (0.4, -SUNK), (0.4, 0.0), (0.0, 0.8)], (0.9, -0.7))
    globe = trimesh.creation.icosphere(subdivisions=3, radius=0.35)
    globe.apply_translation((-0.9, 0.6, 1.2))
    return Course(
        name="room",
        parts=(
            part("room", extruded(WALLS, 0.0, CEILING), "wall", RUBBER, inwards=True),
            part("crate", crate, "wood", RUBBER),
            part("torus", torus, "cup", RUBBER),
            part("cone", cone, "felt", RUBBER),
            part("globe", globe, "stone", RUBBER),
        ),
        tee=Tee(lower=(-0.2, -0.2), upper=(0.2, 0.2), height=1.5),
        cup=None,
        par=None,
        bounds=((-2.1, -1.6, -0.1), (2.1, 1.6, CEILING + 0.1)),
        route=(),
        top_speed=6.0,
        ball_radius=BALL,
    )
