"""Confidence intervals: known bounds, and how often they contain the true value."""

from __future__ import annotations

import math

import numpy as np
import pytest

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
