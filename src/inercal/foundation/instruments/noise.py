"""The noise of an inertial sensor at rest: five processes, their Allan variance, and samples of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.arrays import Array

BIAS_FLOOR = 2.0 * np.log(2.0) / np.pi
"""Allan variance of bias instability per B^2, so that B = floor / 0.664."""

SYMBOLS = ("N", "B", "K", "R", "Q")
"""The processes, in the order of results."""


def allan_terms(tau: ArrayLike) -> Array:
    """Allan variance (*tau.shape, 5) of unit N, B, K, R and Q at averaging times ``tau`` [s]."""
    t = np.asarray(tau, dtype=float)
    return np.stack([1.0 / t, np.full_like(t, BIAS_FLOOR), t / 3.0, t**2 / 2.0, 3.0 / t**2], axis=-1)


@dataclass(frozen=True)
class NoiseModel:
    """Independent noise processes of a channel, whose samples are means over the sample interval.

    In the unit of the channel: ``N`` angle or velocity random walk [unit*sqrt(s)], ``B`` bias instability [unit],
    ``K`` rate or acceleration random walk [unit/sqrt(s)], ``R`` ramp [unit/s, signed], ``Q`` quantisation [unit*s].

    sigma^2(tau) = R^2 tau^2/2 + K^2 tau/3 + B^2 (2 ln 2)/pi + N^2/tau + 3 Q^2/tau^2
    """

    N: float = 0.0
    B: float = 0.0
    K: float = 0.0
    R: float = 0.0
    Q: float = 0.0

    def variance(self, tau: ArrayLike) -> Array:
        """Allan variance (*tau.shape) at averaging times ``tau`` [s]."""
        return np.asarray(allan_terms(tau) @ np.square([self.N, self.B, self.K, self.R, self.Q]))

    def simulate(self, n: int, interval: float, rng: np.random.Generator, channels: int = 1) -> Array:
        """Samples (n, channels) at equal intervals [s] whose expected Allan variance is `variance` at every multiple.

        N, K and Q and the ramp start from zero; the level of flicker noise is not defined, and its mean over the
        samples is made zero.
        """
        shape = (n, channels)
        x = np.zeros(shape)
        if self.N:
            x += rng.standard_normal(shape) * (self.N / np.sqrt(interval))
        if self.B:
            x += self.B * flicker(n, rng, channels)
        if self.K:
            x += self.K * np.sqrt(interval) * _walk(rng, shape)
        if self.R:
            x += self.R * interval * (np.arange(n)[:, None] + 0.5)
        if self.Q:
            x += self.Q / interval * np.diff(rng.standard_normal((n + 1, channels)), axis=0)
        return x


def flicker(n: int, rng: np.random.Generator, channels: int = 1) -> Array:
    """Flicker noise (n, channels) of density 1/(2 pi f), two-sided, averaged over each sample, with mean zero.

    The generalised autocovariance of its integral is t^2 ln|t| / (2 pi), so that of the steps between samples is
    the fourth difference of that, and the steps are drawn by circulant embedding: the Allan variance has the same
    expectation at all averaging times, to the whole record.

    References
    ----------
    A. T. A. Wood and G. Chan, "Simulation of stationary Gaussian processes in [0, 1]^d", J. Comput. Graph. Stat. 3
    (1994) 409-432.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    half = next_fast_len(max(n, 2), real=True)
    t = np.arange(-2.0, half + 3.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.where(t == 0.0, 0.0, t**2 * np.log(np.abs(t))) / (2.0 * np.pi)
    steps = np.diff(r, 4)
    # far out the differences drown in rounding: there the fourth derivative, -2 / t^2, and its first correction
    far = np.arange(half + 1) > 100
    at = np.arange(half + 1)[far].astype(float)
    steps[far] = -(1.0 / at**2 + 1.0 / at**4) / np.pi
    spectrum = np.maximum(rfft(np.concatenate([steps, steps[-2:0:-1]])).real, 0.0)
    z = rng.standard_normal((2, len(spectrum), channels)) * np.sqrt(spectrum * half)[:, None]
    z[:, [0, -1]] *= [[[np.sqrt(2.0)]], [[0.0]]]  # real at both ends
    x = np.cumsum(irfft(z[0] + 1j * z[1], 2 * half, axis=0)[:n], axis=0)
    return np.asarray(x - x.mean(axis=0))


def _walk(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Means over unit intervals of a random walk of unit intensity that starts from zero."""
    steps = rng.standard_normal(shape)
    # within an interval: half its step, and the mean of the bridge, of variance 1/12 and independent of the step
    return np.asarray(np.cumsum(steps, axis=0) - 0.5 * steps + rng.standard_normal(shape) / np.sqrt(12.0))
