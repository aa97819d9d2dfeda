"""Pauses of a model, in which its angle stands still but for noise and buffet.

In a window of half a second the angle is a line and its scatter. The model rests where the line changes, over the
window, by less than three times that scatter and the angle's own uncertainty together: oscillations slower than some
2 Hz are motion, and a creep within the uncertainty counts as rest.

Faster oscillations are the buffet of a model at rest while their root mean square is at most a twentieth of the range
of the angle (no less than 0.1 deg, no more than 0.5 deg), or three times the uncertainty. So one that is forced, as a
sine, a chirp or a buffet of some tenths of a degree without moves, is no rest, whatever its frequency.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.records.dwells import Dwell, breaks, static_intervals
from inercal.systems.aoa.limits import LIMITS

_PART = 100_000
"""Rows that are looked at at a time."""


def pauses(t: Array, theta: Array, u: Array) -> tuple[Dwell, ...]:
    """Pauses in angles ``theta`` (n,) [rad] of standard uncertainty ``u``, at times ``t`` (n,) [s], increasing.

    Half a window beside a move is left out, and after a move, while the sting rings down, the part of the pause that
    scatters more than twice its median.
    """
    if len(t) < 2 * LIMITS.pause_window_rows:
        return ()
    step = _step(t)
    still, scatter = _at_rest(theta, u, step)
    half, shortest = _rows(step) // 2, max(1, round(LIMITS.shortest_pause / step))
    cuts = breaks(t, LIMITS.pause_window)
    bounds = {0, len(t), *cuts.tolist()}
    dwells = []
    for run in static_intervals(still, cuts, shortest):
        start = run.start + (0 if run.start in bounds else half)
        stop = run.stop - (0 if run.stop in bounds else half)
        calm = scatter[start:stop] <= 2.0 * np.median(scatter[start:stop]) if stop > start else np.zeros(0)
        if run.start not in bounds:
            start += int(np.argmax(calm)) if len(calm) else 0
        if stop - start >= shortest:
            dwells.append(Dwell(start, stop))
    return tuple(dwells)


def at_rest(t: Array, theta: Array, u: Array) -> tuple[NDArray[np.bool_], Array]:
    """Mask (n,) of the rows in which the model rests, and scatter (n,) [rad] of the angle about its line there.

    Rows near the ends are judged by the first and last whole window. A record shorter than a window rests, and so does
    one in which most rows have the time of the row before.
    """
    return _at_rest(theta, u, _step(t) if len(t) > 1 else 0.0)


def _at_rest(theta: Array, u: Array, step: float) -> tuple[NDArray[np.bool_], Array]:
    """As `at_rest`, of rows that are ``step`` [s] apart."""
    n = len(theta)
    w = _rows(step) if step > 0.0 else n + 1
    if n < w:
        return np.ones(n, dtype=bool), np.zeros(n)
    # the angle less its overall line, so that sums over windows lose no digits; some rows at a time, for those of
    # millions would be most of the memory
    middle, mean = 0.5 * (n - 1), float(theta.mean())
    parts = [slice(k, min(k + _PART, n)) for k in range(0, n, _PART)]
    moment = sum(float((np.arange(each.start, each.stop) - middle) @ theta[each]) for each in parts)
    overall = moment / (n * (n * n - 1.0) / 12.0)
    scatter, still, low, high = np.empty(n), np.empty(n, dtype=bool), np.inf, -np.inf
    for first in range(0, n - w + 1, _PART):
        last = min(first + _PART, n - w + 1)
        at = np.arange(first, last + w - 1) - middle
        slope, spread, means = _lines(theta[first : last + w - 1] - mean - overall * at, w)
        means += overall * (at[: last - first] + 0.5 * (w - 1))
        low, high = min(low, float(means.min())), max(high, float(means.max()))
        judged = slice(first + w // 2 if first else 0, last + w // 2 if last < n - w + 1 else n)
        centred = np.clip(np.arange(judged.start, judged.stop) - w // 2 - first, 0, last - first - 1)
        scatter[judged] = spread[centred]
        change = np.abs(slope + overall)[centred] * w
        still[judged] = change < LIMITS.resting_sigmas * np.hypot(scatter[judged], u[judged])
    share = LIMITS.resting_share * (high - low)
    buffet = float(np.clip(share, LIMITS.least_resting_scatter, LIMITS.most_resting_scatter))
    for part in parts:
        still[part] &= scatter[part] < 2.0 * _allowed(u[part], buffet)
    # a buffet comes and goes: its size is that over all of a quiet stretch
    starts = np.flatnonzero(np.diff(still, prepend=not still[0]))
    allowed = _allowed(u, buffet)
    most = np.add.reduceat(np.square(allowed, out=allowed), starts)
    power = np.add.reduceat(np.square(scatter, out=allowed), starts)
    return still & np.repeat(power < most, np.diff(starts, append=n)), scatter


def _lines(x: Array, w: int) -> tuple[Array, Array, Array]:
    """Slopes a row, scatter and means (n - w + 1,) of lines through windows of ``w`` of ``x`` (n,)."""
    at = np.arange(len(x)) - 0.5 * (len(x) - 1)
    s0, s1, s2 = _sums(x, w), _sums(x * at, w), _sums(x * x, w)
    spread = w * (w * w - 1.0) / 12.0
    slope = (s1 - (at[: len(s0)] + 0.5 * (w - 1)) * s0) / spread
    scatter = np.sqrt(np.maximum(s2 - s0**2 / w - slope**2 * spread, 0.0) / (w - 2))
    return slope, scatter, s0 / w


def _allowed(u: Array, buffet: float) -> Array:
    """The largest scatter (n,) of a model at rest."""
    allowed = LIMITS.resting_sigmas * u
    return np.maximum(allowed, buffet, out=allowed)


def _sums(x: Array, w: int) -> Array:
    """Sums (n - w + 1,) of ``x`` (n,) over windows of ``w``."""
    sums = np.concatenate([[0.0], np.cumsum(x)])
    return np.asarray(sums[w:] - sums[:-w])


def _step(t: Array) -> float:
    """Usual time [s] between rows."""
    return float(np.median(np.diff(t)))


def _rows(step: float) -> int:
    """Rows of a window, ``step`` [s] apart."""
    return max(LIMITS.pause_window_rows, round(LIMITS.pause_window / step))
