"""The six benchmark scenes, S, M, L, T, W and D, for minigolf_env and the other engines.

Every scene is a room of 4 x 2 x 1 m in which a golf ball is putted from a tee at one end. All engines get the same
bodies; an engine without concave meshes gets convex pieces or a height field instead.
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

BALL_RADIUS = 0.02135
"""Radius of a golf ball, m (Rules of Golf, equipment rule 4: a diameter of at least 42.67 mm)."""
ROOM_BOUNDS = np.array([[-2.0, -1.0, 0.0], [2.0, 1.0, 1.0]])
"""Lower and upper corner of the room, m."""
TEE_BOUNDS = np.array([[-1.9, -0.9], [-1.5, 0.9]])
"""Lower and upper corner of the rectangle from which putts start, m."""
LAWN_SURFACE = Surface(restitution=0.7, tangential=1.0, rolling=0.03)
"""Surface of all scenes. Impacts keep the tangential velocity, as they do in the other engines. A putt of 0.5 to 8 m/s
takes 760 steps of 1/120 s on average on S, 630 on M, 650 on L and 780 on T."""
GREEN_LEVEL = 0.05
"""Height of the level part of the green above the floor, m."""
GREEN_RISE = 0.002
"""Half the height of the green's waves, m. Slopes are at most 0.028, less than the rolling resistance, so that a ball
comes to rest on them."""
WAVES_START_X = TEE_BOUNDS[1, 0] + 0.2
"""x at which the waves of the green start, m; no ball on the tee touches them."""
GREEN_CELLS = 224
"""Number of cells along a side of the green, and of sections of the bumpy torus: 2 x 224² = 100,352 triangles."""
TORUS_PIECES = 28
"""Number of convex pieces of a bumpy torus; each spans 8 of its 224 sections."""


@dataclass(frozen=True)
class Body:
    """A mesh, with convex pieces or heights for engines without concave meshes."""

    name: str
    vertices: FloatArray
    """Vertices (V, 3), m."""
    faces: NDArray[np.int64]
    """Vertex indices (F, 3); normals point to the ball's side."""
    pieces: tuple[FloatArray, ...] = ()
    """Corners (k, 3) of convex pieces that fill the body, m."""
    heights: FloatArray | None = None
    """Height field (rows along y, columns along x) over the whole floor, m."""


@dataclass(frozen=True)
class Scene:
    """A room with bodies, a tee and a surface."""

    name: str
    bodies: tuple[Body, ...]
    """Bodies: the room first, then its obstacles."""
    level: float = 0.0
    """Height of the ground at the tee, m."""
    surface: Surface = LAWN_SURFACE
    """Surface of all bodies."""

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return sum(len(body.faces) for body in self.bodies)

    def world(self, **settings: Any) -> World:
        """Return the scene as a World; ``settings`` are arguments of World."""
        meshes = [TriangleMesh(body.vertices, body.faces, self.surface, name=body.name) for body in self.bodies]
        return World(meshes, ball_radius=BALL_RADIUS, **settings)

    def putts(
        self, rng: np.random.Generator, n: int, min_speed: float = 0.5, max_speed: float = 8.0
    ) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities (n, 3) of horizontal putts from the tee, in all directions; speeds in m/s."""
        xy = rng.uniform(TEE_BOUNDS[0], TEE_BOUNDS[1], (n, 2))
        positions = np.column_stack([xy, np.full(n, self.level + BALL_RADIUS)])
        angles = rng.uniform(-math.pi, math.pi, n)
        directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(n)])
        return positions, directions * rng.uniform(min_speed, max_speed, (n, 1))

    def free_points(self, rng: np.random.Generator, n: int) -> FloatArray:
        """Return centres (n, 3) of balls in the room, outside the bounding boxes of its bodies."""
        # In these scenes at most half of the points are rejected.
        points = rng.uniform(ROOM_BOUNDS[0] + BALL_RADIUS, ROOM_BOUNDS[1] - BALL_RADIUS, (4 * n + 100, 3))
        for body in self.bodies[1:]:
            lower, upper = body.vertices.min(axis=0) - BALL_RADIUS, body.vertices.max(axis=0) + BALL_RADIUS
            points = points[((points < lower) | (points > upper)).any(axis=1)]
        return points[:n]

    def sweeps(self, rng: np.random.Generator, n: int, length: float = 1.0) -> tuple[FloatArray, FloatArray]:
        """Return starts and ends (n, 3) of sweeps of ``length`` metres from free points in all directions."""
        starts = self.free_points(rng, n)
        return starts, starts + length * directions(rng, n)


def directions(rng: np.random.Generator, n: int) -> FloatArray:
    """Return unit vectors (n, 3), uniformly distributed on the sphere."""
    vectors = rng.normal(size=(n, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def room() -> Body:
    """Return the room: 12 triangles with normals pointing inwards."""
    box = trimesh.creation.box(bounds=ROOM_BOUNDS)
    return Body("room", np.array(box.vertices), np.array(box.faces[:, ::-1]))


def ball_on_floor() -> Body:
    """Return a UV sphere of 1,008 triangles on the floor."""
    mesh = trimesh.creation.uv_sphere(radius=0.15, count=[20, 14])
    vertices = mesh.vertices + np.array([0.3, 0.45, 0.15])
    return Body("sphere", vertices, np.array(mesh.faces), (vertices,))


def torus(major_sections: int, minor_sections: int, sectors: int, bump: float = 0.0) -> Body:
    """Return a torus on the floor, with 2 triangles for each pair of sections.

    Args:
        major_sections: number of sections around the hole.
        minor_sections: number of sections around the tube.
        sectors: number of convex pieces for engines without concave meshes.
        bump: height of bumps, as a share of the tube's radius.
    """
    major = 0.3
    minor = 0.08
    center = np.array([0.8, -0.35, 0.08])
    mesh = trimesh.creation.torus(major, minor, major_sections=major_sections, minor_sections=minor_sections)
    major_angle = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    tube_center = major * np.column_stack([np.cos(major_angle), np.sin(major_angle), np.zeros(len(major_angle))])
    offset = mesh.vertices - tube_center
    minor_angle = np.arctan2(offset[:, 2], np.hypot(*mesh.vertices[:, :2].T) - major)
    scale = 1.0 + bump * np.sin(16 * major_angle) * np.sin(6 * minor_angle)
    vertices = center + tube_center + offset * scale[:, None]
    # Cut the torus into sectors, which are nearly convex.
    turn = major_angle * sectors / (2 * math.pi)
    inside = [np.abs((turn - k + 0.5 * (sectors - 1)) % sectors - 0.5 * sectors) <= 0.5 + 1e-6 for k in range(sectors)]
    return Body("torus", vertices, np.array(mesh.faces), tuple(vertices[sector] for sector in inside))


def bumpy_torus(sections: int = GREEN_CELLS) -> Body:
    """Return a bumpy torus of 2 sections² triangles."""
    return torus(sections, sections, TORUS_PIECES, bump=0.1)


def green(cells: int = GREEN_CELLS) -> Body:
    """Return an undulating green of 2 cells² triangles over the whole floor: level at the tee, open, normals up."""
    x, y = np.meshgrid(*(np.linspace(ROOM_BOUNDS[0, axis], ROOM_BOUNDS[1, axis], cells + 1) for axis in (0, 1)))
    wave = 1.0 - np.cos(2 * math.pi * np.maximum(0.0, x - WAVES_START_X))
    z = GREEN_LEVEL + GREEN_RISE * wave * np.cos(2 * math.pi * y)
    index = np.arange(z.size).reshape(z.shape)
    a, b, c, d = (corner.ravel() for corner in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Body("green", np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, heights=z)


def wall(x: float) -> Body:
    """Return a wall 1 cm thick across the room, centred at x, m; its ends are inside the room's walls."""
    box = trimesh.creation.box(bounds=[[x - 0.005, -1.05, -0.05], [x + 0.005, 1.05, 1.05]])
    return Body("wall", np.array(box.vertices), np.array(box.faces), (np.array(box.vertices),))


def debris(bodies: tuple[Body, ...], count: int = 100) -> Body:
    """Return degenerate and duplicate triangles, ``count`` of each kind, as one open mesh.

    The kinds are collinear corners on the floor, repeated vertex indices, and copies of the bodies' faces.
    """
    rng = np.random.default_rng(0)
    ends = np.column_stack([rng.uniform(ROOM_BOUNDS[0, :2], ROOM_BOUNDS[1, :2], (2 * count, 2)), np.zeros(2 * count)])
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


def scene_l(sections: int = GREEN_CELLS) -> Scene:
    """Return L: S and a bumpy torus of 2 sections² triangles (100,352)."""
    return Scene("L", (room(), bumpy_torus(sections)))


def scene_t(cells: int = GREEN_CELLS) -> Scene:
    """Return T: S and an undulating green of 2 cells² triangles (100,352) that the ball rolls on."""
    return Scene("T", (room(), green(cells)), level=GREEN_LEVEL)


def scene_w() -> Scene:
    """Return W: S and two walls 1 cm thick across it."""
    return Scene("W", (room(), wall(-1.0), wall(1.0)))


def scene_d() -> Scene:
    """Return D: M and 300 degenerate, duplicate or repeated-index triangles."""
    bodies = scene_m().bodies
    return Scene("D", (*bodies, debris(bodies[1:])))


SCENE_BUILDERS: dict[str, Callable[[], Scene]] = {
    "S": scene_s,
    "M": scene_m,
    "L": scene_l,
    "T": scene_t,
    "W": scene_w,
    "D": scene_d,
}
"""Builder of each scene, by name."""
