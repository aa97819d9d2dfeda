"""Frequency at which a model oscillates, from what was recorded so far.

The angular acceleration that the accelerometers show, (A1 + A3)/(r3 - r1) for three axes, in which gravity cancels, is
looked at through a Hann window of 10 s, which moves on by half a second; the spectrum's highest peak is found between
its samples by a parabola through the logarithms. Source: Tan et al. 2021; ours are the test that the peak is one, and
that against the gyro.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.systems.aoa.layout import Layout, all_weights
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.clock import shortened

_HOP = 0.5
_FINE = 5e-3
"""Interval [s] that samples are averaged over first."""

_HIGHEST = 0.4
"""Highest frequency, over that of the averaged samples."""

_PADDING = 4
_FIRST = 1000
"""Intervals from which the usual one is found, so that what comes later changes nothing."""


def oscillation_frequency(t: Array, acc: Array, gyro: Array, layout: Layout) -> Array:
    """(n,) Hz: frequency of the oscillation at each row, from rows up to it alone; NaN where there is none.

    ``t`` (n,) [s] increases; ``acc`` (n, N) [m/s^2]; ``gyro`` (n,) [rad/s]. A peak must show in the gyro too, by the
    same amplitude within a factor of 2, where it is high enough to be seen; without a gyro the accelerometers are
    believed. A ``layout`` without axes that show angular acceleration gives no frequency.
    """
    nowhere = np.full(len(t), np.nan)
    weights = all_weights(layout)
    if weights is None or len(t) < 2:
        return nowhere
    usual = round(float(np.median(np.diff(t[: _FIRST + 1]))), 9)
    t = shortened(t, 2.0 * LIMITS.oscillation_window)  # no window reaches over such a gap
    width = usual * max(1, round(_FINE / usual))
    used = np.flatnonzero(weights)
    shaking = _averaged(t, acc[:, used] @ weights[used], width)
    turning = _averaged(t, gyro, width)
    place = _places(t, width)
    hop = max(1, round(_HOP / width))
    longest = max(1, round(LIMITS.oscillation_window / width))
    ends = range(hop, int(place[-1]) + 1, hop)
    of_window = np.array([math.nan, *(_peak(shaking, turning, max(0, e - longest), e, width) for e in ends)])
    # a row belongs to the interval that it begins or lies in: all before that one are complete
    return of_window[np.minimum(place // hop, len(ends))]


def _places(t: Array, width: float) -> NDArray[np.int64]:
    """Interval of ``width`` that each row falls into."""
    return np.asarray(np.floor((t - t[0]) / width + 1e-6), dtype=np.int64)


def _averaged(t: Array, values: Array, width: float) -> Array:
    """Means over intervals of ``width``, NaN where there is no value."""
    finite = np.isfinite(values)
    place = _places(t, width)
    total = np.bincount(place[finite], values[finite], place[-1] + 1)
    count = np.bincount(place[finite], minlength=place[-1] + 1)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _peak(shaking: Array, turning: Array, begin: int, end: int, width: float) -> float:
    """Frequency [Hz] of the oscillation in a window, NaN without one."""
    size = end - begin
    padded = 1 << (_PADDING * size - 1).bit_length()
    power, gyro = (_power(each[begin:end], padded) for each in (shaking, turning))
    low = math.ceil(LIMITS.oscillation_periods / (size * width) * padded * width)
    high = int(_HIGHEST * padded)
    if high - low < 3 or not power.any():
        return math.nan
    k = low + int(np.argmax(power[low:high]))
    # the median of an exponential distribution is ln 2 of its mean
    enough = LIMITS.peak_power / math.log(2.0)
    drift = power[1:low].max(initial=0.0)
    if k == low or power[k] < max(enough * np.median(power[low:high]), LIMITS.leaked_power * drift):
        return math.nan
    a, b, c = np.log(power[k - 1 : k + 2])
    f = (k + 0.5 * (a - c) / (a - 2.0 * b + c)) / (padded * width)
    expected = power[k] / (2.0 * math.pi * f) ** 2
    agreeing = LIMITS.amplitude_ratio**2
    seen = expected > agreeing * enough * np.median(gyro[low:high])
    if gyro.any() and seen and not 1.0 / agreeing < gyro[k] / expected < agreeing:
        return math.nan
    return float(f)


def _power(values: Array, padded: int) -> Array:
    """Power spectrum of values less their mean through a Hann window; zero of values that are mostly missing."""
    finite = np.isfinite(values)
    if 2 * finite.sum() < len(values):
        return np.zeros(padded // 2 + 1)
    window = np.hanning(len(values) + 2)[1:-1]
    centred = np.where(finite, values, 0.0) - np.where(finite, values[finite].mean(), 0.0)
    return np.asarray(np.abs(np.fft.rfft(window * centred, padded)) ** 2)
