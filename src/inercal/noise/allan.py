"""Overlapping Allan variance, and the variance of a mean over a dwell that follows from its fit.

The mean of a dwell is less certain than white noise would make it: bias instability and rate random walk do
not average out. So the variance of a mean over tau is read off the fitted Allan variance at tau.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BIAS_FLOOR = 2.0 * np.log(2.0) / np.pi
"""Allan variance of bias instability per B^2, so that B = floor / 0.664."""


def overlapping_variance(x: Array, m: int) -> Array:
    """Overlapping Allan variance of rate-like samples for means over ``m`` samples.

    Parameters
    ----------
    x : (n, *channels)
        Equally spaced samples.
    m : int
        Samples in a mean, 1 <= m <= n/2.

    Returns
    -------
    (*channels) in the unit of x squared.

    References
    ----------
    Riley and Howe, NIST SP 1065 (2008), section 5.2.4.
    """
    sums = np.concatenate([np.zeros_like(x[:1]), np.cumsum(x - x.mean(axis=0), axis=0)])
    second = sums[2 * m :] - 2.0 * sums[m:-m] + sums[: -2 * m]
    return np.asarray(np.mean(second**2, axis=0) / (2.0 * m**2))


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
    """Fit noise coefficients to a static recording.

    Parameters
    ----------
    x : (n, channels), n >= 16
        Equally spaced samples of an instrument at rest.
    interval : float
        Sample interval [s].

    Notes
    -----
    Octaves of averaging time from n/512 samples (the noise of shorter means is shaped by the instrument's
    filters) to n/4; weighted by the degrees of freedom and the fitted size of each value. (Weights from the
    values themselves would favour those that happen to be small, and understate drift by a fifth.)
    """
    from scipy.optimize import nnls

    n = len(x)
    lengths = np.unique([max(1, n // 2**k) for k in range(2, 10)])
    variances = np.array([overlapping_variance(x, int(m)) for m in lengths])
    dof = np.array([equivalent_dof(n, int(m)) for m in lengths])
    A = _terms(lengths * interval)
    coefficients = np.zeros((3, x.shape[1]))
    for channel, values in enumerate(variances.T):
        if np.all(values > 0):
            scale = A[-1]  # keeps the columns of comparable size
            size = values
            for _ in range(5):
                weight = np.sqrt(dof / 2.0) / size
                found, _ = nnls(A / scale * weight[:, None], values * weight)
                size = A / scale @ found
            coefficients[:, channel] = found / scale
    return AllanFit(coefficients, n, interval)


def _terms(tau: Array) -> Array:
    """Allan variance (*tau.shape, 3) of unit N, B and K."""
    return np.stack([1.0 / tau, np.full_like(tau, BIAS_FLOOR), tau / 3.0], axis=-1)
