"""Clocks of two triads that tell one motion: whether the accelerometers fall behind the gyro over a record.

What is fixed in space turns by -w x f on axes that turn at the rate w, so that the change of specific force and the
gyro tell the same motion. In each of some blocks of a record the lag of the one behind the other is that of the largest
cross-correlation of their sizes, and then that of least squares, with the rate brought back by the lags found so far.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from inercal.foundation.arrays import Array
from inercal.foundation.inference.limits import LIMITS


class LagDrift(NamedTuple):
    """By how much [s] accelerometers fall behind a gyro over the ``duration`` [s] of a record."""

    drift: float
    duration: float


def lag_drift(t: Array, force: Array, rate: Array) -> LagDrift | None:
    """The drift of the lag between two triads on one clock, None where none shows.

    Parameters
    ----------
    t : (n,)
        Times [s] of the rows, increasing.
    force, rate : (n, 3)
        Specific force and rate [rad/s] on the same axes, roughly calibrated.
    """
    kept = np.isfinite(t) & np.isfinite(force).all(axis=1) & np.isfinite(rate).all(axis=1)
    if kept.sum() < LIMITS.clock_blocks * 20 or np.any(np.diff(t[kept]) <= 0.0):
        return None
    t, force, rate = t[kept], force[kept], rate[kept]
    dt = float(np.median(np.diff(t)))
    even = np.arange(t[0], t[-1], dt)
    if len(even) > 4 * len(t):  # mostly gaps
        return None
    size = 2 * max(1, round(LIMITS.clock_window / dt)) + 1
    f, w = (
        uniform_filter1d(np.stack([np.interp(even, t, x) for x in y.T], axis=1), size, axis=0)
        for y in (force, rate)
    )
    change = np.gradient(f, dt, axis=0)
    parts = np.array_split(np.arange(len(even)), LIMITS.clock_blocks)
    at = np.array([even[part].mean() for part in parts])
    lags, told = _by_size(change, w, parts, dt)
    for _ in range(3):
        if told.sum() < LIMITS.fewest_clock_blocks:
            return None
        line = np.polyfit(at[told], lags[told], 1)
        back = np.polyval(line, even)
        brought = np.stack([np.interp(even - back, even, x) for x in w.T], axis=1)
        left, by_lag = change + np.cross(brought, f), np.cross(np.gradient(brought, dt, axis=0), f)
        found = [_step(change[part], left[part], by_lag[part]) for part in parts]
        told = np.array([step is not None for step in found])
        reach = LIMITS.clock_reach / 4.0
        lags = np.polyval(line, at) + np.clip([step or 0.0 for step in found], -reach, reach)
    return _drift(at[told], lags[told], float(even[-1] - even[0]), dt)


def _by_size(
    change: Array, rate: Array, parts: Sequence[NDArray[np.int64]], dt: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Lags (b,) of the blocks by the sizes of both alone, each sought about the one before, and which are told."""
    one, other = np.linalg.norm(change, axis=1)[:, None], np.linalg.norm(rate, axis=1)[:, None]
    lags, told, here = np.zeros(len(parts)), np.zeros(len(parts), dtype=bool), 0
    for k, part in enumerate(parts):
        from_ = np.clip(part - here, 0, len(other) - 1)
        lag = _lag(one[part], other[from_], LIMITS.clock_reach, dt)
        if lag is not None:
            here += round(lag / dt)
            lags[k], told[k] = here * dt, True
    return lags, told


def _lag(one: Array, other: Array, reach: float, dt: float) -> float | None:
    """Lag [s] of ``one`` (n, k) behind ``other`` within a ``reach`` [s]; None where they are hardly alike."""
    k = min(max(round(reach / dt), 2), len(one) // 2 - 1)
    a, b = one - one.mean(axis=0), other - other.mean(axis=0)
    n = 1 << (2 * len(a) - 1).bit_length()
    both = np.fft.rfft(a, n, axis=0) * np.conj(np.fft.rfft(b, n, axis=0))
    c = np.fft.irfft(np.sum(both, axis=1), n)
    c = np.concatenate([c[-k:], c[: k + 1]])
    j = int(np.clip(np.argmax(c), 1, len(c) - 2))
    size = np.sqrt(np.sum(a * a) * np.sum(b * b))
    if not size or c[j] < LIMITS.clock_likeness * size:
        return None
    bend = c[j - 1] - 2.0 * c[j] + c[j + 1]
    part = 0.5 * (c[j - 1] - c[j + 1]) / bend if bend else 0.0
    return float((j - k + part) * dt)


def _step(change: Array, left: Array, by_lag: Array) -> float | None:
    """Step [s] of a lag by least squares: ``left`` (n, 3) is what the rate leaves of the ``change`` of specific force,
    ``by_lag`` how it grows with the lag. None where both triads are hardly alike."""
    size = float(np.sum(by_lag * by_lag))
    expected = change - left
    alike = np.sum(change * expected) / max(float(np.linalg.norm(change) * np.linalg.norm(expected)), 1e-300)
    return float(np.sum(left * by_lag) / size) if size and alike > LIMITS.clock_likeness else None


def _drift(at: Array, lags: Array, duration: float, dt: float) -> LagDrift | None:
    """The drift over a record by the lags (b,) of its blocks, if it is no chance."""
    from scipy.special import stdtr

    if len(lags) < LIMITS.fewest_clock_blocks:
        return None
    x = at - at.mean()
    slope = float(x @ lags / (x @ x))
    left = lags - lags.mean() - slope * x
    scatter = np.sqrt(max(float(left @ left) / (len(lags) - 2), (0.02 * dt) ** 2))
    chance = 2.0 * stdtr(len(lags) - 2, -abs(slope) * np.sqrt(x @ x) / scatter)
    drift = slope * duration
    if abs(drift) < LIMITS.clock_drift * dt or chance > LIMITS.clock_risk:
        return None
    return LagDrift(drift, duration)
