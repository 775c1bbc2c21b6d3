"""``python -m minigolf_env.play`` is ``minigolf play``."""

import sys

from minigolf_env.cli import main

if __name__ == "__main__":
    main(["play", *sys.argv[1:]])
