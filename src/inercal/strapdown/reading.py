"""A record as samples of a strapdown unit: SI, both triads on one clock of even steps, without gaps."""

from __future__ import annotations

import numpy as np

from inercal.arrays import Array
from inercal.errors import RecordError
from inercal.records.column import Triad
from inercal.records.record import Record
from inercal.strapdown.limits import LIMITS
from inercal.strapdown.samples import Samples
from inercal.units import RAW


def samples_of(record: Record) -> Samples:
    """The samples of ``gyro_x..z`` and ``acc_x..z``, rates or increments, as the record has them.

    Raises `RecordError` where a triad is missing or in raw units, the triads have different clocks, time does not go in
    even steps, or a value is no number: a solution is carried through every sample.
    """
    gyro, acc = record.triad("gyro"), record.triad("acc")
    where = gyro.source.path
    for triad in (gyro, acc):
        if triad.unit.dimension in RAW:
            raise RecordError(
                where,
                f"{triad.sensor} is in {triad.unit.symbol}, expected physical units, such as m/s^2 and deg/s: give the "
                "nominal scale in the map, as scale",
            )
    if len(gyro.t) != len(acc.t) or not np.allclose(gyro.t, acc.t, rtol=0.0, atol=0.1 / _rate(gyro, where)):
        raise RecordError(
            where, "acc has other time stamps than gyro, expected one row for both at each time"
        )
    step = np.diff(gyro.t)
    ts = float((gyro.t[-1] - gyro.t[0]) / (len(gyro.t) - 1))
    uneven = np.flatnonzero(np.abs(step - np.median(step)) > LIMITS.uneven * ts)
    if uneven.size:
        k = int(uneven[0])
        raise RecordError(
            where,
            f"t: a step of {step[k]:.4g} s after row {k + 1} where {np.median(step):.4g} s is usual, expected samples "
            "without gaps; begin and end cut a record, and [time] ignore = true does without stamps",
        )
    values = _si(gyro), _si(acc)
    for triad, each in zip((gyro, acc), values, strict=True):
        if (lost := np.flatnonzero(~np.isfinite(each).all(axis=1))).size:
            raise RecordError(
                where, f"{triad.sensor}: row {lost[0] + 1} holds no number, expected one in every row"
            )
    return Samples(*values, ts)


def _rate(triad: Triad, where: str) -> float:
    """Rate of a triad [Hz]; refused where time does not increase."""
    if not np.isfinite(triad.rate):
        raise RecordError(
            where, f"found {len(triad.t)} samples without increasing time stamps, expected a recording"
        )
    return triad.rate


def _si(triad: Triad) -> Array:
    """Values (n, 3) in SI."""
    return np.ascontiguousarray(triad.values * triad.unit.factor + triad.unit.zero)
