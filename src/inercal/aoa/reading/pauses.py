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

from inercal.aoa.limits import LIMITS
from inercal.arrays import Array
from inercal.records.dwells import Dwell, breaks, static_intervals


def pauses(t: Array, theta: Array, u: Array) -> tuple[Dwell, ...]:
    """Pauses in angles ``theta`` (n,) [rad] of standard uncertainty ``u``, at times ``t`` (n,) [s], increasing.

    Half a window beside a move is left out, and after a move, while the sting rings down, the part of the pause that
    scatters more than twice its median.
    """
    if len(t) < 2 * LIMITS.pause_window_rows:
        return ()
    still, scatter = at_rest(t, theta, u)
    half = _rows(t) // 2
    shortest = max(1, round(LIMITS.shortest_pause / _step(t)))
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
    n = len(t)
    w = _rows(t) if n > 1 and _step(t) > 0.0 else n + 1
    if n < w:
        return np.ones(n, dtype=bool), np.zeros(n)
    # sums over windows of the angle less its overall line, so that they lose no digits
    at = np.arange(n) - 0.5 * (n - 1)
    overall = float(at @ theta / (at @ at)) if n > 1 else 0.0
    x = theta - theta.mean() - overall * at
    s0, s1, s2 = _sums(x, w), _sums(x * at, w), _sums(x * x, w)
    del x
    middle = at[: n - w + 1] + 0.5 * (w - 1)
    spread = w * (w * w - 1.0) / 12.0
    slope = (s1 - middle * s0) / spread
    scatter = np.sqrt(np.maximum(s2 - s0**2 / w - slope**2 * spread, 0.0) / (w - 2))
    reach = float(np.ptp(s0 / w + overall * middle))
    del at, s0, s1, s2, middle  # of millions of rows these are most of the memory
    centred = np.clip(np.arange(n) - w // 2, 0, n - w)
    change, scatter = np.abs(slope + overall)[centred] * w, scatter[centred]
    buffet = np.clip(LIMITS.resting_share * reach, LIMITS.least_resting_scatter, LIMITS.most_resting_scatter)
    allowed = np.maximum(LIMITS.resting_sigmas * u, buffet)
    still = (change < LIMITS.resting_sigmas * np.hypot(scatter, u)) & (scatter < 2.0 * allowed)
    # a buffet comes and goes: its size is that over all of a quiet stretch
    starts = np.flatnonzero(np.diff(still, prepend=not still[0]))
    power, most = (np.add.reduceat(np.square(each), starts) for each in (scatter, allowed))
    return still & np.repeat(power < most, np.diff(starts, append=n)), scatter


def _sums(x: Array, w: int) -> Array:
    """Sums (n - w + 1,) of ``x`` (n,) over windows of ``w``."""
    sums = np.concatenate([[0.0], np.cumsum(x)])
    return np.asarray(sums[w:] - sums[:-w])


def _step(t: Array) -> float:
    """Usual time [s] between rows."""
    return float(np.median(np.diff(t)))


def _rows(t: Array) -> int:
    """Rows of a window."""
    return max(LIMITS.pause_window_rows, round(LIMITS.pause_window / _step(t)))
