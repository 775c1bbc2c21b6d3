"""Do the tests notice when the physics is wrong? Run: python -m tools.mutation.mutations (make mutants).

Breaks a copy of the package in one way after another, runs the tests of the physics on it, and prints which test
noticed. The golden hashes are left out: they notice everything and explain nothing. Ends with an error if a mutation
survives, or if its text is no longer in the package: then say the same fault in the new words.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import tyro

ROOT = Path(__file__).parents[2]
PHYSICS = ROOT / "minigolf_env" / "physics"

ORDER = (
    "simulate",
    "contact",
    "sweep",
    "rolling",
    "energy",
    "corners",
    "faults",
    "swept_sphere",
    "bvh",
    "traversal",
    "guarantees",
    "candidate_cache",
    "rolling_batch",
)
TESTS = [f"tests/physics/test_{name}.py" for name in (*ORDER, "history", "termination", "metamorphic", "bad_input")]
TESTS += [f"tests/tools/test_soak.py::test_{name}" for name in ("rooms_in_which_time_was_lost", "soak")]
"""Those that notice most come first, after those of the broken module: the first failure ends a run."""

PATIENCE = 600
"""Seconds after which tests are taken to hang, which is noticing too; compiling and all tests take about 100."""


@dataclass(frozen=True)
class Mutation:
    """One way to break the physics: in a file, a text that occurs once and what takes its place."""

    name: str
    file: str
    old: str
    new: str
    also: tuple[Mutation, ...] = ()
    """Further changes of the same fault; their names do not count."""


INSIDE = "_is_inside(-dot(a, u), -dot(a, v), dot(w, u), dot(w, v),"
HOLDS = "holds(cylinder, p) and holds(cylinder, add(p, w))"

MUTATIONS = [
    Mutation("an absolute epsilon", "world.py", "eps=TOLERANCE * self.scale,", "eps=1e-9,"),
    Mutation(
        "approach tested after the minimum",
        "swept_sphere.py",
        "            return MISS, normal\n        if gap <= eps:\n",
        "            return (t, normal) if gap <= eps else (MISS, normal)\n        if gap <= eps:\n",
        also=(
            Mutation(
                "",
                "candidate_cache.py",
                "= best.row\n    return best",
                "= best.row\n    return best if dot(w, best.normal) < 0.0 else no_collision()",
            ),
        ),
    ),
    Mutation("a dropped edge", "swept_sphere.py", "if x + y >= 1.0:", "if x == math.inf:"),
    Mutation(
        "an edge without ends", "swept_sphere.py", "min(1.0, max(0.0, -dot(a, ab) / length2))", "-dot(a, ab) / length2"
    ),
    Mutation(
        "<= for < at the collision that counts",
        "swept_sphere.py",
        "        if next_t >= 1.0 or next_t > latest:",
        "        if next_t >= 1.0 or next_t >= latest:",
    ),
    Mutation(
        "unclamped alpha",
        "swept_sphere.py",
        "        normal = scale(n, math.copysign(1.0, height))\n    return t, normal",
        "        normal = scale(n, math.copysign(1.0, height))\n    return t - gap / rate, normal",
    ),
    Mutation(
        "no snap to the face normal",
        "swept_sphere.py",
        "    if abs(height + t * wn) >= radius - 2.0 * eps and height * wn < 0.0:",
        "    if abs(height) == math.inf:",
    ),
    Mutation("one Newton step", "swept_sphere.py", "MAX_NEWTON = 64", "MAX_NEWTON = 1"),
    Mutation("no face has a back", "swept_sphere.py", 'if triangle["one_sided"] and wn >= 0.0', "if wn == math.inf"),
    Mutation(
        "touching is colliding",
        "swept_sphere.py",
        "            if gap + (1.0 - t) * rate >= -eps or not _goes_deeper(",
        "            if gap > eps and not _goes_deeper(",
    ),
    Mutation("v instead of vavg", "step.py", "average = along(v, 0.5 * span, net)", "average = v"),
    Mutation("time left is not reduced", "step.py", "h = (1.0 - hit.alpha) * span + (h - span)", "h = 1.0 * h"),
    Mutation(
        "e and t swapped",
        "contact.py",
        'restitution, tangential = surface["restitution"], surface["tangential"]',
        'tangential, restitution = surface["restitution"], surface["tangential"]',
    ),
    Mutation(
        "a fixed bounce threshold",
        "contact.py",
        "if weak <= 0.0 or min(weak, approach)",
        "if restitution * approach <= 0.03 or min(weak, approach)",
    ),
    Mutation(
        "conservative without correction",
        "contact.py",
        "approach = math.sqrt(dot(v, n) ** 2 + hit.alpha * (1.0 - hit.alpha) * span * span * dot(net, net))",
        "approach = abs(dot(v, n))",
    ),
    Mutation("grazing is damped", "contact.py", "if dot(v, n) >= 0.0:", "if dot(v, n) == math.inf:"),
    Mutation("resistance of one contact alone", "contact.py", "total += contacts[i, 3]", "total = contacts[i, 3]"),
    Mutation(
        "projection without the crease",
        "contact.py",
        "if norm(y) > norm(best) and _in_cone(contacts, held, y, i, j, slack):",
        "if norm(y) == math.inf:",
    ),
    Mutation("contacts never end", "contact.py", "if rising <= 0.0 or", "if rising <= math.inf or"),
    Mutation("friction does not hold", "contact.py", "        if pull <= resistance:", "        if pull <= 0.0:"),
    Mutation("boxes not grown by the radius", "sweep.py", "reach = scene.radius + 2.0 * scene.eps", "reach = 0.0"),
    Mutation("no order among equals", "sweep.py", "return new if new.order < old.order else old", "return new"),
    Mutation("a tie with the best so far is dropped", "swept_sphere.py", "if t > latest:", "if t >= latest:"),
    Mutation(
        "a plane met beside its triangle",
        "swept_sphere.py",
        f"            and {INSIDE} t)\n            and {INSIDE} t_deep)\n",
        "",
    ),
    Mutation("deeper is not asked for", "swept_sphere.py", f"            and {INSIDE} t_deep)\n", ""),
    Mutation("only deeper is asked for", "swept_sphere.py", f"            and {INSIDE} t)\n", ""),
    Mutation("a foot beyond an edge at one time", "swept_sphere.py", "max(x, x_end), max(y", "min(x, x_end), max(y"),
    Mutation("a foot beyond the third edge", "swept_sphere.py", "max(1.0 - x - y, 1", "min(1.0 - x - y, 1"),
    Mutation(
        "only what is nearer than the radius",
        "swept_sphere.py",
        "t, latest, radius + 2.0 * eps)",
        "t, latest, 0.99 * radius)",
    ),
    Mutation("an edge is left alone", "swept_sphere.py", "t, radius - 0.875 * eps)", "t, 0.999 * radius)"),
    Mutation("an edge without a face behind it", "swept_sphere.py", "return x > 0.0 and x * x", "return x * x"),
    Mutation("an edge nearest at the start", "swept_sphere.py", "min(1.0, max(t, nearest))", "t"),
    Mutation(
        "a snapped face is not asked",
        "swept_sphere.py",
        "        if not approaches(-abs(wn), w):\n            return MISS, n\n",
        "",
    ),
    Mutation("a direction without reach", "traversal.py", " & (free * free > reach * reach * distance2)", ""),
    Mutation("a box without reach", "traversal.py", "ex, ey, ez = box.x + reach,", "ex, ey, ez = box.x,"),
    Mutation("a leaf without its last triangle", "traversal.py", "-inside % WIDTH", "-inside % WIDTH - 1"),
    Mutation(
        "a walk that leaves a box out",
        "traversal.py",
        'record["waiting"] = end',
        'record["waiting"] = max(first, end - 1)',
    ),
    Mutation("a walk to what is furthest", "traversal.py", "[place - 1]] > order[k]", "[place - 1]] < order[k]"),
    Mutation("a walk around a point that falls short", "traversal.py", "distance <= reach", "distance <= 0.9 * reach"),
    Mutation("a stale neighbourhood", "candidate_cache.py", HOLDS, "cylinder.length >= 0.0"),
    Mutation("a neighbourhood of the start", "candidate_cache.py", HOLDS, "holds(cylinder, p)"),
    Mutation("a neighbourhood of the centre", "candidate_cache.py", "1.42 * radius + scene.radius", "1.42 * radius"),
    Mutation(
        "a neighbourhood of the path alone", "candidate_cache.py", "1.42 * radius + scene.radius +", "scene.radius +"
    ),
    Mutation("a neighbourhood of one path", "candidate_cache.py", "near, p, way, reach", "near, p, w, reach"),
    Mutation("a full list", "candidate_cache.py", "        return False\n    _read", "        count = most\n    _read"),
    Mutation(
        "a full search for a list",
        "candidate_cache.py",
        "                return False\n            for",
        "                break\n            for",
    ),
    Mutation(
        "a full queue",
        "candidate_cache.py",
        "            if waiting > QUEUE:\n                return False",
        "            if waiting > QUEUE:\n                break",
    ),
    Mutation("a list for half of the path", "candidate_cache.py", "w, 0.0, 1.0,", "w, 0.0, 0.5,"),
    Mutation("a list of one normal", "candidate_cache.py", 'put(listed["n"], k,', 'put(listed["n"], 0,'),
    Mutation("no triangle is met last", "candidate_cache.py", "if best.row >= 0:", "if best.row < -1:"),
    Mutation("borders that never come later", "candidate_cache.py", "            last += 1\n", "            pass\n"),
    Mutation(
        "a rattling ball is held from one side",
        "contact.py",
        "        held = hold(contacts, held, scale(n, -1.0), 0.0)\n",
        "        pass\n",
    ),
    Mutation("a lane over two meshes", "rolling_batch.py", 'a["surface"] == b["surface"]', "True"),
    Mutation("a lane on another plane", "rolling_batch.py", "<= LEVEL * scene.eps", "<= math.inf"),
    Mutation("a lane on a floor with a back", "rolling_batch.py", 'if not triangle["one_sided"]', "if False"),
    Mutation("a lane through walls", "rolling_batch.py", "free = min(free, _clear_until(", "_ = (free, _clear_until("),
    Mutation("a lane that turns towards them", "rolling_batch.py", "side * climb)", "-side * climb)"),
    Mutation("a lane as wide as its cylinder", "rolling_batch.py", "reach_around(scene, radius)", "radius"),
    Mutation("a lane without ground", "rolling_batch.py", "stands, free = False, 1.0", "stands, free = True, 1.0"),
    Mutation(
        "a lane without an end",
        "rolling_batch.py",
        "on &= holds(cylinder, end) & (",
        "on &= (",
        also=(Mutation("", "rolling_batch.py", " & holds(cylinder, add(p, path))", ""),),
    ),
    Mutation("a lane above the ground", "rolling_batch.py", "(abs(gap) <=", "(gap >= -"),
    Mutation(
        "a lane in the ground",
        "rolling_batch.py",
        "(abs(gap) <=",
        "(gap <=",
        also=(Mutation("", "rolling_batch.py", "(gap + dot(way, n) >= -TOUCHES * eps)", "(gap < 1.0)"),),
    ),
    Mutation("a lane without touch", "rolling_batch.py", "climb <= -16.0 * eps", "climb <= math.inf"),
    Mutation(
        "a lane for balls that bounce",
        "rolling_batch.py",
        'dot(average, n) <= lane["press"][i]',
        "dot(average, n) <= math.inf",
    ),
    Mutation(
        "a lane that is always sunk into", "rolling_batch.py", "choose(sinking < 0.0,", "choose(sinking < math.inf,"
    ),
    Mutation(
        "a lane for balls that lie still",
        "rolling_batch.py",
        "speed2 > slow * slow * dot(gravity, gravity)",
        "speed2 > 0.0",
    ),
    Mutation("a lane for balls that stop", "rolling_batch.py", "speed > braking * dt", "speed > 0.0"),
    Mutation("a lane out of bounds", "rolling_batch.py", "(end.x <= upper.x)", "(end.x <= math.inf)"),
    Mutation("a lane without a time limit", "rolling_batch.py", ' & (lane["rolled"][i] < lane["left"][i])', ""),
    Mutation("time in a lane does not count", "step.py", 'steps + lane["rolled"][k], 0', "steps, 0"),
    Mutation("a first corner of any kind", "triangles.py", "opposite.argmax(axis=1)", "opposite.argmin(axis=1)"),
    Mutation("a rising part is kept", "contact.py", "along(v, -max(0.0, dot(v, n)), n))", "v)"),
    Mutation("a rattling ball bounces", "step.py", "if lasts or rattles:", "if lasts:"),
    Mutation("a stop is never final", "step.py", "Vec3(0.0, 0.0, 0.0) if rattles else stop(", "stop("),
    Mutation("stops without end", "contact.py", " or dot(sideways, sideways) <= 2.0 * eps * braking:", ":"),
    Mutation("every stop is final", "step.py", "if still or norm(pull) <=", "if still or -1.0 <="),
    Mutation("what stopped a ball stops it for good", "step.py", "True, 0, scene.gravity, net", "True, held, a, net"),
    Mutation("gravity alone presses", "contact.py", "-dot(gravity, n), -dot(a, n))", "-dot(gravity, n))"),
    Mutation("acceleration alone presses", "contact.py", "max(0.0, -dot(gravity, n), -dot", "max(0.0, -dot"),
]


@dataclass(frozen=True)
class Args:
    """The command line."""

    only: tuple[str, ...] = ()
    """Parts of the names of mutations to run; all without."""
    jobs: int = 1
    """Mutations tested at a time."""


def apply(mutation: Mutation, package: Path) -> None:
    """Break the physics in a folder.

    Raises:
        ValueError: the text to replace does not occur exactly once.
    """
    for change in (mutation, *mutation.also):
        file = package / change.file
        text = file.read_text()
        if text.count(change.old) != 1:
            raise ValueError(
                f"{mutation.name!r}: expected once in {change.file}, found {text.count(change.old)} times: "
                f"{change.old!r}; say the fault in the words that the file has now."
            )
        file.write_text(text.replace(change.old, change.new))


def first_failure(mutation: Mutation | None) -> str | None:
    """Return the first test that fails on a broken copy (None: an intact one), or None."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in ("minigolf_env", "tests"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        tests = TESTS
        if mutation is not None:
            apply(mutation, copy / PHYSICS.relative_to(ROOT))
            tests = sorted(TESTS, key=lambda name: Path(name).stem != f"test_{Path(mutation.file).stem}")
        # CI: the same examples each time. A cache of its own: numba does not notice a change in a helper.
        environment = {**os.environ, "CI": "1", "PYTHONPATH": folder, "NUMBA_CACHE_DIR": str(copy / "cache")}
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]
        try:
            run = subprocess.run(
                command, cwd=copy, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False
            )
        except subprocess.TimeoutExpired:
            return f"nothing ended within {PATIENCE} s"
    if run.returncode == 0:
        return None
    failures: list[str] = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", run.stdout, re.MULTILINE)
    if not failures:
        raise RuntimeError(f"pytest ended with {run.returncode}:\n{run.stdout[-2000:]}\n{run.stderr[-2000:]}")
    return failures[0]


def report(mutation: Mutation) -> bool:
    """Test a mutation and print its row; return whether it was noticed."""
    began = time.perf_counter()
    failure = first_failure(mutation)
    seconds = time.perf_counter() - began
    print(f"{mutation.name:40} {seconds:4.0f} s  {failure or 'SURVIVED'}", flush=True)
    return failure is not None


def main(args: Args) -> int:
    """Print a row for each mutation; return 1 if one survived."""
    chosen = [m for m in MUTATIONS if not args.only or any(part in m.name for part in args.only)]
    failure = first_failure(None)
    if failure is not None:
        print(f"The tests fail on the intact package: {failure}", file=sys.stderr)
        return 1
    with ThreadPoolExecutor(args.jobs) as pool:
        noticed = list(pool.map(report, chosen))
    print(f"{sum(noticed)} of {len(noticed)} mutations noticed")
    return 0 if all(noticed) else 1


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Args, description=__doc__)))
