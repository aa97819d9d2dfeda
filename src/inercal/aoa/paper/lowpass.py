"""Low-pass filters without delay, for whole recordings: they look ahead, and they distort the motion."""

from __future__ import annotations

import numpy as np

from inercal.aoa.limits import LIMITS
from inercal.aoa.reading.clock import usual_step
from inercal.arrays import Array

_FORGOTTEN = 10.0
"""Periods of the cutoff after which the filter has forgotten a value: parts further apart are filtered apart."""


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
