"""Measure how long a user waits for a first putt and for a course: ``python -m benchmarks.startup``.

Fresh processes import the package and play a putt, with and without compiled kernels in the cache. Then each bundled
course is loaded from its file to its compiled world.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time

from benchmarks.report import print_table
from benchmarks.timing import cpu_seconds
from minigolf_env.courses import list_courses
from minigolf_env.courses.io.toml_course import read_course
from minigolf_env.courses.library import DATA_DIR

IMPORT_CODE = "import gymnasium, numba"
FIRST_PUTT_CODE = (
    "import gymnasium as gym; env = gym.make('minigolf_env:MiniGolf-v0'); env.reset(seed=0); env.step([0.3, 0.1])"
)
NUM_RUNS = 5
"""Number of runs of which the median is printed."""


def process_seconds(code: str, cache: str) -> float:
    """Return how long a fresh process takes to run the code, with numba's cache in a folder, s."""
    start = time.perf_counter()
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def load_seconds(name: str) -> float:
    """Return the median CPU time from a course file to its world, s, after a first load."""
    times = []
    for _ in range(NUM_RUNS + 1):
        times.append(cpu_seconds(lambda: read_course(DATA_DIR / f"{name}.toml").world()))
    return statistics.median(times[1:])


def main() -> None:
    """Print the median time of each start, and its ratio to importing gymnasium and numba in the same run."""
    codes = {
        IMPORT_CODE: IMPORT_CODE,
        "import minigolf_env": "import minigolf_env",
        "first putt, kernels cached": FIRST_PUTT_CODE,
    }
    times: dict[str, list[float]] = {name: [] for name in codes}
    with tempfile.TemporaryDirectory() as cache:
        compile_time = process_seconds(FIRST_PUTT_CODE, cache)
        # The codes take turns, so that a slow period of the machine affects all alike.
        for _ in range(NUM_RUNS):
            for name, code in codes.items():
                times[name].append(process_seconds(code, cache))
    medians = {name: statistics.median(values) for name, values in times.items()}
    medians["first putt, kernels compiled"] = compile_time
    base = medians[IMPORT_CODE]
    print_table(["start", "s", "ratio"], [[name, f"{s:.2f}", f"{s / base:.2f}"] for name, s in medians.items()])
    print_table(["course", "CPU s to load"], [[name, f"{load_seconds(name):.2f}"] for name in list_courses()])


if __name__ == "__main__":
    main()
