"""Compiled steps of a Kalman filter for one scalar measurement at a time, with sparse rows."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]


@kernel
def innovation_variance(P: Array, places: Indices, row: Array, count: int, noise: float) -> float:
    """Variance ``h P h^T + r`` of one measurement; arguments as in `scalar_update`."""
    total = noise
    for a in range(count):
        for b in range(count):
            total += row[a] * row[b] * P[places[a], places[b]]
    return total


@kernel
def scalar_update(
    P: Array, x: Array, places: Indices, row: Array, count: int, z: float, noise: float, work: Array
) -> float:
    """Update an error state ``x`` (n,) and its covariance ``P`` (n, n), both in place, by one measurement.

    ``z = h x + v``, v of variance ``noise``; h is zero but for ``row[:count]`` at ``places[:count]``. What several
    measurements of one time say is put in one after the other, with rows of one linearisation and ``z`` the innovation
    before the first of them; noise that is correlated must be decorrelated first.

    Returns the square of the innovation over its variance; summed over the measurements of one time it is their
    normalised innovation squared. ``work`` (n,) is used up.
    """
    n = len(x)
    for i in range(n):
        total = 0.0
        for a in range(count):
            total += P[i, places[a]] * row[a]
        work[i] = total
    variance, innovation = noise, z
    for a in range(count):
        variance += row[a] * work[places[a]]
        innovation -= row[a] * x[places[a]]
    gain, root = innovation / variance, 1.0 / math.sqrt(variance)
    for i in range(n):
        x[i] += gain * work[i]
    for i in range(n):
        work[i] *= root
    for i in range(n):
        of_row = work[i]
        for j in range(n):
            P[i, j] -= of_row * work[j]  # symmetric to the last digit
    return gain * innovation
