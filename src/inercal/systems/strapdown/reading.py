"""A record as samples of a strapdown unit: SI, both triads on one clock of even steps, without gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted, places
from inercal.foundation.records.record import Record
from inercal.foundation.units import RAW
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.samples import Samples


def evened(record: Record) -> Record:
    """The record, with stamps on the even steps of their neighbours where single ones were set aside, or are off them.

    A sample whose stamp is wrong stands where it was taken: between those before and after it.
    """
    columns, findings = dict(record.columns), list(record.findings)
    for t in {id(column.t): column.t for column in columns.values()}.values():
        even, off = _even(t)
        for name in (name for name, column in columns.items() if column.t is t):
            columns[name] = replace(columns[name], t=even)
        if off.size:
            text = (
                f"t: {counted(off.size, 'stamp')} off the even steps of those beside, which are taken instead"
            )
            findings.append(Finding("outlying_time", text, places("row", off + 1)))
    return replace(record, columns=columns, findings=tuple(findings))


def _even(t: Array) -> tuple[Array, NDArray[np.int64]]:
    """Stamps (n,) [s] with the missing ones, and single ones off the steps, as those beside say; rows of the latter."""
    known = np.flatnonzero(np.isfinite(t))
    if len(known) < LIMITS.fewest_stamps:
        return t, known[:0]
    usual = float(np.median(np.diff(t[known])))
    if not usual > 0.0 or (len(known) == len(t) and not _uneven(np.diff(t), usual).any()):
        return t, known[:0]
    rows = np.arange(len(t))
    even = np.interp(rows, known, t[known])
    even += usual * (np.minimum(rows - known[0], 0) + np.maximum(rows - known[-1], 0))
    off = []
    for k in np.flatnonzero(_uneven(np.diff(even), usual)).tolist():
        for row in (k, k + 1):
            before, after = (
                even[row + step] - step * usual if 0 <= row + step < len(t) else None for step in (-1, 1)
            )
            beside = [each for each in (before, after) if each is not None]
            apart = abs(beside[0] - beside[-1])
            # off both steps, between two that are not; at an end off its one step
            if apart <= LIMITS.uneven * usual and all(
                abs(even[row] - each) > LIMITS.uneven * usual for each in beside
            ):
                even[row] = sum(beside) / len(beside)
                off.append(row)
    return even, np.array(off, dtype=np.int64)


def _uneven(step: Array, usual: float) -> NDArray[np.bool_]:
    """Steps (n,) [s] that differ too much from the ``usual`` one."""
    return np.asarray(np.abs(step - usual) > LIMITS.uneven * usual)


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
