"""What all tests share."""

import os

from hypothesis import settings

# Continuous integration must say the same twice; elsewhere each run tries new examples.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")
