"""Without numba's private API the physics compiles with public options alone, to the same bits."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

SIMULATE = """
import hashlib, sys
if {without_internals}:
    sys.modules["minigolf_env.physics.numba_internals"] = None
import numpy as np
from minigolf_env.physics import Surface, TriangleMesh, World, step
floor = TriangleMesh([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], [(0, 1, 2), (0, 2, 3)], Surface(0.6))
wall = TriangleMesh([(1, -1, -1), (1, 1, -1), (1.2, 0, 1)], [(0, 1, 2)])
shot = World([floor, wall]).simulate((0.3, 0.1, 0.5), (2.0, 0.4, 0.0), record=True)
bits = [np.asarray(value).tobytes() for value in shot]
print(type(step.step._cache).__name__, shot.bounces > 2, hashlib.sha256(b"".join(bits)).hexdigest())
"""


def simulate(without_internals: bool, cache: Path) -> list[str]:
    """Simulate in a new process; return the class of the kernels' cache, whether the ball bounced, and the bits."""
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(cache)} if without_internals else dict(os.environ)
    command = [sys.executable, "-c", SIMULATE.format(without_internals=without_internals)]
    done = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True, check=False, timeout=900)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_public_numba_options_give_the_same_bits(tmp_path: Path) -> None:
    """Kernels use numba's own cache if numba_internals cannot be imported, and a run has the same bits."""
    normal = simulate(without_internals=False, cache=tmp_path)
    fallback = simulate(without_internals=True, cache=tmp_path)
    assert (normal[0], fallback[0]) == ("KernelCache", "FunctionCache")
    assert normal[1:] == fallback[1:]
    assert normal[1] == "True"
    assert list(tmp_path.rglob("*.nbc"))
