"""A record as a recording of a platform: SI, one clock that increases, continuous angles, a rate for every step.

In a gap between rows, and where a rate is no number, the platform is taken to turn on over the base as before
(`inercal.systems.selfcal.filters.gaps`). Angles and accelerometers that are missing are left out of the updates.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Column
from inercal.foundation.records.places import counted, places
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.systems.selfcal.diagnosis.gross import clipped, implausible, off_the_path
from inercal.systems.selfcal.filters.gaps import walked, with_held
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.kinematics import TWO_PI, commanded_rates
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import JOINTS
from inercal.systems.selfcal.platform.states import TEMPERATURE
from inercal.systems.selfcal.settings import SelfcalSettings

_OF_JOINTS = "th_rate"

_REFERENCE = ("q_ref_0", "q_ref_1", "q_ref_2", "q_ref_3")


def recording_of(record: Record, settings: SelfcalSettings) -> Recording:
    """The recording in a record, from the first row with all angles and a rate, with findings on what contradicts the
    study.

    The record has ``th_x..z``, but of joints that the study states as fixed, ``acc_x..z``, and the platform's rate,
    commanded (``wc_x..z``) or, where there is no such, measured (``gyro_x..z``), or else the rates commanded to the
    joints (``th_rate_x..z``, with ``th_acc_x..z`` where they change within a step), on one clock; it may have the true
    attitude, ``q_ref_0..3``. A rate belongs to the interval from its row to the next, one recorded as an increment to
    the interval before; the last row's rate (or the first increment) is not used.

    Raises RecordError for columns that are missing or on different clocks, time that stands still or was set back,
    fewer than `LIMITS.least_rows` rows, no accelerometers, or units of rates and angles that contradict each other.
    """
    where = record.sources[0].path if record.sources else "record"
    sensor, unread = _rate_sensor(record, settings, where), as_recorded(record, settings).fixed
    names = [f"{name}_{axis}" for name in (sensor, "th", "acc") for axis in "xyz"]
    names = [name for name in names if name not in unread]
    columns = [record[name] for name in names]
    reference = [record[name] for name in _REFERENCE] if set(_REFERENCE) <= record.columns.keys() else []
    for column in [*columns[1:], *reference]:
        if column.t is not columns[0].t:
            text = f"{column.name} has another clock than {columns[0].name}, expected one row for all at each time"
            raise RecordError(where, text)
    values = {name: column.si() for name, column in zip(names, columns, strict=True)}
    accelerations = _accelerations(record, columns[0]) if sensor == _OF_JOINTS else None
    values |= {name: np.full(len(columns[0].t), angle) for name, angle in unread.items()}
    rate, th, acc = (
        np.stack([values[f"{name}_{axis}"] for axis in "xyz"], axis=-1) for name in (sensor, "th", "acc")
    )
    increment = [column.increment for column in columns[:3]]
    # increments were gained since the row before
    rate = np.where(increment, np.vstack([rate[1:], np.full((1, 3), np.nan)]), rate)
    if not np.isfinite(acc).any():
        raise RecordError(where, "acc_x, acc_y, acc_z hold no number, expected specific force in m/s^2 or g")
    time = columns[0].t
    rows, findings = _used_rows(time, th, rate, where)
    rows, late = _increasing(time, rows, where)
    findings += late
    t, rate, th, acc = time[rows], rate[rows[:-1]], th[rows], acc[rows]
    findings += _lacking(rate, rows, sensor)
    findings += _gaps(t, record)
    th, turned = _continuous(th)
    if sensor == _OF_JOINTS:
        gained = 0.0 if accelerations is None else 0.5 * accelerations[rows[:-1]] * np.diff(t)[:, None]
        rate = _of_platform(t, th, rate + gained, settings)
    if turned and all(finding.code != "wrap_2pi" for finding in record.findings):
        findings.append(Finding("wrap_2pi", f"{', '.join(turned)}: jumps by a full turn, taken out"))
    recorded_rate = rate
    rate, held = with_held(t, rate, th, settings.world, all(increment))
    temperature = recorded_temperature(record)
    measured = sensor == "gyro"
    walk = walked(t, recorded_rate, held) if measured and held else None
    true = np.stack([column.values for column in reference], axis=-1)[rows] if reference else None
    recording = Recording(
        t, rate, th, acc, measured, (), record.sources, held, temperature, walk, true,
        _warm(record, settings, t, where), tuple(k for k, name in enumerate(JOINTS) if name in unread),
    )  # fmt: skip
    of_record = [  # without extremes beyond which no motion goes on
        each
        for each in (*worth_saying(record, columns), *findings)
        if each.code != "saturation"
        or each.harm[0][:-2] not in (sensor, "acc")
        or clipped(recording, settings, each.harm[0])
    ]
    recording = replace(recording, findings=tuple(of_record))
    findings = implausible(recording, settings, where)
    if settings.plan is not None:
        began = float(time[np.argmax(np.isfinite(time))])
        findings += off_the_path(recording, settings.plan, settings.world, began, rows)
    return replace(recording, findings=(*of_record, *findings))


def _accelerations(record: Record, rate: Column) -> Array | None:
    """Accelerations (n, 3) [rad/s^2] commanded to the joints, 0 where they are no numbers; None without them."""
    names = [f"th_acc_{axis}" for axis in "xyz"]
    if not set(names) <= record.columns.keys():
        return None
    columns = [record[name] for name in names]
    if any(column.t is not rate.t for column in columns):
        where = record.sources[0].path if record.sources else "record"
        text = f"{columns[0].name} has another clock than {rate.name}, expected one row for all at each time"
        raise RecordError(where, text)
    return np.nan_to_num(np.stack([column.si() for column in columns], axis=-1))


def _of_platform(t: Array, th: Array, rate: Array, settings: SelfcalSettings) -> Array:
    """Rates (n - 1, 3) [rad/s] of the platform against inertial space that a drive commands, whose joints are to turn
    with ``rate`` (n - 1, 3) [rad/s]: at the angles at which they would then be, from the start of the study's plan on.

    Where no rate is recorded the joints turn as they are read. Raises StudyError without a plan: angles as read have
    noise, which would turn all rates of a path.
    """
    if settings.plan is None:
        text = (
            "missing, expected the angles from which the joints were commanded by th_rate_x..z as its start"
        )
        raise StudyError("plan", text)
    known, dt = np.asarray(np.isfinite(rate).all(axis=1)), np.diff(t)[:, None]
    turns = np.where(known[:, None], rate * dt, np.nan_to_num(np.diff(th, axis=0)))
    start = np.array([settings.plan.start])
    nominal = np.vstack([start, start + np.cumsum(turns, axis=0)])
    world, wanted = settings.world, np.empty((len(rate), 3))
    commanded_rates(nominal, dt[:, 0], world.earth, world.axes, world.signs, wanted)
    wanted[~known] = np.nan
    return wanted


def _warm(record: Record, settings: SelfcalSettings, t: Array, where: str) -> Array | None:
    """The temperature at times ``t`` (n,) [s], above that of the coefficients; None without one, which is refused where
    coefficients are to change with it."""
    if recorded_temperature(record) is None:
        if asked := [kind for kind in settings.kinds if kind in TEMPERATURE]:
            text = (
                f"found no temperature in degC or K, expected one for {', '.join(asked)} under model.states"
            )
            raise RecordError(where, text)
        return None
    column = record["temperature"]
    values = column.si()
    known = np.isfinite(values + column.t)
    return settings.warm(np.interp(t, column.t[known], values[known]))


def as_recorded(record: Record, settings: SelfcalSettings) -> SelfcalSettings:
    """The study with those joints alone fixed that a record has no angle of: one that is there counts."""
    fixed = {name: angle for name, angle in settings.fixed.items() if name not in record}
    return replace(settings, fixed=fixed)


def _rate_sensor(record: Record, settings: SelfcalSettings, where: str) -> str:
    """``wc``, ``gyro`` or ``th_rate``, whichever is there whole; refuses a record without all columns."""
    filled = {name for name, column in record.columns.items() if np.isfinite(column.values).any()}
    there = [
        sensor for sensor in ("wc", "gyro", _OF_JOINTS) if filled >= {f"{sensor}_{axis}" for axis in "xyz"}
    ]
    wanted = [f"{name}_{axis}" for name in ("th", "acc") for axis in "xyz"]
    missing = [name for name in wanted if name not in record and name not in settings.fixed]
    if not there or missing:
        lacking = f"no {', '.join(missing)}" if missing else "no whole rate wc_x, wc_y, wc_z"
        among = ", ".join(record.columns) or "no columns"
        of_angle = " (a joint that does not turn is stated by rig.fixed)" if {*missing} & {*JOINTS} else ""
        raise RecordError(
            where,
            f"found {lacking} among {among}, expected t, wc_x..z (or gyro_x..z, or th_rate_x..z), th_x..z, acc_x..z"
            f"{of_angle}",
        )
    return there[0]


def worth_saying(record: Record, columns: Collection[Column]) -> list[Finding]:
    """Findings of the record but for unused numbers: the last row's rate, the first row's accelerometers."""
    needless = {
        column.name: 0 if column.name.startswith("acc") else len(column.values) - 1 for column in columns
    }
    empty = {
        f"{column.name}: 1 missing value"
        for column in columns
        if np.flatnonzero(np.isnan(column.values)).tolist() == [needless[column.name]]
        and column.sensor != "th"
    }
    return [each for each in record.findings if each.code != "nan" or each.message not in empty]


def _used_rows(t: Array, th: Array, rate: Array, where: str) -> tuple[NDArray[np.int64], list[Finding]]:
    """Rows (from 0) with a time, from the first that is complete on."""
    timed = np.flatnonzero(np.isfinite(t))
    whole = np.isfinite(th[timed]).all(axis=1) & np.isfinite(rate[timed]).all(axis=1)
    rows = timed[int(np.argmax(whole)) :] if whole.any() else timed[:0]
    if len(rows) < LIMITS.least_rows:
        raise RecordError(
            where,
            f"found {counted(len(rows), 'row')} from the first with a time, all angles and a rate on, "
            f"expected {LIMITS.least_rows} or more",
        )
    findings = []
    untimed = rows[0] + np.flatnonzero(~np.isfinite(t[rows[0] :]))
    if untimed.size:
        text = f"t: {counted(untimed.size, 'row')} without a time left out, the platform taken to turn on as before"
        findings.append(Finding("nan", text, places("row", untimed + 1)))
    if rows[0] > 0:
        text = f"{counted(int(rows[0]), 'row')} before the first with a time, all angles and a rate left out"
        findings.append(Finding("nan", text, places("row", np.arange(1, rows[0] + 1))))
    return rows, findings


def _increasing(time: Array, rows: NDArray[np.int64], where: str) -> tuple[NDArray[np.int64], list[Finding]]:
    """Those of the rows that are later than all before them; refused where so many in a row are not that time stands
    still, or the clock was set back."""
    t = time[rows]
    taken = np.flatnonzero(t > np.concatenate([[-np.inf], np.maximum.accumulate(t)[:-1]]))
    if len(taken) == len(t):
        return rows, []
    late = np.diff(np.append(taken, len(t))) - 1
    if late.max() >= LIMITS.late_rows:
        k = int(np.argmax(late))
        raise RecordError(
            where,
            f"t: {late[k]} rows in a row from row {rows[taken[k] + 1] + 1} on are not later than {t[taken[k]]:.10g} s, "
            "expected time to increase "
            '(a map with ignore = true and rate = "5 Hz" under [time] does without stamps)',
        )
    left = np.delete(rows, taken)
    text = f"t: {counted(left.size, 'row')} not later than those before left out"
    code = "backward_time" if (np.diff(t) < 0.0).any() else "duplicate_time"
    return rows[taken], [Finding(code, text, places("row", left + 1), harm=())]


def _lacking(rate: Array, rows: NDArray[np.int64], sensor: str) -> list[Finding]:
    """``nan``: rows from which on no rate is known."""
    lacking = np.flatnonzero(~np.isfinite(rate).all(axis=1))
    if not lacking.size:
        return []
    text = (
        f"{sensor}: no rate in {counted(lacking.size, 'row')}, the platform is taken to turn on as before; where the "
        "encoders contradict that the attitude is taken anew"
    )
    return [Finding("nan", text, places("row", rows[lacking] + 1))]


def _gaps(t: Array, record: Record) -> list[Finding]:
    """``gap``: time through which the platform is taken to turn on as before."""
    if all(finding.code != "gap" for finding in record.findings):
        return []
    step = np.diff(t)
    long = step > LIMITS.gap_ratio * np.median(step)
    text = (
        f"the platform is taken to turn on as before through {step[long].sum():.4g} s without rows; where the "
        "encoders contradict that the attitude is taken anew"
    )
    return [Finding("gap", text)] if long.any() else []


def _continuous(th: Array) -> tuple[Array, list[str]]:
    """Angles (n, 3) [rad] without jumps by full turns, missing ones aside; names of those that had some."""
    th, turned = th.copy(), []
    for k, axis in enumerate("xyz"):
        read = np.flatnonzero(np.isfinite(th[:, k]))
        turns = np.round((th[read, k] - np.unwrap(th[read, k])) / TWO_PI)
        if turns.any():
            turned.append(f"th_{axis}")
        # to the digits of `inercal.systems.selfcal.platform.kinematics.nearest_turn`, so that a stream gives what a
        # file gives
        th[read, k] -= TWO_PI * turns
    return th, turned
