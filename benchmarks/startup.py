"""How long does a user wait? Run: python -m benchmarks.startup.

Times fresh processes: imports, the first putt with compiled kernels in the cache, and the first putt of all. Then, in
this process, how long each bundled hole takes from its file to its compiled world.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time

from minigolf_env.courses import list_courses
from minigolf_env.courses.io.toml_course import read_course
from minigolf_env.courses.library import DATA_DIR

PUTT = "import gymnasium as gym; env = gym.make('minigolf_env:MiniGolf-v0'); env.reset(seed=0); env.step([0.3, 0.1])"
RUNS = 5


def seconds(code: str, cache: str) -> float:
    """Return how long a fresh process takes to run the code, with numba's cache in the given folder."""
    began = time.perf_counter()
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment, stderr=subprocess.DEVNULL)
    return time.perf_counter() - began


def loading(name: str) -> float:
    """Return the processor's time from a hole's file to its world, s: the median, after a first time."""
    times = []
    for _ in range(RUNS + 1):
        began = time.process_time()
        read_course(DATA_DIR / f"{name}.toml").world()
        times.append(time.process_time() - began)
    return statistics.median(times[1:])


def main() -> None:
    """Print a row a start: the median, and its ratio to importing gymnasium and numba in the same run."""
    with tempfile.TemporaryDirectory() as cache:
        first = seconds(PUTT, cache)
        codes = {
            "import gymnasium, numba": "import gymnasium, numba",
            "import minigolf_env": "import minigolf_env",
            "first putt, kernels cached": PUTT,
        }
        times: dict[str, list[float]] = {name: [] for name in codes}
        for _ in range(RUNS):  # In turn, so that a slow spell of the machine hits all alike.
            for name, code in codes.items():
                times[name].append(seconds(code, cache))
    base = statistics.median(times["import gymnasium, numba"])
    rows = {name: statistics.median(values) for name, values in times.items()}
    for name, value in {**rows, "first putt of all, compiling": first}.items():
        print(f"{name:<30} {value:6.2f} s   x {value / base:.2f}")
    for name in list_courses():
        print(f"{'load ' + name:<30} {loading(name):6.2f} s")


if __name__ == "__main__":
    main()
