"""Does a filter agree with its measurements? Judged on one recording, from innovations alone.

Innovations of a filter whose model and noise hold are white, of zero mean and of the covariance that it states
(Kailath, IEEE Trans. Automatic Control 13 (1968) 646). Three questions follow: is the normalised innovation squared
(NIS) of the expected size, is that of single rows, and are innovations uncorrelated from row to row? Limits follow
from the number of rows and an accepted risk of a false alarm (Bar-Shalom, Li and Kirubarajan, Estimation with
Applications to Tracking and Navigation, Wiley 2001, section 5.4.2). What truth is needed for is in
`inercal.foundation.inference.coverage`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.arrays import Array


@dataclass(frozen=True)
class Nis:
    """Mean NIS of the rows that have measurements.

    ``mean`` over ``rows`` and its ``expected`` value, the mean number of scalars; ``standard_error`` of the mean where
    the model holds, ``sqrt(2 expected / rows)``.
    """

    mean: float
    expected: float
    standard_error: float
    rows: int

    def limit(self, sigmas: float = 5.0) -> float:
        """Mean NIS above which measurements contradict the model by so many standard errors."""
        return self.expected + sigmas * self.standard_error

    @property
    def excess(self) -> float:
        """Offset of the mean in standard errors; inf where it is not a number."""
        if not math.isfinite(self.mean):
            return math.inf
        return (self.mean - self.expected) / self.standard_error


class RunningNis(NamedTuple):
    """NIS of the rows so far: its ``total``, the number of scalars, ``dims``, and of ``rows`` that have any."""

    total: float = 0.0
    dims: int = 0
    rows: int = 0

    def after(self, value: float, dims: int) -> RunningNis:
        """The same with one row more."""
        return RunningNis(self.total + value, self.dims + dims, self.rows + 1)

    @property
    def nis(self) -> Nis:
        """The mean so far, NaN without rows."""
        if not self.rows:
            return Nis(math.nan, math.nan, math.nan, 0)
        expected = self.dims / self.rows
        return Nis(self.total / self.rows, expected, math.sqrt(2.0 * expected / self.rows), self.rows)


def nis(values: ArrayLike, dims: ArrayLike) -> Nis:
    """Judge NIS ``values`` (n,), each of ``dims`` (n,) scalars; rows of 0 scalars are left out.

    Raises ValueError where no row has measurements.
    """
    count = np.asarray(dims, dtype=float)
    used = count > 0.0
    if not used.any():
        raise ValueError("found no row with measurements, expected one at least")
    expected, rows = float(count[used].mean()), int(used.sum())
    mean = float(np.asarray(values, dtype=float)[used].mean())
    return Nis(mean, expected, math.sqrt(2.0 * expected / rows), rows)


def surprising(values: ArrayLike, dims: ArrayLike, risk: float = 1e-3) -> NDArray[np.int64]:
    """Rows whose NIS, of ``dims`` (n,) scalars, is too large, or not a number.

    Where the model holds the probability that any is found is ``risk`` (chi-square, Bonferroni).
    """
    from scipy.special import chdtri

    x, count = np.asarray(values, dtype=float), np.asarray(dims, dtype=float)
    used = np.flatnonzero(count > 0.0)
    fine = x[used] <= chdtri(count[used], risk / max(len(used), 1))
    return np.asarray(used[~fine], dtype=np.int64)


def whiteness(innovations: ArrayLike, lags: int = 20, blocks: Sequence[int] = (10, 40, 160)) -> float:
    """Probability by chance of correlations from row to row as strong as those of innovations (n, m), NaN left out.

    Two tests of each column, and Bonferroni's inequality over all. Of each lag the sum of products x_k x_(k+lag) over
    the root of the sum of their squares is about standard normal, whatever the variances of the rows; their squares are
    summed over the ``lags``. Sums over blocks of some rows show correlation over longer times: their squares,
    each over the number of its measurements and the mean square, add up to about chi-square with as many degrees of
    freedom as there are blocks with measurements, and can be too large or too small.
    """
    from scipy.special import chdtr, chdtrc

    x = np.asarray(innovations, dtype=float)
    filled, total = np.nan_to_num(np.ascontiguousarray(x.T)), np.zeros(x.shape[1])
    squares = np.square(filled)
    for lag in range(1, lags + 1):
        sums, of_squares = (np.array([y[lag:] @ y[:-lag] for y in each]) for each in (filled, squares))
        total += _ratio(np.square(sums), of_squares)
    chances = [chdtrc(lags, total)]
    for size in blocks:
        parts = x[: len(x) // size * size].reshape(-1, size, x.shape[1])
        rows, parts = np.isfinite(parts).sum(axis=1), np.nan_to_num(parts)
        count = np.count_nonzero(rows, axis=0)
        mean_square = _ratio(np.square(parts).sum(axis=(0, 1)), rows.sum(axis=0))
        sums = _ratio(np.sum(np.square(parts.sum(axis=1)) / np.maximum(rows, 1), axis=0), mean_square)
        chance = 2.0 * np.minimum(chdtr(count, sums), chdtrc(count, sums))
        chances.append(np.where(count >= 5, chance, 1.0))
    present = np.isfinite(x).any(axis=0)
    if not present.any():
        return 1.0
    return float(min(1.0, np.min(np.array(chances)[:, present]) * present.sum() * len(chances)))


def slow_power(innovations: ArrayLike, rows: float) -> float:
    """Probability by chance of as much slow power as innovations (n, m) have together, NaN left out.

    The test is that of a process correlated over some ``rows`` beneath white noise, whose spectrum weighs the
    periodogram (locally most powerful: P. Whittle, Estimation and information in stationary time series, Arkiv foer
    Matematik 2 (1953) 423). Its ordinates are exponential where innovations are white; their weighted sum is taken for
    gamma distributed, with its mean and variance.
    """
    from scipy.special import gammaincc

    x = np.nan_to_num(np.asarray(innovations, dtype=float))
    n, squares = len(x), np.square(x).sum(axis=0)
    seen = squares > 0.0
    if n < 3 or not seen.any():
        return 1.0
    power = np.square(np.abs(np.fft.rfft(x[:, seen], axis=0)))[1 : (n + 1) // 2] / squares[seen]
    weight = 1.0 / (1.0 + np.square(2.0 * np.pi * rows * np.arange(1, len(power) + 1) / n))
    mean = float(weight.sum()) * power.shape[1]
    variance = float(np.square(weight).sum()) * power.shape[1]
    return float(gammaincc(mean**2 / variance, float(weight @ power.sum(axis=1)) * mean / variance))


def _ratio(a: Array, b: Array) -> Array:
    """a / b, 0 where b is."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)
