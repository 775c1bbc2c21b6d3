"""Confidence intervals: known bounds, and how often they contain the true value."""

from __future__ import annotations

import math

import numpy as np
import pytest

from minigolf_env.evaluation.benchmark import LevelSetResult
from minigolf_env.evaluation.evaluate import EvaluationResult
from minigolf_env.evaluation.report import format_percentage, format_with_interval, print_benchmark, print_evaluations
from minigolf_env.evaluation.statistics import NORMAL_QUANTILE_95, mean_interval, ratio_interval, wilson_interval


def test_wilson_interval_bounds_solve_the_score_equation() -> None:
    """The bounds solve |k/n - p| = z sqrt(p (1 - p) / n), and stay in [0, 1] where all trials had the same result."""
    for successes, n in ((3, 10), (40, 50), (1, 500)):
        for p in wilson_interval(successes, n):
            assert abs(successes / n - p) == pytest.approx(NORMAL_QUANTILE_95 * math.sqrt(p * (1 - p) / n))
    assert wilson_interval(0, 20)[0] == pytest.approx(0.0) and wilson_interval(20, 20)[1] == pytest.approx(1.0)


def test_mean_and_ratio_intervals_contain_true_value_95_percent_of_the_time() -> None:
    """The law is tested for a mean of uniform numbers, and for the ratio of the means of dependent pairs."""
    rng = np.random.default_rng(0)
    contained = []
    for _ in range(3000):
        y = rng.uniform(1.0, 3.0, 100)
        x = 1.5 * y + rng.normal(size=100)
        mean, ratio = mean_interval(y), ratio_interval(x, y)
        contained.append((mean[0] < 2.0 < mean[1], ratio[0] < 1.5 < ratio[1]))
    assert (np.abs(np.mean(contained, axis=0) - 0.95) < 0.02).all()


@pytest.mark.parametrize("scale", [0.25, 1.0, 8.0])
def test_ratio_interval_is_inverse_to_scale_of_references(scale: float) -> None:
    """References that are k times as large divide the ratio and its bounds by k, exactly for powers of 2."""
    rng = np.random.default_rng(1)
    references = rng.uniform(1.0, 3.0, 100)
    values = 1.5 * references + rng.normal(size=100)
    low, high = ratio_interval(values, references)
    assert ratio_interval(values, scale * references) == (low / scale, high / scale)
    assert ratio_interval(scale * values, references) == (low * scale, high * scale)
    margin = NORMAL_QUANTILE_95 * np.std(values - values.mean() / references.mean() * references, ddof=1) / 10.0
    assert high - low == pytest.approx(2.0 * margin / references.mean())


def test_interval_stays_within_possible_values() -> None:
    """A single value tells nothing: its interval is that of all possible values."""
    assert mean_interval([3.0], 1.0, 10.0) == (1.0, 10.0)
    assert mean_interval([1.0, 1.0, 2.0], 1.0, 10.0)[0] == 1.0
    assert ratio_interval([9.0], [3.0], 0.1, 10.0) == (0.1, 10.0)


@pytest.mark.parametrize(
    ("fraction", "interval", "text"),
    [
        (1.0, (0.996, 1.0), "100.0% [99, 100]"),
        (0.0, (0.0, 0.004), "0.0% [0, 1]"),
        (0.91, (0.86, 0.94), "91.0% [86, 94]"),
        (0.5, (0.4999, 0.5001), "50.0% [49, 51]"),
    ],
)
def test_percentages_are_rounded_outwards(fraction: float, interval: tuple[float, float], text: str) -> None:
    """Rounding never hides that an interval has a width."""
    assert format_percentage(fraction, interval) == text


@pytest.mark.parametrize(
    ("interval", "text"),
    [
        ((0.996, 1.004), "1.00 [0.99, 1.01]"),
        ((1.0, 1.004), "1.00 [1.00, 1.01]"),
        ((1.0, 1.0), "1.00 [1.00, 1.00]"),
        ((0.29, 0.58), "1.00 [0.29, 0.58]"),
    ],
)
def test_means_are_rounded_outwards(interval: tuple[float, float], text: str) -> None:
    """An interval of a positive width is never printed as one number, and exact ends stay as they are."""
    assert format_with_interval(1.0, interval) == text


@pytest.mark.parametrize("policy", ["generalist", "runs/procedural-12/checkpoint.npz"])
def test_tables_fit_into_80_columns(
    policy: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No cell is broken, with the longest names and widest numbers."""
    monkeypatch.setenv("COLUMNS", "80")
    interval = (10.0, 10.0)
    wide = {"strokes": 10.0, "strokes_interval": interval, "holed": 1.0, "holed_interval": (0.996, 1.0)}
    score = EvaluationResult(
        policy=policy,
        sha256=None,
        course="procedural",
        difficulty="medium",
        episodes=1000,
        first_seed=0,
        max_strokes=10,
        putt_noise=(0.5, 0.015),
        hole_in_one=1.0,
        hole_in_one_interval=(0.996, 1.0),
        **wide,  # type: ignore[arg-type]
    )
    level_set = LevelSetResult(
        difficulty="medium",
        level_set="held out",
        first_level=0,
        num_levels=200,
        relative=10.0,
        relative_interval=interval,
        by_level=(),
        search_by_level=(),
        **wide,  # type: ignore[arg-type]
    )
    print_evaluations([score])
    print_benchmark(policy, [level_set])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    rows = [line for line in lines if "10.00 [10.00, 10.00]" in line and "100.0% [99, 100]" in line]
    assert len(rows) == 2 and rows[1].count("10.00 [10.00, 10.00]") == 2
