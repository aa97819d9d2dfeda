"""Static intervals of a recording, in which the instrument was held still.

A calibration finds them by the variance in a window, against a multiple of that of an initial static period (Tedaldi,
Pretto, Menegatti, ICRA 2014, section IV-A). `quiet` finds them coarsely, of any recording: to look at, not to calibrate
by.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.records.column import Column, counted_rows
from inercal.foundation.records.limits import LIMITS
from inercal.foundation.records.record import Record


def quiet(record: Record) -> tuple[tuple[float, float], ...]:
    """Stretches (begin, end) [s] of one position of a table; without positions those in which all accelerometers, gyros
    and angles of joints are about as calm as they ever are.

    Told by the variance in windows of about a second one after the other, which also are how well the ends are known;
    none for a recording of a few windows, without times, or about as lively throughout.
    """
    if "position" in record.columns and not counted_rows(record.columns):
        return _positions(record.columns["position"])
    sensed = [each for each in record.columns.values() if each.sensor in ("acc", "gyro")]
    sensed += [each for each in record.columns.values() if each.name[0] == "a" and each.name[1:].isdigit()]
    joints = [each for each in record.columns.values() if each.sensor in ("th", "phi1", "phi2", "phi3")]
    if not sensed or counted_rows(record.columns):
        return ()
    t = sensed[0].t
    size = window_samples((len(t) - 1) / float(t[-1] - t[0])) if len(t) > 1 and t[-1] > t[0] else len(t) + 1
    count = len(t) // size
    if count < LIMITS.fewest_windows or any(
        each.t is not t and len(each.t) != len(t) for each in (*sensed, *joints)
    ):
        return ()
    still = np.ones(count, dtype=bool)
    lively = False
    for each in sensed:
        variance = _variances(each, size, count)
        known = variance[np.isfinite(variance)]
        if not len(known):
            continue
        calm, top = np.quantile(known, [0.05, 0.95])
        lively = lively or top > LIMITS.lively_ratio * calm
        still &= variance <= LIMITS.calm_ratio * max(float(calm), np.finfo(float).tiny)
    if not lively:
        return ()
    for each in joints:  # at a steady rate about the vertical no sensor changes
        variance = _variances(each, size, count)
        known = variance[np.isfinite(variance)]
        calm = float(np.quantile(known, 0.05)) if len(known) else 0.0
        still &= variance <= max(LIMITS.calm_ratio * calm, 0.25 * _smallest_step(each) ** 2)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    return tuple(
        (float(t[begin * size]), float(t[min(end * size, len(t)) - 1]))
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    )


def _smallest_step(column: Column) -> float:
    """The least change from row to row that is none of zero: a count of an encoder, which may flicker."""
    steps = np.abs(np.diff(column.values))
    return float(np.min(steps, initial=np.inf, where=steps > 0.0)) if (steps > 0.0).any() else 0.0


def _positions(column: Column) -> tuple[tuple[float, float], ...]:
    """Stretches of several rows of one number."""
    cuts = np.flatnonzero(np.diff(column.values) != 0.0) + 1
    ends = zip([0, *cuts.tolist()], [*cuts.tolist(), len(column.values)], strict=True)
    return tuple((float(column.t[begin]), float(column.t[end - 1])) for begin, end in ends if end - begin > 1)


def _variances(column: Column, size: int, count: int) -> Array:
    """Variance (count,) in each window; NaN where a value is."""
    windows = np.asarray(column.values[: count * size], dtype=float).reshape(count, size)
    return np.asarray(windows.var(axis=1))


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
