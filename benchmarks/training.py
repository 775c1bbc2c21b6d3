"""What does training reach, and what is each of its settings worth? Run: python -m benchmarks.training.

Every variant is a command line of agents/train_ppo.py, run from process start for several seeds, and scored on the same
fixed episodes. Prints a table and draws the learning curves to docs/figures/training.png.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import tyro
from matplotlib.figure import Figure
from tqdm import tqdm

from benchmarks.report import print_table

ROOT = Path(__file__).parents[1]

VARIANTS = {
    "default": "",
    "entropy bonus 0.003": "--ent-coef 0.003",
    "entropy bonus 0.01": "--ent-coef 0.01",
    "discount 0.9": "--gamma 0.9",
    "one epoch an update": "--n-epochs 1",
    "2,048 environments, batches of 512": "--num-envs 2048 --batch-size 512",
    "noise narrows": "--anneal",
    "noise narrows, discount 0.9": "--anneal --gamma 0.9",
    "noise narrows, reward -1 a stroke": "--anneal --reward strokes",
    "noise narrows, reward -1 a stroke, discount 0.9": "--anneal --reward strokes --gamma 0.9",
    "noise narrows, one epoch": "--anneal --n-epochs 1",
    "noise narrows, learning rate 5e-4": "--anneal --learning-rate 5e-4",
    "noise narrows, 600,000 putts": "--anneal --putts 600_000",
    "noise narrows, target KL 0.2": "--anneal --target-kl 0.2",
    "noise narrows, 2,048 environments": "--anneal --num-envs 2048 --batch-size 512",
}
"""What each adds to the command line."""


LEARNED = 1.05
"""Mean strokes of a run that learned the hole, at most."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    seeds: int = 5
    variants: tuple[str, ...] = tuple(VARIANTS)
    side_by_side: int = 1
    """Runs at once; 1 where wall clock time is asked for."""
    options: str = ""
    """What is added to every command line."""
    picture: Path | None = ROOT / "docs" / "figures" / "training.png"
    """The learning curves; None: not drawn."""


@dataclass(frozen=True)
class Result:
    """One run."""

    seconds: float
    """From the process's start to its end, the closing table included."""
    score: dict[str, Any]
    """Of the best checkpoint, on episodes that did not choose it."""
    history: list[dict[str, float]]
    """Of the checkpoints."""


def train(variant: str, seed: int, options: str) -> Result:
    """Return how a run went."""
    with tempfile.TemporaryDirectory() as temporary:
        folder, began = Path(temporary) / "run", time.perf_counter()
        words = [*VARIANTS[variant].split(), *options.split(), "--seed", str(seed), "--search-episodes", "0"]
        command = [sys.executable, "-m", "agents.train_ppo", "--out", str(folder), *words]
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        total = time.perf_counter() - began
        history = json.loads((folder / "progress.json").read_text())
        closing = json.loads((folder / "scores.json").read_text())["scores"]
    return Result(total, closing[-1], history)


def draw(results: dict[str, list[Result]], path: Path) -> None:
    """Draw the strokes of the checkpoints over the putts, a panel for each variant."""
    figure = Figure(figsize=(3.2 * min(4, len(results)), 2.6 * (-(-len(results) // 4))), layout="constrained")
    grid = figure.subplots(-(-len(results) // 4), min(4, len(results)), sharex=True, sharey=True, squeeze=False)
    panels = iter(grid.flat)
    for (name, runs), axes in zip(results.items(), panels, strict=False):
        for run in runs:
            putts, strokes = zip(*((row["putts"] / 1e6, row["strokes"]) for row in run.history), strict=True)
            axes.plot(putts, strokes, linewidth=1.2)
        axes.set(title=name, yscale="log", ylim=(0.95, 10), yticks=[1, 2, 5, 10], yticklabels=["1", "2", "5", "10"])
        axes.grid(alpha=0.3)
        axes.minorticks_off()
    for axes in panels:  # Those left over.
        axes.axis("off")
    figure.supxlabel("putts, millions")
    figure.supylabel("strokes of a checkpoint")
    figure.savefig(path, dpi=80)


def main(args: Args) -> None:
    """Run all, print the table, draw the curves."""
    jobs = [(variant, seed) for seed in range(args.seeds) for variant in args.variants]
    results: dict[str, list[Result]] = {variant: [] for variant in args.variants}
    with ThreadPoolExecutor(args.side_by_side) as pool:
        done = pool.map(lambda job: train(*job, args.options), jobs)
        for (variant, seed), result in zip(jobs, tqdm(done, total=len(jobs)), strict=True):
            results[variant].append(result)
            score = result.score
            print(f"{variant}, seed {seed}: {score['strokes']:.3f}, {score['hole_in_one']:.1%}, {result.seconds:.0f} s")
    rows = []
    for variant, runs in results.items():
        strokes = [run.score["strokes"] for run in runs]
        aces = median(run.score["hole_in_one"] for run in runs)
        seconds = median(run.seconds for run in runs)
        learned = f"{sum(mean <= LEARNED for mean in strokes)} of {len(strokes)}"
        shown = [learned, f"{median(strokes):.2f}", f"{max(strokes):.2f}", f"{aces:.0%}", f"{seconds:.0f} s"]
        rows.append([variant, *shown])
    heads = ["variant", f"seeds at {LEARNED} or less", "strokes, median of seeds", "worst seed", "holes-in-one", "time"]
    print_table(heads, rows)
    if args.picture is not None:
        draw(results, args.picture)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
