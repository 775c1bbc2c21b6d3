"""Sample programs: run them from the repository's root, read them, change them."""

import importlib.util
import sys

REQUIRED_PACKAGES = ("stable_baselines3", "torch", "tensorboard")

if MISSING_PACKAGES := [name for name in REQUIRED_PACKAGES if importlib.util.find_spec(name) is None]:
    INSTALL_MESSAGE = f'{", ".join(MISSING_PACKAGES)}: not installed; pip install -c constraints.txt -e ".[agents]"'
    # While `python -m` looks for a program, sys.argv[0] is "-m": a user gets one line. An import gets an exception.
    raise SystemExit(INSTALL_MESSAGE) if sys.argv[:1] == ["-m"] else ImportError(INSTALL_MESSAGE)
