"""Rows that go on in time, gaps of time, and the step of an even grid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.systems.aoa.limits import LIMITS

_PART = 100_000
"""Rows that are looked at at a time."""


def later(t: Array, last: float = -math.inf, where: object = "t") -> NDArray[np.int64]:
    """Rows of ``t`` (n,) [s] that are later than all before them and than ``last``.

    Raises `RecordError` where so many successive rows are not later that the clock was set back.
    """
    if len(t) and t[0] > last and _goes_on(t):
        return np.arange(len(t))
    before = np.maximum.accumulate(np.append(last, np.where(np.isnan(t), -np.inf, t)))
    taken = np.flatnonzero(t > before[:-1])
    left = np.diff(np.concatenate([[-1], taken, [len(t)]])) - 1
    if left.size and left.max() >= LIMITS.backward_rows:
        row = int(np.concatenate([[-1], taken])[int(np.argmax(left))]) + 1
        raise RecordError(
            where,
            f"t: {int(left.max())} rows in a row from row {row + 1} on are not later than {before[row]:.10g} s, the "
            f"first at {t[row]:.10g} s, expected time to increase",
        )
    return taken


def in_time(t: Array, where: object = "t") -> slice | NDArray[np.int64]:
    """The rows of `later`, a slice where these are all: what it takes out of arrays are no copies then."""
    return slice(None) if _goes_on(t) else later(t, where=where)


def _goes_on(t: Array) -> bool:
    """True where each stamp of ``t`` (n,) is later than that before it; looked at in parts, which takes no memory."""
    parts = (t[k : k + _PART + 1] for k in range(0, len(t), _PART))
    return bool(np.isfinite(t[:1]).all()) and all(bool((np.diff(part) > 0.0).all()) for part in parts)


def set_back(where: object, late: int, last: float, t: float) -> RecordError:
    """The error of a stream of which ``late`` rows in a row, the last at ``t`` [s], are not later than ``last`` [s]."""
    return RecordError(
        where,
        f"t: {late} rows in a row are not later than {last:.10g} s, the last at {t:.10g} s, expected time to increase",
    )


def shortened(t: Array, longest: float) -> Array:
    """Times ``t`` (n,) [s], increasing, with gaps above ``longest`` [s] shortened to it: a clock that jumped, or runs
    hours apart, must not make hours of an even grid."""
    excess = np.maximum(np.diff(t, prepend=t[:1]) - longest, 0.0)
    return t - np.cumsum(excess) if excess.any() else t


def usual_step(t: Array) -> float:
    """Median interval [s] of ``t`` (n,); where rows come in bursts it is at least a sixteenth of the mean one, so that
    an even grid has no more than 16 n points."""
    return max(float(np.median(np.diff(t))), float(t[-1] - t[0]) / len(t) / 16.0)


def settled(t: Array) -> NDArray[np.bool_]:
    """Rows (n,) of ``t`` (n,) [s] after the time in which a filter settles; all of a shorter record."""
    late = t - t[0] >= LIMITS.settling_time
    return late if late.any() else np.ones(len(t), dtype=bool)
