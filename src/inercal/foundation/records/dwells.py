"""Static intervals of a recording: where the instrument was held still.

Windowed variance against a multiple of the variance of an initial static period (Tedaldi, Pretto,
Menegatti, ICRA 2014, section IV-A).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array

WINDOW = 1.01
"""Length of the variance window [s]: 101 samples at 100 Hz."""

_BLOCK = 8192


@dataclass(frozen=True)
class Dwell:
    """A static interval: samples ``start`` to ``stop`` (exclusive)."""

    start: int
    stop: int

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.stop - self.start

    def of(self, x: Array) -> Array:
        """The rows of ``x`` in this interval."""
        return x[self.start : self.stop]


def window_samples(rate: float) -> int:
    """Odd number of samples in the variance window at a sample ``rate`` [Hz], at least 11."""
    return max(11, 2 * round(WINDOW * rate / 2.0 - 0.5) + 1)


def windowed_variance(x: Array, window: int) -> Array:
    """Size of the variance of three axes ``x`` (n, 3) in a centred ``window`` of an odd number of samples.

    Returned is (n,) the root of the sum of squares of the three axes' variances [unit of x squared]; infinite in
    windows that touch a value that is not finite, and within half a window of either end.
    """
    n, half = len(x), window // 2
    size = np.full(n, np.inf)
    for begin in range(0, n - window + 1, _BLOCK):
        # blocks keep the running sums short, so that they lose no digits to a far-away mean
        part = x[begin : begin + _BLOCK + window - 1]
        bad: NDArray[np.bool_] = np.logical_not(np.isfinite(part).all(axis=1))
        part = np.where(bad[:, None], 0.0, part)
        part = np.where(bad[:, None], 0.0, part - part[np.argmin(bad)])
        means = _moving_sum(part, window) / window
        variance = (_moving_sum(part**2, window) - window * means**2) / (window - 1)
        value = np.linalg.norm(variance, axis=1)
        value[_moving_sum(bad[:, None].astype(float), window)[:, 0] > 0.5] = np.inf
        size[begin + half : begin + half + len(value)] = value
    return size


def _moving_sum(x: Array, window: int) -> Array:
    """Sums (n - window + 1, k) over a sliding window."""
    sums = np.concatenate([np.zeros_like(x[:1]), np.cumsum(x, axis=0)])
    return np.asarray(sums[window:] - sums[:-window])


def breaks(t: Array, longest: float) -> NDArray[np.int64]:
    """Indices i where the time axis breaks between samples i - 1 and i.

    A break is a gap over ``longest`` [s], a stamp that runs backward, or one that is no number. Repeated and
    jittered stamps are none: they do no harm to means and integrals.
    """
    steps = np.diff(t)
    return np.flatnonzero(~((steps >= 0.0) & (steps <= longest))) + 1


def static_intervals(still: NDArray[np.bool_], cuts: NDArray[np.int64], shortest: int) -> tuple[Dwell, ...]:
    """Runs of ``still`` samples (n,), cut where the time axis breaks, of at least ``shortest`` samples."""
    edges = np.diff(still.astype(np.int8), prepend=0, append=0)
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    dwells = []
    for start, stop in zip(starts, stops, strict=True):
        inner = cuts[(cuts > start) & (cuts < stop)]
        bounds = [start, *inner, stop]
        dwells += [Dwell(int(a), int(b)) for a, b in itertools.pairwise(bounds) if b - a >= shortest]
    return tuple(dwells)
