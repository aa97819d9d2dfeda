"""Noise as it comes: the variance in a sliding window and the Allan variance, sample by sample.

Compiled and without allocation; the state lies in small arrays, which a step changes in place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.foundation.arrays import Array

Counts = NDArray[np.int64]

OCTAVES = 40
"""Averaging times followed: 1, 2, 4 ... samples; the last is years of them."""


class Window(NamedTuple):
    """The last samples of some channels.

    ``samples`` (window, channels) is a ring; ``place`` (2,) holds how many are in it and where the next one
    goes; ``moments`` (5, channels) a centre, the sums of the deviations from it and of their squares, and from
    them mean and variance, which are NaN until the window is full.
    """

    samples: Array
    place: Counts
    moments: Array

    @property
    def mean(self) -> Array:
        """Mean (channels,) of a full window."""
        return np.asarray(self.moments[3])

    @property
    def variance(self) -> Array:
        """Variance (channels,) of a full window, by its degrees of freedom."""
        return np.asarray(self.moments[4])

    def clear(self) -> None:
        """Remove every sample."""
        self.place[:] = 0
        self.moments[:] = np.nan


class Octaves(NamedTuple):
    """Sums for the Allan variance of some channels at averaging times of 1, 2, 4 ... samples.

    ``sums`` (octaves, 2, channels) holds the sum of the last complete cluster of each length, less that of
    ``origin`` (channels,), and the sum of the squared differences of adjacent ones; ``clusters`` (octaves,)
    counts them.
    """

    sums: Array
    clusters: Counts
    origin: Array

    def clear(self) -> None:
        """Remove every sample."""
        self.sums[:] = 0.0
        self.clusters[:] = 0

    def longest(self, differences: int) -> int:
        """Number of the longest octave of at least so many differences of adjacent means, -1 if there is none."""
        return int(np.count_nonzero(self.clusters > differences)) - 1

    def variance(self, octave: int) -> tuple[Array, float]:
        """Allan variance (channels,) for means over 2^octave samples that do not overlap, and degrees of freedom.

        Of at least one difference. Neighbours among n differences share a mean: under white noise the variance
        of their mean square is (3 n - 1) / n^2 of its square, which makes 2 n^2 / (3 n - 1) degrees of freedom.
        """
        n = float(self.clusters[octave] - 1)
        return np.asarray(self.sums[octave, 1] / (2.0 * n * 4.0**octave)), 2.0 * n * n / (3.0 * n - 1.0)


def empty_window(window: int, channels: int) -> Window:
    """An empty window for so many samples, at least two."""
    return Window(np.zeros((window, channels)), np.zeros(2, np.int64), np.full((5, channels), np.nan))


def empty_octaves(channels: int) -> Octaves:
    """Octaves of no sample yet."""
    return Octaves(np.zeros((OCTAVES, 2, channels)), np.zeros(OCTAVES, np.int64), np.zeros(channels))


@kernel
def slide(x: Array, samples: Array, place: Counts, moments: Array) -> None:
    """Take a sample ``x`` (channels,), all finite, into a `Window`, and the oldest one out of a full one.

    Each time the ring has gone round, the sums are taken anew about the mean, so that no rounding error lives
    longer than the window is long.
    """
    window, channels = samples.shape
    filled, at = place[0], place[1]
    place[0], place[1] = min(filled + 1, window), (at + 1) % window
    for c in range(channels):
        if filled == 0:
            moments[0, c], moments[1, c], moments[2, c] = x[c], 0.0, 0.0
        elif filled == window:
            old = samples[at, c] - moments[0, c]
            moments[1, c] -= old
            moments[2, c] -= old * old
        new = x[c] - moments[0, c]
        moments[1, c] += new
        moments[2, c] += new * new
        samples[at, c] = x[c]
    if place[0] < window:
        return
    for c in range(channels):
        if place[1] == 0:
            centre = moments[0, c] + moments[1, c] / window
            first, second = 0.0, 0.0
            for i in range(window):
                new = samples[i, c] - centre
                first += new
                second += new * new
            moments[0, c], moments[1, c], moments[2, c] = centre, first, second
        first = moments[1, c] / window
        moments[3, c] = moments[0, c] + first
        moments[4, c] = max(moments[2, c] - first * moments[1, c], 0.0) / (window - 1)


@kernel
def cascade(x: Array, sums: Array, clusters: Counts, origin: Array) -> None:
    """Take a sample ``x`` (channels,), all finite, into `Octaves`: two clusters make one of the next octave."""
    octaves, _, channels = sums.shape
    if clusters[0] == 0:
        for c in range(channels):
            origin[c] = x[c]
    for c in range(channels):
        cluster = x[c] - origin[c]
        for k in range(octaves):
            before = sums[k, 0, c]
            if clusters[k] > 0:
                sums[k, 1, c] += (cluster - before) * (cluster - before)
            sums[k, 0, c] = cluster
            if clusters[k] % 2 == 0:
                break
            cluster += before
    for k in range(octaves):
        clusters[k] += 1
        if clusters[k] % 2 == 1:
            break


def load_kernels() -> None:
    """Compile the kernels, or load them where they have been compiled, by a first sample of one channel."""
    x = np.zeros(1)
    slide(x, *empty_window(2, 1))
    cascade(x, *empty_octaves(1))
