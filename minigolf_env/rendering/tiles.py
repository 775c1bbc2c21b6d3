"""One picture of many. Numpy only."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]


def tile(pictures: Sequence[Picture], aspect: float = 1.0) -> Picture:
    """Return pictures (height, width, 3) side by side in rows, the first at the top left, what is left over black.

    Args:
        pictures: at least one, all of one size.
        aspect: width / height that the whole comes as close to as it can.

    Raises:
        ValueError: there are no pictures, or their sizes differ.
    """
    shapes = {picture.shape for picture in pictures}
    if len(shapes) != 1:
        raise ValueError(f"tile: expected pictures of one size, at least one, received {sorted(shapes)}.")
    height, width, channels = shapes.pop()
    columns = _columns(len(pictures), width / height, aspect)
    rows = math.ceil(len(pictures) / columns)
    grid = np.zeros((rows, columns, height, width, channels), np.uint8)
    grid.reshape(-1, height, width, channels)[: len(pictures)] = pictures
    return grid.swapaxes(1, 2).reshape(rows * height, columns * width, channels)


def _columns(n: int, shape: float, aspect: float) -> int:
    """Return the columns of a grid of n pictures of a shape (width / height) closest to an aspect, without gaps first.

    As close: by which factor the grid is too wide or too high. A gap counts as its share of the grid.
    """

    def misfit(columns: int) -> float:
        rows = math.ceil(n / columns)
        return abs(math.log(shape * columns / rows / aspect)) + (rows * columns - n) / (rows * columns)

    return min(range(1, n + 1), key=misfit)
