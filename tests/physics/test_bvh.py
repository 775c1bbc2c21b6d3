"""The BVH has every triangle once, few nodes and a bounded depth."""

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.physics.bvh import MAX_LEAF_SIZE, MAX_SPLIT_RATIO, build_bvh
from minigolf_env.physics.types import BVH_WIDTH
from tests.physics.scenes import SOUPS, triangle_soup


@pytest.mark.parametrize("kind", SOUPS)
def test_leaves_partition_the_triangles(kind: str) -> None:
    """Every triangle is in one leaf and every node has one parent.

    A child box contains its triangles, and no child has too large a fraction of them.
    """
    triangles = triangle_soup(kind, np.random.default_rng(2))
    nodes, order = build_bvh(triangles)
    nodes_seen = [0]
    rows_seen = []

    def rows_in(i: int) -> NDArray[np.int64]:
        rows: list[NDArray[np.int64]] = []
        for k in np.flatnonzero(~np.isnan(nodes[i]["center"][0])):
            child = int(nodes[i]["child"][k])
            if child < 0:
                first, size = divmod(-child, BVH_WIDTH)
                assert 1 <= size <= MAX_LEAF_SIZE
                rows.append(order[first : first + size])
                rows_seen.extend(rows[-1])
            else:
                nodes_seen.append(child)
                rows.append(rows_in(child))
            offset = triangles[rows[-1]] - nodes[i]["center"][:, k]
            assert (np.abs(offset) <= nodes[i]["half_extent"][:, k]).all()
        total = sum(map(len, rows))
        assert all(MAX_SPLIT_RATIO * len(child_rows) <= (MAX_SPLIT_RATIO - 1) * total for child_rows in rows) or (
            kind == "one" and total == 1
        )
        return np.concatenate(rows)

    rows_in(0)
    assert sorted(rows_seen) == list(range(len(triangles)))
    assert sorted(nodes_seen) == list(range(len(nodes)))


@pytest.mark.parametrize("count", [*range(1, 41), 1000])
def test_number_of_nodes_is_bounded(count: int) -> None:
    """Random, coinciding and shrinking triangles have no more nodes than the allocated memory holds."""
    corners = np.random.default_rng(3).normal(size=(count, 3, 3))
    for triangles in (0.0 * corners, corners, corners * 0.5 ** np.arange(count)[:, None, None]):
        assert 35 * len(build_bvh(triangles)[0]) <= max(35, 8 * count)
