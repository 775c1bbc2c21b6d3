"""The tree holds every triangle once, in few nodes, and is not deep."""

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.physics.bvh import MAX_LEAF_SIZE, MAX_SPLIT_RATIO, build_bvh
from minigolf_env.physics.types import BVH_WIDTH
from tests.physics.scenes import SOUPS, soup


@pytest.mark.parametrize("kind", SOUPS)
def test_leaves_share_out_the_triangles(kind: str) -> None:
    """Every triangle is in one leaf, every node in one box; a box holds what is inside, less than all of its node."""
    triangles = soup(kind, np.random.default_rng(2))
    nodes, order = build_bvh(triangles)
    nodes_seen, rows_seen = [0], []

    def rows_in(i: int) -> NDArray[np.int64]:
        rows: list[NDArray[np.int64]] = []
        for k in np.flatnonzero(~np.isnan(nodes[i]["center"][0])):
            inside = int(nodes[i]["child"][k])
            if inside < 0:
                first, size = divmod(-inside, BVH_WIDTH)
                assert 1 <= size <= MAX_LEAF_SIZE
                rows.append(order[first : first + size])
                rows_seen.extend(rows[-1])
            else:
                nodes_seen.append(inside)
                rows.append(rows_in(inside))
            way = triangles[rows[-1]] - nodes[i]["center"][:, k]
            assert (np.abs(way) <= nodes[i]["half_extent"][:, k]).all()
        total = sum(map(len, rows))
        assert all(MAX_SPLIT_RATIO * len(some) <= (MAX_SPLIT_RATIO - 1) * total for some in rows) or (
            kind == "one" and total == 1
        )
        return np.concatenate(rows)

    rows_in(0)
    assert sorted(rows_seen) == list(range(len(triangles)))
    assert sorted(nodes_seen) == list(range(len(nodes)))


@pytest.mark.parametrize("count", [*range(1, 41), 1000])
def test_tree_has_few_nodes(count: int) -> None:
    """Whether triangles coincide or shrink, there are fewer than memory is made for."""
    corners = np.random.default_rng(3).normal(size=(count, 3, 3))
    for triangles in (0.0 * corners, corners, corners * 0.5 ** np.arange(count)[:, None, None]):
        assert 35 * len(build_bvh(triangles)[0]) <= max(35, 8 * count)
