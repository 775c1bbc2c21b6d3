"""Sample programs: run them from the repository's root, read them, change them."""

import importlib.util
import sys

NEEDED = ("stable_baselines3", "torch", "tensorboard")

if MISSING := [name for name in NEEDED if importlib.util.find_spec(name) is None]:
    SAID = f'{", ".join(MISSING)}: not installed; pip install -c constraints.txt -e ".[agents]"'
    # Python's name for a program while `python -m` looks for it: there a line says all, elsewhere an error is wanted.
    raise SystemExit(SAID) if sys.argv[:1] == ["-m"] else ImportError(SAID)
