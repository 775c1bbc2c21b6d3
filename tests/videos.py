"""Reads videos, for the tests of what writes them."""

import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray


def decode(path: Path, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return all pictures (N, height, width, 3) of a video whose pictures have that width and height."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path)]
    # Passed through: a picture is not repeated where the file's times have a gap.
    command += ["-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, size[1], size[0], 3)
