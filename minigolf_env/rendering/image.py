"""Images as arrays: their type, a check of their size, and grids of several. Numpy only."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import positive_number, quote

Image = NDArray[np.uint8]
"""An array (height, width, 3) of RGB values, the first row at the top."""


def check_size(size: tuple[int, int], name: str) -> tuple[int, int]:
    """Return an image's width and height in pixels, or raise a ValueError that calls the argument ``name``."""
    try:
        width, height = (operator.index(side) for side in size)
    except (TypeError, ValueError):
        width = height = 0
    if width < 1 or height < 1:
        raise ValueError(f"{name}: expected width and height in pixels, at least 1, received {quote(size)}.")
    return width, height


def tile(images: Sequence[Image], aspect: float = 1.0) -> Image:
    """Return images (height, width, 3) in a grid, row by row from the top left; unused cells are black.

    Args:
        images: at least one, all of one size.
        aspect: desired width / height of the grid; the number of columns that comes closest is chosen.

    Raises:
        ValueError: there are no images, one is no image, their sizes differ, or the aspect is not a number > 0.
    """
    for k, image in enumerate(images):
        _check_image(image, f"images[{k}]")
    positive_number(aspect, "aspect", "1 makes the grid about square.")
    shapes = {image.shape for image in images}
    if len(shapes) != 1:
        raise ValueError(f"images: expected one size, at least one image, received {quote(sorted(shapes))}.")
    height, width, channels = shapes.pop()
    columns = _num_columns(len(images), width / height, aspect)
    rows = math.ceil(len(images) / columns)
    grid = np.zeros((rows, columns, height, width, channels), np.uint8)
    grid.reshape(-1, height, width, channels)[: len(images)] = images
    return grid.swapaxes(1, 2).reshape(rows * height, columns * width, channels)


def tile_sequences(sequences: Sequence[Sequence[Image]], aspect: float = 1.0) -> Iterator[Image]:
    """Yield the frames of several sequences side by side, as ``tile`` does; a sequence that has ended keeps its last.

    With the lists of a batch's ``render()`` (render_mode="rgb_array_list") this is a video of all its environments.

    Args:
        sequences: one per environment, each of at least one frame; all frames have one size.
        aspect: desired width / height of the grid.

    Raises:
        ValueError: a sequence is empty, or as for ``tile``.
    """
    lengths = [len(sequence) for sequence in sequences]
    if not all(lengths):
        raise ValueError(f"sequences: expected at least one frame in each, received {quote(lengths)}.")
    for k in range(max(lengths, default=0)):
        yield tile([sequence[min(k, len(sequence) - 1)] for sequence in sequences], aspect)


def _check_image(image: Any, name: str) -> None:
    """Raise a ValueError that calls a value ``name`` unless it is an image with pixels."""
    if not isinstance(image, np.ndarray):
        raise ValueError(f"{name}: expected an array (height, width, 3), received {quote(image)}; use numpy.array.")
    if image.ndim != 3 or image.shape[2] != 3 or image.size == 0 or image.dtype != np.uint8:
        raise ValueError(
            f"{name}: expected uint8 of shape (height, width, 3), received {image.dtype} of {image.shape}; "
            "give RGB images of at least one pixel."
        )


def _num_columns(n: int, image_aspect: float, aspect: float) -> int:
    """Return the number of columns of the grid of n images that is closest to an aspect and has few unused cells.

    The cost of a grid is the logarithm of the ratio between its aspect and the desired one, plus its share of unused
    cells.
    """

    def cost(columns: int) -> float:
        rows = math.ceil(n / columns)
        return abs(math.log(image_aspect * columns / rows / aspect)) + (rows * columns - n) / (rows * columns)

    return min(range(1, n + 1), key=cost)
