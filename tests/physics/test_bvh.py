"""The tree changes the cost of a query and never its answer."""

import itertools

import numpy as np
import pytest

from minigolf_env.physics import TriangleMesh, World, sweep_sphere
from minigolf_env.physics.bvh import build_tree, octant
from minigolf_env.physics.types import Vec3
from tests.physics.scenes import BALL, FloatArray, grid, sphere

KINDS = ["random", "duplicates", "degenerate", "huge and tiny", "floor", "one"]


def soup(kind: str, rng: np.random.Generator) -> FloatArray:
    """Return triangles (n, 3, 3) that a tree may find hard."""
    triangles = rng.uniform(-1, 1, (200, 1, 3)) + 0.2 * rng.normal(size=(200, 3, 3))
    if kind == "duplicates":
        triangles[50:] = triangles[7]
    elif kind == "degenerate":
        triangles[:100, 1] = triangles[:100, 0]
        triangles[50:150, 2] = triangles[50:150, 0]
    elif kind == "huge and tiny":
        triangles = triangles * 10.0 ** rng.uniform(-6, 3, (200, 1, 1))
    elif kind == "floor":
        vertices, faces = grid(2.0, 12)
        triangles = vertices[faces]
    return triangles[:1] if kind == "one" else triangles


def paths(rng: np.random.Generator, triangles: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return starts and ends: all around, along axes, without length, from far away, and ending on corners."""
    starts = rng.uniform(-2, 2, (count, 3))
    ends = rng.uniform(-2, 2, (count, 3))
    one = np.arange(count) % 6
    axis = rng.integers(0, 3, count)
    along_axis = starts.copy()
    along_axis[np.arange(count), axis] *= -1.0
    ends[one == 1] = along_axis[one == 1]
    ends[one == 2] = starts[one == 2]
    starts[one == 3] *= 1e6
    ends[one == 4] = triangles[rng.integers(len(triangles), size=count), 0][one == 4]
    ends[one == 5] = starts[one == 5] + 1e-3 * rng.normal(size=(count, 3))[one == 5]
    return starts, ends


@pytest.mark.parametrize("radius", [BALL, 0.3])
@pytest.mark.parametrize("kind", KINDS)
def test_tree_answers_as_the_scan_does(kind: str, radius: float) -> None:
    """World.sweep equals sweep_sphere, which looks at every triangle, bit for bit."""
    rng = np.random.default_rng(1)
    triangles = soup(kind, rng)
    starts, ends = paths(rng, triangles, 600)
    # The tolerance follows the largest number in sight: one far triangle makes it the same for both.
    far = np.full((1, 3, 3), 2.0 * max(np.abs(array).max() for array in (starts, ends, triangles)))
    triangles = np.concatenate([triangles, far])
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    hits = World([TriangleMesh(triangles.reshape(-1, 3), faces, two_sided=True)], radius).sweep_batch(starts, ends)
    for i, (start, end) in enumerate(zip(starts, ends)):
        scan = sweep_sphere(start, end, radius, triangles)
        assert (hits.hit[i], hits.alpha[i], hits.triangle[i]) == (scan.hit, scan.alpha, scan.triangle)
        assert np.array_equal(hits.normal[i], scan.normal)
    assert kind == "one" or hits.hit.sum() > 50


@pytest.mark.parametrize("kind", KINDS)
def test_leaves_share_out_the_triangles(kind: str) -> None:
    """Every triangle is in exactly one leaf, and every box holds all that is below it."""
    triangles = soup(kind, np.random.default_rng(2))
    nodes, order = build_tree(triangles)
    seen = np.zeros(len(triangles), int)
    for i, node in enumerate(nodes):
        leaves = [leaf for leaf in nodes[i : node["skips"][0]] if leaf["size"] > 0]
        rows = np.concatenate([order[leaf["first"] : leaf["first"] + leaf["size"]] for leaf in leaves])
        assert (np.abs(triangles[rows] - node["middle"]) <= node["half"]).all()
        if node["size"] > 0:
            seen[rows] += 1
            assert node["skips"][0] == i + 1
    assert (seen == 1).all()
    assert nodes[0]["skips"][0] == len(nodes)


def test_tree_is_shallow() -> None:
    """Even for coinciding triangles the tree has few nodes more than leaves of two would need."""
    for triangles in (np.zeros((1000, 3, 3)), soup("floor", np.random.default_rng(3))):
        assert len(build_tree(triangles)[0]) <= len(triangles)


def test_clearance_is_the_distance_to_the_nearest_triangle() -> None:
    """The clearance of a ball outside a fine sphere is that of its centre from the sphere, less its radius."""
    world = World([TriangleMesh(*sphere([0.0, 0.0, 0.0], 1.0, 64, 48))], ball_radius=BALL)
    ways = np.random.default_rng(4).normal(size=(200, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    for distance in (1.1, 2.0, 1000.0):
        assert world.clearance(distance * ways) == pytest.approx(distance - 1.0 - BALL, abs=5e-3)
    body = sphere([0.0, 0.0, 0.0], 1.0, 64, 48)
    assert world.clearance(body[0] * 1.5) == pytest.approx(0.5 - BALL, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_walks_go_into_the_nearer_child_first(kind: str) -> None:
    """In each octant's order every node comes once, and after a node its child on the side the path comes from."""
    nodes, _ = build_tree(soup(kind, np.random.default_rng(3)))
    for o, signs in enumerate(itertools.product([1, -1], repeat=3)):
        way = signs[::-1]  # The lowest bit is that of x.
        assert octant(Vec3(*map(float, way))) == o
        i, seen = 0, []
        while i < len(nodes):
            node = nodes[i]
            seen.append(i)
            children = [i + 1, int(node["first"])]
            if node["size"] > 0:
                i = int(node["skips"][o])
                continue
            near, far = children[:: way[node["axis"]]]
            assert (nodes[near]["skips"][o], nodes[far]["skips"][o]) == (far, node["skips"][o])
            i = near
        assert sorted(seen) == list(range(len(nodes)))
