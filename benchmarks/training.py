"""Measure the strokes that PPO needs after training, and the effect of its settings: python -m benchmarks.training.

Every variant is a command line of agents/train_ppo.py, run as a program for several seeds, and evaluated on the same
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

from benchmarks.report import check_files, print_table
from minigolf_env._atomic_io import atomic_write

REPOSITORY = Path(__file__).parents[1]

VARIANTS = {
    "default": "",
    "entropy bonus 0.003": "--ent-coef 0.003",
    "entropy bonus 0.01": "--ent-coef 0.01",
    "discount 0.9": "--gamma 0.9",
    "one epoch per update": "--n-epochs 1",
    "2,048 environments, batches of 512": "--n-envs 2048 --batch-size 512",
    "annealed noise": "--anneal-std",
    "annealed noise, discount 0.9": "--anneal-std --gamma 0.9",
    "annealed noise, reward -1 a stroke": "--anneal-std --reward strokes",
    "annealed noise, reward -1 a stroke, discount 0.9": "--anneal-std --reward strokes --gamma 0.9",
    "annealed noise, one epoch per update": "--anneal-std --n-epochs 1",
    "annealed noise, learning rate 5e-4": "--anneal-std --learning-rate 5e-4",
    "annealed noise, 600,000 time steps": "--anneal-std --total-timesteps 600_000",
    "annealed noise, target KL 0.2": "--anneal-std --target-kl 0.2",
    "annealed noise, 2,048 environments": "--anneal-std --n-envs 2048 --batch-size 512",
}
"""Arguments that each variant adds to the command line."""

MAX_LEARNED_STROKES = 1.05
"""Mean strokes up to which a run counts as having learned the hole."""

CURVES_PER_ROW = 4
"""Number of panels in a row of the figure."""


@dataclass(frozen=True)
class Args:
    """Command-line arguments."""

    seeds: int = 5
    """Number of seeds of each variant, from 0."""
    variants: tuple[str, ...] = tuple(VARIANTS)
    """Names of the variants to run."""
    parallel_runs: int = 1
    """Number of runs at the same time; 1 where the wall-clock time matters."""
    options: str = ""
    """Arguments added to every command line."""
    figure: Path | None = REPOSITORY / "docs" / "figures" / "training.png"
    """File for the learning curves; None draws none."""


@dataclass(frozen=True)
class TrainingResult:
    """Outcome of one run."""

    seconds: float
    """Wall-clock time from the start of the process to its end, final evaluation included, s."""
    score: dict[str, Any]
    """Score of the best checkpoint in the final evaluation."""
    history: list[dict[str, float]]
    """Evaluations of the checkpoints."""


def train(variant: str, seed: int, options: str) -> TrainingResult:
    """Run the training program once and return its outcome."""
    with tempfile.TemporaryDirectory() as temporary_folder:
        folder = Path(temporary_folder) / "run"
        arguments = [*VARIANTS[variant].split(), *options.split(), "--seed", str(seed), "--n-search-episodes", "0"]
        command = [sys.executable, "-m", "agents.train_ppo", "--out", str(folder), *arguments]
        started = time.perf_counter()
        subprocess.run(command, cwd=REPOSITORY, check=True, stdout=subprocess.DEVNULL)
        seconds = time.perf_counter() - started
        history = json.loads((folder / "progress.json").read_text())
        scores = json.loads((folder / "scores.json").read_text())["scores"]
    ppo_score = next(score for score in scores if score["policy"] == "PPO")
    return TrainingResult(seconds, ppo_score, history)


def draw_learning_curves(results: dict[str, list[TrainingResult]], path: Path) -> None:
    """Draw the strokes of the checkpoints over the time steps, a panel for each variant and a curve for each seed."""
    num_columns = min(CURVES_PER_ROW, len(results))
    num_rows = -(-len(results) // CURVES_PER_ROW)
    figure = Figure(figsize=(3.2 * num_columns, 2.6 * num_rows), layout="constrained")
    grid = figure.subplots(num_rows, num_columns, sharex=True, sharey=True, squeeze=False)
    panels = iter(grid.flat)
    for (name, runs), axes in zip(results.items(), panels, strict=False):
        for run in runs:
            timesteps = [row["timesteps"] / 1e6 for row in run.history]
            axes.plot(timesteps, [row["strokes"] for row in run.history], linewidth=1.2)
        axes.set(title=name, yscale="log", ylim=(0.95, 10), yticks=[1, 2, 5, 10], yticklabels=["1", "2", "5", "10"])
        axes.grid(alpha=0.3)
        axes.minorticks_off()
    for unused_axes in panels:
        unused_axes.axis("off")
    figure.supxlabel("putts, millions")
    figure.supylabel("mean strokes of a checkpoint")
    with atomic_write(path) as temporary_file:
        figure.savefig(temporary_file, dpi=80)


def table_row(variant: str, runs: list[TrainingResult]) -> list[str]:
    """Return the cells of a variant in the printed table."""
    strokes = [run.score["strokes"] for run in runs]
    num_learned = sum(mean <= MAX_LEARNED_STROKES for mean in strokes)
    return [
        variant,
        f"{num_learned} of {len(strokes)}",
        f"{median(strokes):.2f}",
        f"{max(strokes):.2f}",
        f"{median(run.score['hole_in_one'] for run in runs):.0%}",
        f"{median(run.seconds for run in runs):.0f} s",
    ]


def main(args: Args) -> None:
    """Run all variants, print the table, draw the curves."""
    check_files(args)
    jobs = [(variant, seed) for seed in range(args.seeds) for variant in args.variants]
    results: dict[str, list[TrainingResult]] = {variant: [] for variant in args.variants}
    with ThreadPoolExecutor(args.parallel_runs) as executor:
        finished = executor.map(lambda job: train(*job, args.options), jobs)
        for (variant, seed), result in zip(jobs, tqdm(finished, total=len(jobs)), strict=True):
            results[variant].append(result)
            score = f"{result.score['strokes']:.3f} strokes, {result.score['hole_in_one']:.1%} holes-in-one"
            print(f"{variant}, seed {seed}: {score}, {result.seconds:.0f} s")
    learned = f"seeds at {MAX_LEARNED_STROKES} or less"
    header = ["variant", learned, "mean strokes, median of seeds", "worst seed", "holes-in-one", "time"]
    print_table(header, [table_row(variant, runs) for variant, runs in results.items()])
    if args.figure is not None:
        draw_learning_curves(results, args.figure)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
