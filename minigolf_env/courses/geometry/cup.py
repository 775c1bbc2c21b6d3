"""The cup: the outline of its hole, its liner, and the pocket that is cut into a floor mesh for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Point
from trimesh import Trimesh

from minigolf_env._validation import quote
from minigolf_env.courses.course import CUP_LINER_THICKNESS, CourseError, Cup
from minigolf_env.courses.geometry.ground import LEVEL_TOLERANCE, MIN_UPWARD_NORMAL
from minigolf_env.courses.geometry.solids import (
    ROUND_SIDES,
    ShapelyPolygon,
    circle_polygon,
    corner_ratio,
    join_meshes,
    revolve,
)
from minigolf_env.courses.geometry.terrain import triangulate


def cup_outline(clear: ShapelyPolygon, cup: Cup) -> ShapelyPolygon:
    """Return the outline of the hole to cut for a cup and its liner, so that the whole circle of its radius is open.

    Args:
        clear: area a ball can roll on, which must contain the cup.
        cup: cup to cut.

    Raises:
        CourseError: the cup reaches beyond ``clear``.
    """
    x, y, _ = cup.position
    hole = circle_polygon((x, y), cup.radius + CUP_LINER_THICKNESS)
    if clear.contains(hole):
        return hole
    max_radius = 0.0
    if clear.contains(Point(x, y)):
        max_radius = clear.boundary.distance(Point(x, y)) / corner_ratio(ROUND_SIDES) - CUP_LINER_THICKNESS
    if max_radius <= 0.0:
        raise CourseError(
            f"cup position: expected a place on one piece of floor, received {cup.position} on its edge or off it; "
            "move the cup, or join the pieces."
        )
    raise CourseError(
        f"cup radius: expected less than {max_radius:.3f} m, received {quote(cup.radius)}; "
        "a wider cup would cut into a border or an obstacle."
    )


def build_cup_liner(cup: Cup) -> Trimesh:
    """Return the cup's wall and bottom, which fill the hole; the rim is flush with the floor and shares its edges."""
    x, y, rim = cup.position
    inner = cup.radius
    outer = cup.radius + CUP_LINER_THICKNESS
    bottom = rim - cup.depth
    under = bottom - CUP_LINER_THICKNESS
    return revolve([(0.0, under), (outer, under), (outer, rim), (inner, rim), (inner, bottom), (0.0, bottom)], (x, y))


def cut_cup_into_mesh(mesh: Trimesh, cup: Cup, obstacles: Sequence[ShapelyPolygon]) -> Trimesh:
    """Return a floor mesh with a pocket for the cup and its liner cut into its level top.

    Raises:
        CourseError: the top is not level around the cup, or the floor is thinner than the cup is deep.
    """
    mesh = Trimesh(mesh.vertices, mesh.faces)  # Merge vertices that some programs store once for each face.
    rim = cup.position[2]
    # Find the level faces at the rim, and the hole's outline within them. Rounding must not leave them uneven.
    is_top = (np.abs(mesh.triangles[:, :, 2] - rim) <= LEVEL_TOLERANCE).all(axis=1)
    is_top &= mesh.face_normals[:, 2] > MIN_UPWARD_NORMAL
    vertices = np.array(mesh.vertices)
    vertices[np.unique(mesh.faces[is_top]), 2] = rim
    mesh = Trimesh(vertices, mesh.faces, process=False)
    corners = mesh.triangles
    face_polygons = shapely.polygons(corners[:, :, :2])
    clear = shapely.union_all(face_polygons[is_top])
    for obstacle in obstacles:
        clear = clear - obstacle
    hole = cup_outline(clear, cup)
    # Check that the floor is thicker than the cup is deep.
    is_cut = is_top & shapely.intersects(face_polygons, hole)
    bottom = rim - cup.depth - CUP_LINER_THICKNESS
    is_above_bottom = corners[:, :, 2].min(axis=1) > bottom - LEVEL_TOLERANCE
    is_below_rim = corners[:, :, 2].min(axis=1) < rim - LEVEL_TOLERANCE  # Not a bridge over the cup.
    below = shapely.intersects(face_polygons, hole) & ~is_cut & is_above_bottom & is_below_rim
    if below.any():
        raise CourseError(
            f"cup depth: expected a floor thicker than {cup.depth + CUP_LINER_THICKNESS:g} m under the cup, "
            f"received one that ends at z = {corners[below][:, :, 2].max():g} m; thicken it."
        )
    # Replace the faces that the hole cuts. Their common outline keeps its corners, so that it fits the other faces.
    area = shapely.union_all(face_polygons[is_cut])
    rings = shapely.get_parts(shapely.polygonize([shapely.linestrings(edge) for edge in _boundary_edges(mesh, is_cut)]))
    pieces = [ring - hole for ring in rings if area.contains(ring.point_on_surface())]
    kept = Trimesh(mesh.vertices, mesh.faces[~is_cut], process=False)
    return join_meshes([kept, *_build_pocket(pieces, hole, rim, bottom)])


def _build_pocket(
    around: Sequence[ShapelyPolygon], hole: ShapelyPolygon, rim: float, bottom: float
) -> Iterator[Trimesh]:
    """Yield the level floor around a hole, the wall down from its edge, and the bottom."""
    for areas, z in ((around, rim), ([hole], bottom)):
        points, faces = triangulate(areas)
        yield Trimesh(np.c_[points, np.full(len(points), z)], faces)
    ring = np.array(shapely.geometry.polygon.orient(hole).exterior.coords)[:-1]
    n = len(ring)
    k = np.arange(n)
    after = np.roll(np.arange(n), -1)
    # Seen from inside the hole, the faces of the wall are clockwise along the ring.
    wall = np.concatenate([np.c_[k, after, k + n], np.c_[after, after + n, k + n]])
    yield Trimesh(np.concatenate([np.c_[ring, np.full(n, rim)], np.c_[ring, np.full(n, bottom)]]), wall)


def _boundary_edges(mesh: Trimesh, chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the edges (E, 2, 2) in the xy-plane that bound the chosen faces."""
    edges = np.sort(mesh.faces[chosen][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(mesh.vertices[unique[count == 1]][:, :, :2])
