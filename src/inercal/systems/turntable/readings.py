"""A record of a test on a table, as one reading for each position: rows as they are, or dwells averaged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.by_angle import CHANNELS
from inercal.foundation.records.places import counted, places
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Basis, Formula, conditions_of, studied
from inercal.foundation.units import Unit
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import FRAME
from inercal.systems.turntable.settings import TurntableSettings


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of a test.

    Attributes
    ----------
    angles : (n, joints) rad, commanded or measured, in the order of the chain's joints
    channels : (c,) names
    unit : Unit
        Of the record.
    y : (n, c) readings, means over the dwells; in the SI unit of ``unit`` (count, V, A, N*m and 1 stay what they are)
    samples : (n,) rows behind each reading
    u_mean : (c,) standard deviation of a reading that the scatter within the dwells explains if it is white,
        in the unit of y; NaN where a reading is a single row
    times : (n,) middle of each dwell [s], or the number of the reading where stamps are missing or run backward
    slopes : (n, c) change of the output per second within each dwell; NaN where there is none
    findings : about the record
    """

    angles: Array
    channels: tuple[str, ...]
    unit: Unit
    y: Array
    samples: NDArray[np.int64]
    u_mean: Array
    times: Array
    slopes: Array
    findings: tuple[Finding, ...] = ()


def readings(record: Record, joints: tuple[str, ...], kind: str, by_row: bool = False) -> Readings:
    """Find the positions of a record and average over them.

    Rows belong to one position while ``position`` keeps its number, or, where there is no such column, while the
    angles stand still.

    Parameters
    ----------
    record : Record
        Angles of the ``joints``, and any channels of an instrument of that ``kind``.
    by_row : bool
        Without a column ``position`` each row is a position, however near its angles are to those of the one before.

    Raises
    ------
    RecordError
        No such channel, channels in different units, angles that are missing or change within a position, or a
        position without a number.
    """
    where = record.sources[0].path if record.sources else "record"
    channels = tuple(name for name in CHANNELS[kind] if name in record)
    if not channels:
        raise RecordError(
            where,
            f"found {', '.join(record.columns)}, expected one of {', '.join(CHANNELS[kind])} of the {kind}",
        )
    for name in ("phi1", "phi2", "phi3"):
        if name in record and name not in joints:
            raise RecordError(
                where, f"found {name}, expected {', '.join(joints)} alone: the study's table has no such axis"
            )
    if "rate" in record:
        raise RecordError(
            where, "found the channel rate, that of a rate test, expected [rate_test] in the study"
        )
    columns = [record[name] for name in channels]
    for column in columns:
        if column.unit != columns[0].unit or len(column.values) != len(columns[0].values):
            raise RecordError(
                where,
                f"{column.name} has another unit or length than {columns[0].name}, expected one for all channels",
            )
    angles = np.stack([record[name].si() for name in joints], axis=-1)
    if len(angles) != len(columns[0].values):
        raise RecordError(where, f"{joints[0]} and {channels[0]} have different lengths, expected one table")
    values = np.stack([column.values for column in columns], axis=-1) * columns[0].unit.factor
    short: list[NDArray[np.int64]] = []
    if "position" in record:
        groups = _by_number(record, angles, where)
    elif by_row:
        groups = list(np.flatnonzero(np.isfinite(angles).all(axis=1))[:, None])
    else:
        groups, short = _by_angle(angles)
    if not groups:
        raise RecordError(where, "found no rows with angles, expected one or more for each position")
    means = _averaged(angles, values, columns[0].t, groups, channels, columns[0].unit, where)
    if short:
        text = (
            f"{counted(len(short), 'stay')} of less than half the usual length: the readings there are left out; a "
            "column position that numbers the stays keeps them"
        )
        starts = [int(rows[0]) + 1 for rows in short]
        means = replace(
            means, findings=(*means.findings, Finding("poor_section", text, places("row", starts), ()))
        )
    nowhere = np.flatnonzero(~np.isfinite(_places(record, angles)) & np.isfinite(values).any(axis=1)) + 1
    if not len(nowhere):
        return means
    text = f"{counted(len(nowhere), 'row')} without an angle or a position number: the readings there are left out"
    return replace(means, findings=(*means.findings, Finding("nan", text, places("row", nowhere))))


def _places(record: Record, angles: Array) -> Array:
    """A number (n,) for each row that says where it is; NaN where it does not."""
    place = angles.sum(axis=1)
    return np.asarray(place + record["position"].values if "position" in record else place)


def _by_number(record: Record, angles: Array, where: str) -> list[NDArray[np.int64]]:
    """Rows of each stretch of one position number."""
    number = record["position"].values
    numbered = np.flatnonzero(np.isfinite(number) & np.isfinite(angles).all(axis=1))
    parts = _stretches(numbered, np.diff(number[numbered]) != 0.0)
    for part in parts:
        if np.abs(apart(angles[part], angles[part[0]])).max() > LIMITS.position_angle:
            raise RecordError(
                where,
                f"the angles change within position {number[part[0]]:g}, expected one attitude for each number",
            )
    return parts


def _by_angle(angles: Array) -> tuple[list[NDArray[np.int64]], list[NDArray[np.int64]]]:
    """Rows of each stretch of angles near those of its first row; short ones, where others are long, are motion.

    Those among the short ones that do not move come second. The usual length is that of the stretch in which the middle
    row stands when stretches are sorted by length: a slow turn makes many short ones, but of few rows.
    """
    finite = np.flatnonzero(np.isfinite(angles).all(axis=1))
    still = angles[finite]
    parts, start = [], 0
    while start < len(finite):
        stop = _departure(still, start)
        parts.append(finite[start:stop])
        start = stop
    if not parts:
        return [], []
    lengths = np.sort([len(part) for part in parts])
    usual = lengths[np.searchsorted(np.cumsum(lengths), 0.5 * len(finite))]
    long = [part for part in parts if len(part) >= LIMITS.stay_length * usual]
    return long, [part for part in parts if len(part) < LIMITS.stay_length * usual and _at_rest(angles[part])]


def _at_rest(angles: Array) -> bool:
    """True if most of three rows or more stand still.

    Rows of a turn fill the whole angle of a position, so that their median lies a quarter of it from the middle one.
    """
    away = np.abs(apart(angles, angles[len(angles) // 2]))
    return len(angles) > 2 and bool(np.median(away, axis=0).max() < 0.15 * LIMITS.position_angle)


def _departure(angles: Array, start: int) -> int:
    """First row after ``start`` that is not in its position."""
    stop, size = start, 64
    while stop < len(angles):
        away = np.abs(apart(angles[stop : stop + size], angles[start])).max(axis=1) > LIMITS.position_angle
        if away.any():
            return stop + int(np.argmax(away))
        stop, size = stop + size, 4 * size
    return len(angles)


def _stretches(rows: NDArray[np.int64], breaks: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Rows cut where there is a break."""
    return np.split(rows, np.flatnonzero(breaks) + 1) if len(rows) else []


def apart(a: Array, b: Array) -> Array:
    """Difference of angles, within ±pi."""
    return np.asarray(np.remainder(a - b + np.pi, 2.0 * np.pi) - np.pi)


def _averaged(
    angles: Array,
    values: Array,
    t: Array,
    groups: list[NDArray[np.int64]],
    channels: tuple[str, ...],
    unit: Unit,
    where: str,
) -> Readings:
    """Means over the groups of rows; numbers that are missing do not count."""
    y = np.empty((len(groups), values.shape[1]))
    scatter, freedom = np.zeros(values.shape[1]), np.zeros(values.shape[1])
    times, slopes = np.empty(len(groups)), np.full(y.shape, np.nan)
    missing = 0
    for k, rows in enumerate(groups):
        finite = np.isfinite(values[rows])
        count = finite.sum(axis=0)
        if not count.all():
            channel = channels[int(np.argmin(count))]
            raise RecordError(
                where, f"{channel} has no number at position {k + 1} of {len(groups)}, expected one for each"
            )
        missing += int((~finite).sum())
        y[k] = np.where(finite, values[rows], 0.0).sum(axis=0) / count
        times[k] = t[rows].mean()
        away = t[rows] - times[k]
        spread = away @ away  # 0.0 also of times so near each other that their squares vanish
        if len(rows) > 2 and finite.all() and spread > 0.0:
            slopes[k] = away @ values[rows] / spread
        scatter += np.square(np.where(finite, values[rows] - y[k], 0.0)).sum(axis=0)
        freedom += count - 1
    samples = np.array([len(rows) for rows in groups])
    with np.errstate(divide="ignore", invalid="ignore"):
        u_mean = np.sqrt(scatter / freedom / np.mean(samples))
    findings = []
    if missing:
        text = f"{counted(missing, 'value')} within the dwells are no numbers: the means are over the others"
        findings.append(Finding("nan", text))
    still = [angles[rows[0]] + apart(angles[rows], angles[rows[0]]).mean(axis=0) for rows in groups]
    if not np.all(np.diff(times) > 0.0):
        times, slopes = np.arange(len(groups), dtype=float), np.full(y.shape, np.nan)
    return Readings(np.array(still), channels, unit, y, samples, u_mean, times, slopes, tuple(findings))


def basis_of(
    record: Record,
    settings: TurntableSettings,
    ranges: Mapping[str, Any],
    unit: Unit,
    model: Formula,
    references: tuple[str, ...],
) -> Basis:
    """The basis of an estimate of any test on a table; ``unit`` of the record's outputs."""
    temperature = recorded_temperature(record)
    conditions = conditions_of(settings, temperature, ranges, frame=FRAME, output_unit=unit.symbol)
    return studied(
        "calibrate turntable",
        settings,
        (*record.sources, *settings.chain.sources),
        model,
        references,
        conditions,
    )
