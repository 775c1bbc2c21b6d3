"""95 % confidence intervals of means, ratios of means and proportions."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

Interval = tuple[float, float]

NORMAL_QUANTILE_95 = 1.96
"""Two-sided 95 % quantile of the standard normal distribution."""


def mean_interval(values: ArrayLike, low: float = -math.inf, high: float = math.inf) -> Interval:
    """Return the 95 % confidence interval of a mean, by the normal distribution.

    Args:
        values: the sample; the interval of a single value is that of all possible ones.
        low: smallest possible value.
        high: largest possible value.
    """
    array = np.asarray(values, dtype=np.float64)
    margin = NORMAL_QUANTILE_95 * float(array.std(ddof=1)) / math.sqrt(len(array)) if len(array) > 1 else math.inf
    return max(low, float(array.mean() - margin)), min(high, float(array.mean() + margin))


def ratio_interval(
    values: ArrayLike, references: ArrayLike, low: float = -math.inf, high: float = math.inf
) -> Interval:
    """Return the 95 % confidence interval of the ratio of two means of paired values, within ``low`` and ``high``.

    Source: W. G. Cochran, Sampling Techniques, 1977, section 6.4.
    """
    x = np.asarray(values, dtype=np.float64)
    y = np.asarray(references, dtype=np.float64)
    ratio = float(x.mean() / y.mean())
    below, above = mean_interval(x - ratio * y)
    return max(low, ratio + below / float(y.mean())), min(high, ratio + above / float(y.mean()))


def wilson_interval(successes: int, n: int) -> Interval:
    """Return the 95 % confidence interval of a proportion, accurate near 0 and 1, too (E. B. Wilson, 1927)."""
    z = NORMAL_QUANTILE_95
    proportion = successes / n
    centre = proportion + z * z / (2 * n)
    spread = z * math.sqrt(proportion * (1 - proportion) / n + z * z / (4 * n * n))
    return max(0.0, (centre - spread) / (1 + z * z / n)), min(1.0, (centre + spread) / (1 + z * z / n))
