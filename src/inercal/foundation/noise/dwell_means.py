"""Overlapping Allan variance, and the variance of a mean over a dwell that follows from its fit.

The mean of a dwell is less certain than white noise would make it: bias instability and rate random walk do
not average out. So the variance of a mean over tau is read off the fitted Allan variance at tau.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.noise import allan_terms


def running_sums(x: Array) -> Array:
    """Running sums (n + 1, *channels) of equally spaced samples (n, *channels), less their mean."""
    return np.concatenate([np.zeros_like(x[:1]), np.cumsum(x - x.mean(axis=0), axis=0)])


def overlapping_variance(sums: Array, m: int) -> Array:
    """Overlapping Allan variance (*channels) of rate-like samples for means over ``m`` samples, 1 <= m <= n/2.

    ``sums`` (n + 1, *channels) are the `running_sums` of the samples. Riley and Howe, NIST SP 1065 (2008), section
    5.2.4.
    """
    second = sums[2 * m :] - 2.0 * sums[m:-m] + sums[: -2 * m]
    return np.asarray(np.einsum("i...,i...->...", second, second) / (2.0 * m**2 * len(second)))


def equivalent_dof(n: int, m: int) -> float:
    """Degrees of freedom of `overlapping_variance` of ``n`` samples under white noise, at least 1.

    Riley and Howe, NIST SP 1065 (2008), table 5 (white frequency noise).
    """
    dof = (3.0 * (n - 1) / (2.0 * m) - 2.0 * (n - 2) / n) * 4.0 * m**2 / (4.0 * m**2 + 5.0)
    return max(1.0, dof)


@dataclass(frozen=True)
class AllanFit:
    """Allan variance ``N^2/tau + B^2 (2 ln 2)/pi + K^2 tau/3`` of channels, fitted with no negative term.

    ``coefficients`` (3, channels): N^2, B^2 and K^2 in the unit of the output squared (and seconds);
    ``samples`` and ``interval`` [s] of the recording it was fitted to.
    """

    coefficients: Array
    samples: int
    interval: float

    def variance(self, tau: Array) -> Array:
        """Allan variance (*tau.shape, channels) at averaging times ``tau`` [s]."""
        return np.asarray(_terms(np.asarray(tau, dtype=float)) @ self.coefficients)

    def dof(self, tau: float) -> float:
        """Degrees of freedom of one channel's Allan variance at ``tau`` [s] in that recording."""
        return equivalent_dof(self.samples, max(1, round(tau / self.interval)))


def fit(x: Array, interval: float) -> AllanFit:
    """Fit noise coefficients to a static recording ``x`` (n, channels), n >= 16, each ``interval`` [s] a sample:
    `fit_pooled` of a single stretch."""
    return fit_pooled([x], interval)


def fit_pooled(stretches: Sequence[Array], interval: float) -> AllanFit:
    """Fit noise coefficients to static stretches of a recording, whose own means say nothing.

    The ``stretches`` (n, channels) are sampled every ``interval`` [s], the longest with n >= 16. Octaves of averaging
    time go from n/512 samples of the longest (the noise of shorter means is shaped by the instrument's filters) to n/4,
    of several stretches to n/2; each value is weighted by its degrees of freedom and fitted size. (Weights from the
    values themselves would favour those that happen to be small, and understate drift by a fifth.)
    """
    from scipy.optimize import nnls

    n = max(map(len, stretches))
    longest = 2 if len(stretches) == 1 else 1
    lengths = np.unique([max(1, n // 2**k) for k in range(longest, 10)])
    sums = [running_sums(x) for x in stretches]
    variances = np.array([_pooled_variance(sums, int(m)) for m in lengths])
    dof = np.array(
        [sum(equivalent_dof(len(x), int(m)) for x in stretches if len(x) >= 2 * m) for m in lengths]
    )
    A = _terms(lengths * interval)
    coefficients = np.zeros((3, stretches[0].shape[1]))
    for channel, values in enumerate(variances.T):
        if np.all(values > 0):
            scale = A[-1]  # keeps the columns of comparable size
            size = values
            for _ in range(5):
                weight = np.sqrt(dof / 2.0) / size
                solution, _ = nnls(A / scale * weight[:, None], values * weight)
                size = A / scale @ solution
            coefficients[:, channel] = solution / scale
    return AllanFit(coefficients, sum(map(len, stretches)), interval)


def _pooled_variance(sums: Sequence[Array], m: int) -> Array:
    """Overlapping Allan variance (channels) over the stretches that are long enough, by the number of differences."""
    long_enough = [each for each in sums if len(each) > 2 * m]
    counts = [len(each) - 2 * m for each in long_enough]
    whole = sum(n * overlapping_variance(each, m) for n, each in zip(counts, long_enough, strict=True))
    return np.asarray(whole / sum(counts))


def _terms(tau: Array) -> Array:
    """Allan variance (*tau.shape, 3) of unit N, B and K."""
    return allan_terms(tau)[..., :3]
