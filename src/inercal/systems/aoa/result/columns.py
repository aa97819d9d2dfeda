"""Angles from row to row, and points, as columns: the same in a file and on a stream.

    theta, u_theta [deg]              pitch, and its standard uncertainty
    rate [deg/s]                      of pitch, nose-up
    nis [1]                           mean squared innovation of the last seconds; 1 or less where all is well
    status [1]                        0 sound; 1 the last seconds contradict the model; 2 no angle
    alpha, u_alpha [deg]              angle of attack
    beta, u_beta [deg]                sideslip, the wind from the right
    alarm [1]                         1 above, -1 below the limits of the study, 0 within

Alpha and beta need the attitude of the model in the stream, stated in the study; without it theta is not called alpha.
The paper's methods have no nis and no status; alarm is there where the study states limits. A row of the recording that
was left out has no other numbers than its status.

Angles beyond the limits of the study, in words.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.records.titles import name_and_unit
from inercal.foundation.units import Unit, parse_unit
from inercal.systems.aoa.angles import Angles, gives_alpha, stated_roll
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.result.points import Joined, Point
from inercal.systems.aoa.settings import AoaSettings


def beyond_limits(angles: Angles, t: Array, settings: AoaSettings) -> list[Finding]:
    """``beyond_limits`` of a whole recording with stamps ``t`` (n,) [s]; none where all angles are within."""
    if not settings.alarm.stated:
        return []
    table = rows(angles, settings)
    out = np.flatnonzero(np.isin(table[:, -1], (-1.0, 1.0)))
    if not len(out):
        return []
    first = beyond(settings, table[out[0]].tolist(), float(t[out[0]]))
    text = f"{first.headline}, and so are {counted(len(out), 'row')} of {len(t)}"
    return [Finding("beyond_limits", text, first.where)]


def beyond(settings: AoaSettings, row: Sequence[float], t: float) -> Finding:
    """``beyond_limits`` of one row of `inercal.systems.aoa.result.columns` at ``t`` [s]."""
    names = [name for name, _ in columns(settings)]
    name = "alpha" if gives_alpha(settings.attitude) else "theta"
    side, limit = ("above", settings.alarm.highest) if row[-1] > 0.0 else ("below", settings.alarm.lowest)
    limit_deg = math.degrees(math.nan if limit is None else limit)
    text = f"{name} is {row[names.index(name)]:.4g} deg, {side} the study's {limit_deg:.6g} deg"
    return Finding("beyond_limits", text, f"t = {t:.10g} s")


_PITCH = (("theta", "deg"), ("u_theta", "deg"), ("rate", "deg/s"))
_SOUND = (("nis", "1"), ("status", "1"))
_FLOW = (("alpha", "deg"), ("u_alpha", "deg"), ("beta", "deg"), ("u_beta", "deg"))
_NUMBERS = (("point", "1"), ("trigger", "1"), ("last_trigger", "1"))
_POINT = (*_NUMBERS, ("begin", "s"), ("end", "s"), ("rows", "1"), *_PITCH, ("scatter", "deg"))

SUSPECT, LOST = 1.0, 2.0
"""Statuses of a row that is not sound."""


def columns(settings: AoaSettings) -> tuple[tuple[str, str], ...]:
    """Names and units, after ``t``."""
    flow = _FLOW if gives_alpha(settings.attitude) else ()
    return _PITCH + _SOUND + flow + ((("alarm", "1"),) if settings.alarm.stated else ())


def rows(angles: Angles, settings: AoaSettings) -> Array:
    """The columns (n, 5 to 10), in their units, of angles (n,); the uncertainty of a stated roll is in theirs."""
    attitude, nis, alarm = settings.attitude, angles.nis, settings.alarm
    degrees = np.degrees([angles.theta, stated_roll(angles, attitude).u, angles.rate])
    lost = np.isnan(angles.theta)
    if nis is None:
        sound = [np.full(len(lost), np.nan)] * 2
    else:
        sound = [np.where(lost, np.nan, nis), np.where(lost, LOST, (nis > LIMITS.mean_nis) * SUSPECT)]
    values = [*degrees, *sound]
    watched = angles.theta
    if gives_alpha(attitude):
        flow = angles.in_stream(attitude)
        watched = flow.alpha
        values += list(np.degrees([flow.alpha, flow.u_alpha, flow.beta, flow.u_beta]))
    if alarm.stated:
        values.append(alarm.beyond(watched))
    return np.column_stack(values)


def angles_record(recording: Recording, angles: Angles, settings: AoaSettings) -> Record:
    """Angles with the time stamps of the recording, row by row."""
    names, values = columns(settings), rows(angles, settings)
    return _record(names, values, recording.t, recording, Source(f"angles of {angles.method}", ""))


def points_record(points: Iterable[Point], recording: Recording, settings: AoaSettings) -> Record:
    """Points, a row each: ``t`` in the middle, number and triggers of the record, mean angle, scatter."""
    flow = gives_alpha(settings.attitude)
    # a point holds angles in rad
    lines = [
        (p.number, p.trigger, p.last_trigger, p.begin, p.end, float(p.rows))
        + tuple(np.degrees([p.theta, p.u, p.rate, p.scatter]).tolist())
        + (tuple(np.degrees([p.alpha, p.u_alpha, p.beta, p.u_beta]).tolist()) if flow else ())
        for p in points
    ]
    names = _POINT + (_FLOW if flow else ())
    values = np.array(lines, dtype=float).reshape(len(lines), len(names))
    middle = 0.5 * (values[:, 3] + values[:, 4])
    return _record(names, values, middle, recording, Source("points", ""))


def beside(points: Record, joined: Joined) -> Record:
    """Points with the means of another table beside, in the units of its titles."""
    columns = dict(points.columns)
    first = next(iter(columns.values()))
    for title, values in joined.columns.items():
        name, unit = name_and_unit(title)
        name = name if name not in columns else f"joined_{name}"
        columns[name] = Column(name, Unit(unit or "1", "", 1.0), values, first.t, first.source)
    return replace(points, columns=columns)


def _record(
    names: tuple[tuple[str, str], ...], values: Array, t: Array, recording: Recording, source: Source
) -> Record:
    """Columns (n, k) as a record."""
    named = zip(names, values.T, strict=True)
    made = record_of(((name, parse_unit(symbol), column) for (name, symbol), column in named), t, source)
    return replace(made, findings=recording.findings, sources=(*recording.sources, source))
