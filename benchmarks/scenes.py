"""The six scenes on which minigolf_env and the engines beside it are measured: S, M, L, T, W and D.

Every scene is a room of 4 x 2 x 1 m in which a golf ball is putted from a tee at one end. The same bodies go into every
engine; one without concave meshes takes the convex pieces or the heights that stand in for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from minigolf_env.physics import Surface, TriangleMesh, World

FloatArray = NDArray[np.float64]

RADIUS = 0.02135
"""Radius of a golf ball, m (Rules of Golf, equipment rule 4: a diameter of at least 42.67 mm)."""
ROOM = np.array([[-2.0, -1.0, 0.0], [2.0, 1.0, 1.0]])
"""Lower and upper corner of the room, m."""
TEE = np.array([[-1.9, -0.9], [-1.5, 0.9]])
"""Lower and upper corner of the rectangle from which putts start, m."""
LAWN = Surface(restitution=0.7, tangential=1.0, rolling=0.03)
"""Rolls putts of 0.5 to 8 m/s for about 6.3 s, 760 steps of 1/120 s, on the plain floor. Impacts keep the tangential
velocity, as they do in the engines."""
GREEN_LEVEL, GREEN_RISE = 0.05, 0.002
"""Height of the level part of the green above the floor and half the height of its waves, m: slopes of at most 0.028,
less than the rolling resistance, on which a ball comes to rest."""
WAVES = TEE[1, 0] + 0.2
"""Where the waves of the green begin, m along x: far enough from the tee that no ball on it touches them."""
CELLS = 224
"""Cells a side of the green, and sections of the bumpy torus: 2 x 224² = 100,352 triangles."""
SECTORS = 28
"""Convex pieces of a bumpy torus: each spans 8 of its 224 sections."""


@dataclass(frozen=True)
class Body:
    """A mesh, and what stands in for it where an engine knows no concave meshes."""

    name: str
    vertices: FloatArray
    """(V, 3) m."""
    faces: NDArray[np.int64]
    """(F, 3), normals towards the ball."""
    pieces: tuple[FloatArray, ...] = ()
    """Corners (k, 3) of convex pieces that fill the body, m."""
    heights: FloatArray | None = None
    """(rows along y, columns along x) of a field of heights over the whole floor, m."""


@dataclass(frozen=True)
class Scene:
    """A room of bodies, a tee, and what all of it is made of."""

    name: str
    bodies: tuple[Body, ...]
    """The room, then what stands in it."""
    level: float = 0.0
    """Height of the ground at the tee, m."""
    surface: Surface = LAWN

    @property
    def triangles(self) -> int:
        """The number of triangles."""
        return sum(len(body.faces) for body in self.bodies)

    def world(self, **settings: Any) -> World:
        """Return the scene as a World; ``settings`` are World's."""
        meshes = [TriangleMesh(body.vertices, body.faces, self.surface, name=body.name) for body in self.bodies]
        return World(meshes, ball_radius=RADIUS, **settings)

    def putts(
        self, rng: np.random.Generator, n: int, slowest: float = 0.5, fastest: float = 8.0
    ) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities (n, 3) of level putts from the tee, speeds in m/s, in all directions."""
        places = np.column_stack([rng.uniform(TEE[0], TEE[1], (n, 2)), np.full(n, self.level + RADIUS)])
        turns = rng.uniform(-math.pi, math.pi, n)
        directions = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(n)])
        return places, directions * rng.uniform(slowest, fastest, (n, 1))

    def free_points(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Return centres (n, 3) of balls in the room, outside of the boxes around its bodies."""
        # Never are more than half of the points refused in these scenes.
        points = rng.uniform(ROOM[0] + RADIUS, ROOM[1] - RADIUS, (4 * n + 100, 3))
        for body in self.bodies[1:]:
            lower, upper = body.vertices.min(axis=0) - RADIUS, body.vertices.max(axis=0) + RADIUS
            points = points[((points < lower) | (points > upper)).any(axis=1)]
        return points[:n]

    def sweeps(self, rng: np.random.Generator, n: int, length: float = 1.0) -> tuple[FloatArray, FloatArray]:
        """Return starts and ends (n, 3) of paths of ``length`` metres from free points in all directions."""
        starts = self.free_points(rng, n)
        return starts, starts + length * directions(rng, n)


def directions(rng: np.random.Generator, n: int) -> FloatArray:
    """Return unit vectors (n, 3), all directions equally likely."""
    vectors = rng.normal(size=(n, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def room() -> Body:
    """Return the room: 12 triangles, normals inwards."""
    box = trimesh.creation.box(bounds=ROOM)
    return Body("room", np.array(box.vertices), np.array(box.faces[:, ::-1]))


def ball_on_floor() -> Body:
    """Return a UV sphere of 1,008 triangles that stands on the floor."""
    mesh = trimesh.creation.uv_sphere(radius=0.15, count=[20, 14])
    vertices = mesh.vertices + np.array([0.3, 0.45, 0.15])
    return Body("sphere", vertices, np.array(mesh.faces), (vertices,))


def torus(major_sections: int, minor_sections: int, sectors: int, bump: float = 0.0) -> Body:
    """Return a torus that lies on the floor, 2 triangles for each pair of sections.

    Args:
        major_sections: sections around the hole.
        minor_sections: sections around the tube.
        sectors: the number of convex pieces that stand in for it.
        bump: height of bumps, as a share of the tube's radius.
    """
    major, minor, centre = 0.3, 0.08, np.array([0.8, -0.35, 0.08])
    mesh = trimesh.creation.torus(major, minor, major_sections=major_sections, minor_sections=minor_sections)
    around = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    middle = major * np.column_stack([np.cos(around), np.sin(around), np.zeros(len(around))])
    out = mesh.vertices - middle
    along = np.arctan2(out[:, 2], np.hypot(*mesh.vertices[:, :2].T) - major)
    vertices = centre + middle + out * (1.0 + bump * np.sin(16 * around) * np.sin(6 * along))[:, None]
    turn = around * sectors / (2 * math.pi)
    inside = [np.abs((turn - k + 0.5 * (sectors - 1)) % sectors - 0.5 * sectors) <= 0.5 + 1e-6 for k in range(sectors)]
    return Body("torus", vertices, np.array(mesh.faces), tuple(vertices[sector] for sector in inside))


def bumpy_torus(sections: int = CELLS) -> Body:
    """Return a bumpy torus of 2 sections² triangles."""
    return torus(sections, sections, SECTORS, bump=0.1)


def green(cells: int = CELLS) -> Body:
    """Return an undulating green of 2 cells² triangles over the whole floor, level at the tee; open, normals up."""
    x, y = np.meshgrid(*(np.linspace(ROOM[0, axis], ROOM[1, axis], cells + 1) for axis in (0, 1)))
    wave = 1.0 - np.cos(2 * math.pi * np.maximum(0.0, x - WAVES))
    z = GREEN_LEVEL + GREEN_RISE * wave * np.cos(2 * math.pi * y)
    number = np.arange(z.size).reshape(z.shape)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Body("green", np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, heights=z)


def wall(x: float) -> Body:
    """Return a wall 1 cm thick across the room, whose middle is at x, m; its ends stand in the room's walls."""
    box = trimesh.creation.box(bounds=[[x - 0.005, -1.05, -0.05], [x + 0.005, 1.05, 1.05]])
    return Body("wall", np.array(box.vertices), np.array(box.faces), (np.array(box.vertices),))


def debris(bodies: tuple[Body, ...], count: int = 100) -> Body:
    """Return bad triangles, ``count`` of each kind, as one open mesh.

    Segments (three corners in a line) on the floor, triangles that use a vertex twice, copies of the bodies' faces.
    """
    rng = np.random.default_rng(0)
    ends = np.column_stack([rng.uniform(ROOM[0, :2], ROOM[1, :2], (2 * count, 2)), np.zeros(2 * count)])
    a, b = ends[:count], ends[count:]
    corners = [np.stack([a, (a + b) / 2, b], axis=1)]
    corners += [rng.choice(body.vertices[body.faces], count // len(bodies), replace=False) for body in bodies]
    vertices = np.concatenate(corners).reshape(-1, 3)
    faces = np.arange(len(vertices)).reshape(-1, 3)
    return Body("debris", vertices, np.concatenate([faces, faces[:count, [0, 2, 2]]]))


def scene_s() -> Scene:
    """Return S: the room of 12 triangles."""
    return Scene("S", (room(),))


def scene_m() -> Scene:
    """Return M: S, a UV sphere of 1,008 and a torus of 2,000 triangles on the floor."""
    return Scene("M", (room(), ball_on_floor(), torus(50, 20, sectors=25)))


def scene_l(sections: int = CELLS) -> Scene:
    """Return L: S and a bumpy torus of 2 sections² triangles (100,352)."""
    return Scene("L", (room(), bumpy_torus(sections)))


def scene_t(cells: int = CELLS) -> Scene:
    """Return T: S and an undulating green of 2 cells² triangles (100,352) that the ball rolls on."""
    return Scene("T", (room(), green(cells)), level=GREEN_LEVEL)


def scene_w() -> Scene:
    """Return W: S and two walls 1 cm thick across it."""
    return Scene("W", (room(), wall(-1.0), wall(1.0)))


def scene_d() -> Scene:
    """Return D: M and 300 degenerate, duplicate or repeated-index triangles."""
    bodies = scene_m().bodies
    return Scene("D", (*bodies, debris(bodies[1:])))


SCENES: dict[str, Callable[[], Scene]] = {
    "S": scene_s,
    "M": scene_m,
    "L": scene_l,
    "T": scene_t,
    "W": scene_w,
    "D": scene_d,
}
"""How to build each scene, by name."""
