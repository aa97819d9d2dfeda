"""A record as a recording of a wind-tunnel model: SI, calibrated, one clock, saturated samples left out."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.checks.values import at_ends, is_dead, plateaus
from inercal.foundation.records.column import Column, usable_interval
from inercal.foundation.records.places import counted, counted_names, places
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.systems.aoa.angles import continuous
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, in_time, later
from inercal.systems.aoa.settings import GYROS, AoaSettings, SensorCalibration

Flags = NDArray[np.bool_]

_PER = {"voltage": "V", "count": "count"}


def recording_of(record: Record, settings: AoaSettings) -> Recording:
    """The recording in a record, its sensors calibrated as the study states, with findings on them.

    The record has ``t``, the accelerometers of the study's layout, and where present ``gyro``,
    ``gyro_roll`` and ``gyro_yaw``, ``point``, ``trigger``, ``theta_ref`` and ``temperature``; columns on other clocks
    are interpolated. There is one row for each of the accelerometers; samples that are missing, saturated (at or beyond
    the stated range, or at an extreme at which a sensor stays elsewhere) or stuck are NaN, and so are absent
    sensors; findings name them.

    Raises
    ------
    RecordError
        No accelerometers, or of axes that do not span the plane; raw counts or volts without a scale; fewer
        than 20 rows that go on in time, or a clock that was set back.
    """
    where = record.sources[0].path if record.sources else "record"
    names = settings.layout.names
    there = [name for name in names if name in record and _speaks(record[name], settings)]
    check_axes(there, record.columns, settings.layout, where)
    # the rows are those of the fastest accelerometer
    t = max((record[name].t for name in there), key=len)
    taken = later(t, where=where)
    if len(taken) < LIMITS.starting_rows:
        text = (
            f"found {counted(len(taken), 'row')} that go on in time, expected {LIMITS.starting_rows} or more"
        )
        raise RecordError(where, text)
    usable_interval(float(np.median(np.diff(t[in_time(t, where)]))), where)
    rows = _SensorRows(record, settings, t, where)
    gyros = [name for name in GYROS if name in record and _speaks(record[name], settings)]
    values = {name: rows.calibrated(name) for name in (*there, *gyros)}
    measured = [*names, GYROS[0]]
    lost = {name: _lost(record[name], settings, values) for name in (*there, *gyros)}
    none = np.full(len(t), np.nan)
    masked = np.zeros((len(t), len(measured)), dtype=np.bool_)
    findings = [*_findings_of(record, lost), *_of_time(record, t, taken)]
    for name, (out, stuck) in lost.items():
        left = out | stuck
        on_rows = rows.on_rows(name, np.where(left, np.nan, values[name]) if left.any() else values[name])
        if name in measured and record[name].t is t:
            masked[:, measured.index(name)] = out
        values[name] = on_rows
        findings += _left_out(name, out, stuck, settings.calibration(name))
    findings += of_sensors(there, gyros, record, settings)
    both = all(name in gyros for name in GYROS[1:])
    nowhere = np.broadcast_to(np.nan, (len(t), 2))  # takes no memory
    turns = np.column_stack([values[name] for name in GYROS[1:]]) if both else nowhere
    return Recording(
        t=t,
        acc=np.column_stack([values.get(name, none) for name in names]),
        gyro=values.get(GYROS[0], none),
        turns=turns,
        zero_angle=nowhere,
        point=rows.held("point"),
        trigger=rows.held("trigger"),
        # without jumps of a turn, which would be interpolated over, and spoil means
        reference=rows.on_rows("theta_ref", continuous(record["theta_ref"].si()))
        if "theta_ref" in record
        else None,
        masked=masked,
        findings=tuple(findings + rows.findings),
        sources=record.sources,
        temperature=recorded_temperature(record),
    )


def _speaks(column: Column, settings: AoaSettings) -> bool:
    """True for a column with numbers, which are not all the same where it should be noisy."""
    noise = settings.noise.gyro if column.name in GYROS else settings.noise.accelerometer
    return bool(np.isfinite(column.values).any()) and not (noise > 0.0 and is_dead(column.values))


class _SensorRows:
    """Columns of a record on the rows of its accelerometers, at ``t``; ``findings`` on them are collected."""

    def __init__(self, record: Record, settings: AoaSettings, t: Array, where: str) -> None:
        self.record, self.settings, self.t, self.where = record, settings, t, where
        self.findings: list[Finding] = []

    def calibrated(self, name: str) -> Array:
        """(m,) SI on the column's own clock."""
        column, how = self.record[name], self.settings.calibration(name)
        check_unit(column, how, self.where)
        thermal = how.scale_slope != 0.0 or how.bias_slope != 0.0
        return how.measured(indication(column, column.values), self._temperature(name) if thermal else None)

    def _temperature(self, name: str) -> Array | None:
        """Temperature [degC] at the stamps of a sensor; None where none was recorded."""
        if "temperature" not in self.record or not np.isfinite(self.record["temperature"].values).any():
            text = f"{name}: its temperature terms are left out, the record has no temperature"
            self.findings.append(Finding("not_stated", text, harm=EVERYTHING))
            return None
        column = self.record["temperature"]
        usable = later(column.t, where=self.where)
        usable = usable[np.isfinite(column.values[usable])]
        return np.interp(self.record[name].t, column.t[usable], column.si()[usable])

    def on_rows(self, name: str, values: Array) -> Array:
        """(n,) of ``values`` (m,) on the column's own clock, linear between its samples; NaN where these are far.

        A sensor with fewer samples has values at the rows nearest to them alone: each of them counts once.
        """
        column = self.record[name]
        if column.t is self.t:
            return values
        taken = later(column.t, where=self.where)
        theirs, values = column.t[taken], values[taken]
        if len(taken) < 2:
            return np.full(len(self.t), np.nan)
        interval = float(np.median(np.diff(theirs)))
        text = f"{name}: on a clock of its own of {1.0 / interval:.5g} Hz, interpolated to that of the accelerometers"
        self.findings.append(Finding("other_clock", text))
        there = np.searchsorted(theirs, self.t).clip(1, len(theirs) - 1)
        out = np.interp(self.t, theirs, values, left=np.nan, right=np.nan)
        apart = theirs[there] - theirs[there - 1] > LIMITS.other_clock_gap * interval
        out[apart | np.isnan(self.t)] = np.nan
        if len(taken) < LIMITS.slower_clock * len(self.t):
            mine = later(self.t, where=self.where)
            nearest = np.searchsorted(self.t[mine], theirs).clip(1, len(mine) - 1)
            nearest -= theirs - self.t[mine[nearest - 1]] < self.t[mine[nearest]] - theirs
            silent = np.ones(len(self.t), dtype=np.bool_)
            silent[mine[nearest]] = False
            out[silent] = np.nan
        return out

    def held(self, name: str) -> Array | None:
        """(n,) numbers of the last sample before each row; None without the column."""
        if name not in self.record:
            return None
        column = self.record[name]
        if column.t is self.t:
            return column.values
        taken = later(column.t, where=self.where)
        last = np.searchsorted(column.t[taken], self.t, side="right") - 1
        return np.where(last >= 0, column.values[taken[last.clip(0)]], np.nan)


def _lost(column: Column, settings: AoaSettings, values: dict[str, Array]) -> tuple[Flags, Flags]:
    """Samples (m,) that are saturated, and those that are stuck."""
    name, read = column.name, column.values
    out = at_ends(read)
    how = settings.calibration(name)
    if how.range is not None:
        out |= at_range(indication(column, read), values[name], how)
    noise = settings.noise.gyro if name in GYROS else settings.noise.accelerometer
    others = [other for key, other in values.items() if key != name and len(other) == len(read)]
    stuck = _stuck(read, noise / abs(how.scale * column.unit.factor), others)
    # a sensor that stands still at an extreme has met its range
    finite = read[np.isfinite(read)]
    out |= stuck & ((read == finite.max()) | (read == finite.min()))
    return out, stuck & ~out


def _stuck(read: Array, noise: float, others: list[Array]) -> Flags:
    """Samples (m,) in long runs of one number that ``noise``, as large as the steps between numbers, would end while
    ``others`` go on."""
    stuck = np.zeros(len(read), dtype=np.bool_)
    step = np.abs(np.diff(read))
    moving = step > 0.0
    if not noise >= step.min(initial=np.inf, where=moving):
        return stuck
    starts, ends = plateaus(step)
    long = ends - starts + 1 >= LIMITS.stuck_samples
    for start, end in zip(starts[long], ends[long], strict=True):
        if any(np.any(np.diff(other[start : end + 1]) != 0.0) for other in others):
            stuck[start : end + 1] = True
    return stuck


def _findings_of(record: Record, lost: dict[str, tuple[Flags, Flags]]) -> list[Finding]:
    """Findings of the record, without those that this module replaces by its own."""
    again = {f"{name}:" for name in lost}
    return [
        each
        for each in record.findings
        if each.code not in ("backward_time", "duplicate_time")
        and not (each.code == "saturation" and each.message.split(" ")[0] in again)
    ]


def _left_out(name: str, out: Flags, stuck: Flags, how: SensorCalibration) -> list[Finding]:
    """Findings on the samples of a sensor that are left out."""
    extreme = "at an extreme where it stays"
    at_end = extreme if how.range is None else f"at or beyond the range, or {extreme}"
    groups = (
        ("saturation", out, f"{at_end}, left out"),
        ("dead_channel", stuck, "of one number while the others go on, left out as stuck"),
    )
    return [
        Finding(code, f"{name}: {counted(rows.size, 'sample')} {words}", places("row", rows + 1), harm=())
        for code, flags, words in groups
        if (rows := np.flatnonzero(flags)).size
    ]


def _of_time(record: Record, t: Array, taken: NDArray[np.int64]) -> list[Finding]:
    """Findings on rows that do not go on in time."""
    left = np.delete(np.arange(len(t)), taken)
    if not left.size:
        return []
    untimed = left[np.isnan(t[left])]
    left = left[np.isfinite(t[left])]
    findings = []
    if untimed.size:
        text = f"t: {counted(untimed.size, 'row')} without a time, left out"
        findings.append(Finding("nan", text, places("row", untimed + 1)))
    if left.size:
        backward = bool((np.diff(t[np.isfinite(t)]) < 0.0).any())
        text = f"t: {counted(left.size, 'row')} not later than those before, left out"
        code = "backward_time" if backward else "duplicate_time"
        findings.append(Finding(code, text, places("row", left + 1), harm=()))
    return findings


def of_sensors(there: list[str], gyros: list[str], record: Record, settings: AoaSettings) -> list[Finding]:
    """Findings on sensors that are absent or dead, accelerometers that the study does not know, and calibrations with a
    bad verdict."""
    both = all(name in gyros for name in GYROS[1:])
    used = [*there, *(name for name in gyros if both or name == GYROS[0])]
    cautions = ((name, settings.calibration(name).caution) for name in used)
    findings = [Finding("bad_verdict", f"{name}: {caution}") for name, caution in cautions if caution]
    for name in settings.layout.names:
        if name not in there:
            if name in record and np.isfinite(record[name].values).any():
                code, why = "dead_channel", "never changes"
            else:
                code, why = "nan", "holds no number" if name in record else "is not in the record"
            findings.append(Finding(code, f"{name} {why}: angles are found without it", harm=()))
    if GYROS[0] not in gyros:
        why = "is not in the record" if GYROS[0] not in record else "never changes or holds no number"
        text = f"gyro {why}: angles are found from accelerometers alone, less well where the model moves fast"
        findings.append(Finding("gyro_missing", text))
    if len(alone := [name for name in GYROS[1:] if name in gyros]) == 1:
        other = next(name for name in GYROS[1:] if name not in gyros)
        findings.append(Finding("gyro_missing", f"{alone[0]} is of no use without {other}, not used"))
    unknown = [name for name in record.columns if name not in settings.layout.names and name[1:].isdigit()]
    if unknown:
        text = f"{', '.join(unknown)}: not under [sensors] of the study, not used"
        findings.append(Finding("not_stated", text, harm=()))
    return findings


def check_unit(column: Column, how: SensorCalibration, where: object) -> None:
    """Raise `RecordError` for a column in volts or counts without a scale for these, or such a scale for another."""
    holds = _PER.get(column.unit.dimension, "1")
    if holds == how.per:
        return
    name, symbol = column.name, column.unit.symbol
    if holds == "1":
        raise RecordError(where, f"{name} is in {symbol}, expected {how.per} as the study's scale is for")
    example = f"{'1 deg/s' if name in GYROS else '1e-3 g'}/{holds}"
    raise RecordError(
        where,
        f'{name} is in {symbol}, expected a scale under [sensors.{name}] of the study, such as "{example}"',
    )


def indication(column: Column, values: Array) -> Array:
    """``values`` (m,) of a column in SI, volts or counts."""
    indicated = values * column.unit.factor
    indicated += column.unit.zero
    return indicated


def at_range(indicated: Array, measured: Array, how: SensorCalibration) -> Flags:
    """Mask (m,) of samples at or beyond the range, ``measured`` or, in a column of physical units, ``indicated``.

    An output in physical units ends at its range before its bias is taken off; either way it is at an end. With a zero
    point of some volts or counts the range is that of the measured value alone.
    """
    if how.range is None:
        return np.zeros(np.shape(indicated), dtype=np.bool_)
    limit = (1.0 - LIMITS.range_rounding) * how.range
    at: Flags = np.abs(measured) >= limit
    return at | (np.abs(indicated * how.scale) >= limit) if how.per == "1" else at


def check_axes(there: Collection[str], columns: Iterable[str], layout: Layout, where: object) -> None:
    """Raise `RecordError` where accelerometers ``there`` among ``columns`` are none, or have parallel axes."""
    if not there:
        names = counted_names([*columns], 12) or "no columns"
        raise RecordError(
            where, f"found no accelerometer among {names}, expected t, {', '.join(layout.names)} and gyro"
        )
    if not layout.of(*(layout.names.index(name) for name in there)).spans:
        lacking = ", ".join(name for name in layout.names if name not in there) or "one of another axis"
        raise RecordError(
            where,
            f"found {', '.join(there)} alone with varying numbers, whose axes are parallel, expected {lacking} too",
        )
