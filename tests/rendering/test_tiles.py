"""One picture of many."""

import numpy as np
import pytest
from numpy.typing import NDArray

from minigolf_env.rendering import tile


def test_tile() -> None:
    """Near a square, row by row, black where nothing is left; the shape of the whole can be asked for."""

    def numbered(n: int, height: int = 2, width: int = 2) -> list[NDArray[np.uint8]]:
        return [np.full((height, width, 3), k + 1, np.uint8) for k in range(n)]

    grid = tile(numbered(3))
    assert grid[::2, ::2, 0].tolist() == [[1, 2], [3, 0]]
    shapes = {n: tile(numbered(n)).shape[:2] for n in (1, 2, 4, 9, 16)}
    assert shapes[1] == (2, 2) and shapes[4] == (4, 4) and shapes[9] == (6, 6) and shapes[16] == (8, 8)
    assert tile(numbered(4), aspect=4.0).shape == (2, 8, 3) and tile(numbered(4), aspect=0.25).shape == (8, 2, 3)
    assert tile(numbered(2, 48, 64), aspect=2.6).shape == (48, 128, 3)
    with pytest.raises(ValueError, match="at least one"):
        tile([])
    with pytest.raises(ValueError, match="one size"):
        tile([*numbered(1), *numbered(1, 3)])
