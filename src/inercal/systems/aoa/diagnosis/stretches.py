"""Stretches of a recording by which the choices are made: the liveliest ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import remembered
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.clock import in_time, later
from inercal.systems.aoa.reading.recording import Recording


@remembered
def liveliest(recording: Recording) -> tuple[NDArray[np.int64], ...]:
    """Rows of the stretches in which readings differ most from one row to the next, the liveliest first."""
    taken, t = later(recording.t), recording.t[in_time(recording.t)]
    number = np.floor((t - t[:1]) / LIMITS.snap_time)
    stretches = [
        rows for rows in np.split(taken, np.flatnonzero(np.diff(number)) + 1) if _enough(recording, rows)
    ]
    sizes = [_restless(recording, rows) for rows in stretches]
    return tuple(stretches[k].copy() for k in np.argsort(sizes)[::-1][: LIMITS.snap_stretches])


def _enough(recording: Recording, rows: NDArray[np.int64]) -> bool:
    """True for a stretch that goes on for twice the time in which a filter settles, in rows near enough for spectra."""
    t = recording.t[rows]
    if len(rows) < 4 or not np.ptp(t) > 2.0 * LIMITS.settling_time:
        return False
    return bool(4.0 * np.median(np.diff(t)) <= LIMITS.line_segment)


def _restless(recording: Recording, rows: NDArray[np.int64]) -> float:
    """Root mean square of the second differences of all readings of a stretch, without single wild ones."""
    second = np.abs(np.diff(np.column_stack([recording.acc[rows], recording.gyro[rows]]), 2, axis=0))
    finite = second[np.isfinite(second)]
    return float(np.sqrt(np.mean(np.minimum(finite, np.quantile(finite, 0.99)) ** 2))) if finite.size else 0.0


def part_of(recording: Recording, rows: NDArray[np.int64]) -> Recording:
    """A stretch of a recording."""
    columns = {name: getattr(recording, name)[rows] for name in ("t", "acc", "gyro", "turns", "zero_angle")}
    return replace(recording, **columns, point=None, trigger=None, reference=None, masked=None)
