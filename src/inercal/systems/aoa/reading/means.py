"""Uncertainty of a mean of rows that are correlated, often negatively: noise, buffet, an oscillation cut off.

It is found from the spectrum near zero: with the lowest K cosines of n rows,

    L_k = sqrt(2/n) sum_i x_i cos(pi k (i + 1/2) / n),   var(mean) = (1/n) (1/K) sum_k L_k^2,

K = 8 degrees of freedom. For white noise that is s^2/n, for noise of correlation time c well below the length T of all
rows (c < T / pi K) s^2 2c/T, and for an oscillation, whose mean is all but zero over whole periods, twice the variance
that its cut periods leave. Source: Lazarus, Lewis, Stock and Watson 2018, "HAR inference: recommendations for
practice", J. Business and Economic Statistics 36(4) (equally weighted cosines).
"""

from __future__ import annotations

import math

import numpy as np

from inercal.foundation.arrays import Array

COSINES = 8


def mean_u(x: Array) -> float:
    """Standard uncertainty of the mean of ``x`` (n,), evenly sampled, by noise and oscillations; 0 for one value."""
    n = len(x)
    count = min(COSINES, n - 1)
    if count < 1:
        return 0.0
    k = np.arange(1, count + 1)
    cosines = np.cos(math.pi / n * k[:, None] * (np.arange(n) + 0.5))
    coefficients = math.sqrt(2.0 / n) * (cosines @ (x - x.mean()))
    return math.sqrt(float(coefficients @ coefficients) / (count * n))
