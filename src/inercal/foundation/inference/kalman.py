"""Compiled steps of a Kalman filter for one scalar measurement at a time, with sparse rows."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]


class SlopeRow(NamedTuple):
    """Room for the derivative h of a scalar measurement by the state: zero but for ``values`` at ``places``, of which
    the first so many are used."""

    places: Indices
    values: Array


@allocating
def empty_row(size: int) -> SlopeRow:
    """Room for a row of at most ``size`` entries."""
    return SlopeRow(np.empty(size, dtype=np.int64), np.empty(size))


@kernel
def innovation_variance(P: Array, row: SlopeRow, size: int, noise: float) -> float:
    """Variance ``h P h^T + r`` of one measurement; arguments as in `scalar_update`."""
    places, values = row.places, row.values
    total = noise
    for a in range(size):
        line = P[places[a]]
        half = 0.5 * values[a] * line[places[a]]
        for b in range(a):
            half += values[b] * line[places[b]]
        total += 2.0 * values[a] * half
    return total


@kernel
def scalar_update(P: Array, x: Array, row: SlopeRow, size: int, z: float, noise: float, work: Array) -> float:
    """Update an error state ``x`` (n,) and its covariance ``P`` (n, n), both in place, by one measurement.

    ``z = h x + v``, v of variance ``noise``. Measurements of one time are put in one after the other, with rows of one
    linearisation and ``z`` the innovation before the first of them; correlated noise must be decorrelated first.

    Returns the square of the innovation over its variance; summed over the measurements of one time it is their
    normalised innovation squared. ``work`` (n,) is used up.
    """
    places, values = row.places, row.values
    n = len(x)
    work.fill(0.0)
    for a in range(size):
        line, value = P[places[a]], values[a]  # rows of P are its columns, and near each other
        for i in range(n):
            work[i] += line[i] * value
    variance, innovation = noise, z
    for a in range(size):
        variance += values[a] * work[places[a]]
        innovation -= values[a] * x[places[a]]
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
