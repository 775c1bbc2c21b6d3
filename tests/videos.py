"""Decoding of videos, for the tests of the programs that write them."""

import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray


def decode(path: Path, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the frames (N, height, width, 3) of a video of a given width and height."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path)]
    # passthrough: frames are not repeated where the file's time stamps have a gap.
    command += ["-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, size[1], size[0], 3)
