"""Freeing the readings of a moving model from its lever-arm terms, as Tan et al. 2021 do; every axis by its geometry.

With q and p the arms of `inercal.systems.aoa.layout`, w the gyro's rate and al the angular acceleration, the axis would
read A - (-q w^2 + p al) at rest. `inercal.systems.aoa.paper.residuals` has the error that each way leaves in closed
form.

The low pass has no delay: it is for whole recordings, looks ahead, and distorts the motion.

Frequency at which a model oscillates, from what was recorded so far.

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
from inercal.foundation.errors import StudyError
from inercal.systems.aoa.estimators import Centrifugal
from inercal.systems.aoa.layout import Layout, all_weights, centrifugal_arms, pair_weights, tangential_arms
from inercal.systems.aoa.paper.limits import LIMITS
from inercal.systems.aoa.paper.residuals import DECISION
from inercal.systems.aoa.reading.recording import shortened, usual_step

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


_FORGOTTEN = 10.0
"""Periods of the cutoff after which the filter has forgotten a value: parts further apart are filtered apart."""

_ORDER = 8
"""Of the filter that is to keep an oscillation and to remove its double: 0.4 % of either remain on the wrong side."""


def centrifugal(
    way: Centrifugal, t: Array, acc: Array, gyro: Array, layout: Layout, level: float, noise: float
) -> tuple[Array, Array]:
    """Readings (n, N) without their centrifugal term, and where (n,) the gyro made them so, 1 or 0.

    ``mechanical``: A + q w^2, which leaves q (2 w dw + dw^2) for an error dw of the gyro. ``low-pass``: the part
    (q X^2/2) cos 2 Om t of an oscillation is filtered out, q X^2/2 stays; the filter looks ahead, its cutoff is sqrt(2)
    times the median of the oscillation's frequency over the whole recording, and it takes all else beyond with it: of
    g sin theta the part at 2 Om, (theta_m^2/4) sin theta_0, and any faster motion. Where nothing oscillates nothing is
    filtered. ``decision``: the gyro where the peak rate X of the 10 s about a row is above (2 + sqrt 6) dw, otherwise
    the filter.

    ``t`` (n,) [s] increases; ``acc`` (n, N) [m/s^2]; ``gyro`` (n,) [rad/s] as it reads, ``level`` times the rate of
    pitch at a roll of that cosine, with ``noise`` of the standard deviation dw [rad/s].
    """
    nowhere = np.zeros(len(t))
    if way == "none":
        return acc, nowhere
    q = centrifugal_arms(layout, level)
    concerned = np.flatnonzero(q)
    mechanical = acc.copy()
    mechanical[:, concerned] += q[concerned] * (gyro[:, None] / level) ** 2
    if way == "mechanical":
        return mechanical, nowhere + 1.0
    filtered = acc.copy()
    frequency = oscillation_frequency(t, acc, gyro, layout)
    oscillates = np.isfinite(frequency)
    if oscillates.any():
        cutoff = math.sqrt(2.0) * float(np.median(frequency[oscillates]))
        for k in concerned:
            filtered[:, k] = zero_phase(t, acc[:, k], cutoff, _ORDER)
    if way == "low-pass":
        return filtered, nowhere
    large = peak_rate(t, gyro, noise) > DECISION * noise
    return np.where(large[:, None], mechanical, filtered), large.astype(float)


def peak_rate(t: Array, gyro: Array, noise: float) -> Array:
    """(n,) rad/s: peak of the oscillation that the gyro shows in the 10 s about each row.

    sqrt(2) times the root of the mean square less that of the noise: single samples would be those of the noise.
    """
    finite = np.isfinite(gyro)
    total = np.concatenate([[0.0], np.cumsum(np.where(finite, gyro, 0.0) ** 2)])
    count = np.concatenate([[0], np.cumsum(finite)])
    begin = np.searchsorted(t, t - 0.5 * LIMITS.oscillation_window)
    end = np.searchsorted(t, t + 0.5 * LIMITS.oscillation_window, side="right")
    mean = (total[end] - total[begin]) / np.maximum(count[end] - count[begin], 1)
    return np.asarray(np.sqrt(2.0 * np.maximum(mean - noise**2, 0.0)))


def differentiated(t: Array, gyro: Array, level: float) -> Array:
    """(n,) rad/s^2: first difference of the rate from the row before, unfiltered, as the paper has it.

    Its noise is sqrt(2) dw / dt, and it is late by half an interval. NaN in the first row.
    """
    acceleration = np.full(len(t), np.nan)
    acceleration[1:] = np.diff(gyro) / (level * np.diff(t))
    return acceleration


def dual(layout: Layout, level: float) -> tuple[Array, Array]:
    """The dual accelerometer: d (N,) with al = d . A, and M (N, N) so that M A is free of the tangential term.

    M = 1 - p d. For the three axes -z, +x, +z the first and last of M A are the same but for their sign, and their
    noise is sqrt(r_1^2 + r_3^2)/|r_3 - r_1| times that of the readings: least with the pivot midway. ``d`` as of
    `inercal.systems.aoa.layout.pair_weights`. The readings are to be free of the centrifugal term before. Raises
    `StudyError` where no two axes are antiparallel or parallel with an arm between them.
    """
    weights = pair_weights(layout, level)
    if weights is None:
        text = "found no two antiparallel or parallel axes with a lever arm between them"
        raise StudyError("sensors", f"{text}, which the dual accelerometer needs")
    return weights, np.eye(len(weights)) - np.outer(tangential_arms(layout, level), weights)


def zero_phase(t: Array, values: Array, cutoff: float, order: int) -> Array:
    """``values`` (n,) at the times ``t`` [s], increasing, after a Butterworth filter forward and backward.

    The gain is 1 / (1 + (f / ``cutoff``)^(2 ``order``)), 1/2 at the ``cutoff`` [Hz], without delay. Missing
    values are bridged by straight lines and are missing again afterwards. The values come back unchanged where the
    cutoff is not below half of the sampling frequency.
    """
    from scipy.signal import butter, sosfiltfilt

    cuts = np.flatnonzero(np.diff(t) > _FORGOTTEN / cutoff) + 1
    if len(cuts):
        parts = zip(np.split(t, cuts), np.split(values, cuts), strict=True)
        return np.concatenate([zero_phase(*part, cutoff, order) for part in parts])
    finite = np.isfinite(values)
    if finite.sum() < 2:
        return values
    step = usual_step(t)
    if 2.0 * cutoff * step >= 1.0:
        return values
    even = bool((np.abs(np.diff(t) - step) < LIMITS.uneven_share * step).all())
    grid = t if even else np.arange(t[0], t[-1] + step, step)
    bridged = np.interp(grid, t[finite], values[finite])
    sections = butter(order, 2.0 * cutoff * step, output="sos")
    padding = min(round(3.0 / (cutoff * step)), len(grid) - 1)
    smooth = sosfiltfilt(sections, bridged, padlen=padding)
    if not even:
        smooth = np.interp(t, grid, smooth)
    return np.where(finite, smooth, np.nan)
