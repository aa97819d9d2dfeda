"""Freeing the readings of a moving model from its lever-arm terms, as Tan et al. 2021 do; every axis by its geometry.

With q and p the arms of `inercal.systems.aoa.layout`, w the gyro's rate and al the angular acceleration, the axis would
read A - (-q w^2 + p al) at rest. `inercal.systems.aoa.paper.residuals` has the error that each way leaves in closed
form.

The low pass has no delay: it is for whole recordings, looks ahead, and distorts the motion.
"""

from __future__ import annotations

import math

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.systems.aoa.estimators import Centrifugal
from inercal.systems.aoa.layout import Layout, centrifugal_arms, pair_weights, tangential_arms
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.paper.frequency import oscillation_frequency
from inercal.systems.aoa.paper.residuals import DECISION
from inercal.systems.aoa.reading.clock import usual_step

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
