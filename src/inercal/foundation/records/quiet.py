"""Stretches of a recording in which nothing moves, found coarsely: to look at, not to calibrate by."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.column import Column, counted_rows
from inercal.foundation.records.dwells import window_samples
from inercal.foundation.records.record import Record

_CALM = 4.0
"""Variance of a window, over that of the calmest twentieth, up to which it is quiet."""

_LIVELY = 20.0
"""Variance of the liveliest twentieth over that of the calmest from which a recording has rests and turns."""

_FEWEST = 20
"""Windows of a recording whose rests are looked for."""


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
    if count < _FEWEST or any(each.t is not t and len(each.t) != len(t) for each in (*sensed, *joints)):
        return ()
    still = np.ones(count, dtype=bool)
    lively = False
    for each in sensed:
        variance = _variances(each, size, count)
        known = variance[np.isfinite(variance)]
        if not len(known):
            continue
        calm, top = np.quantile(known, [0.05, 0.95])
        lively = lively or top > _LIVELY * calm
        still &= variance <= _CALM * max(float(calm), np.finfo(float).tiny)
    if not lively:
        return ()
    for each in joints:  # at a steady rate about the vertical no sensor changes
        variance = _variances(each, size, count)
        known = variance[np.isfinite(variance)]
        calm = float(np.quantile(known, 0.05)) if len(known) else 0.0
        still &= variance <= max(_CALM * calm, 0.25 * _smallest_step(each) ** 2)
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
