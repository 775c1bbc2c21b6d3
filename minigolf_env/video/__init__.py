"""Videos: a file that takes one picture after another, and the film of a policy that plays a hole."""

from minigolf_env.video.filming import film
from minigolf_env.video.writer import Writer

__all__ = ["Writer", "film"]
