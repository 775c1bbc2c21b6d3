"""The G-buffer of an image: what deferred shading needs to light its pixels again. Numpy only, no OpenGL."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from minigolf_env.rendering.image import Image


class GBuffer(NamedTuple):
    """An image of a course without a ball, and for each pixel the surface that is visible there."""

    color: Image
    """The image (H, W, 3)."""
    albedo_and_sunlight: NDArray[np.uint8]
    """(H, W, 4): square root of the albedo, 255 for LIGHTING.max_root_albedo; cosine of the sun's angle times the share
    of the sun that reaches the surface, 255 for 1."""
    normal: NDArray[np.uint8]
    """(H, W, 3): unit normal, -1 to 1 as 1 to 255; (128, 128, 128) for a surface that the ball does not darken, such as
    the lawn."""
    distance: NDArray[np.float32]
    """(H, W): distance from the camera along its line of sight, m."""
