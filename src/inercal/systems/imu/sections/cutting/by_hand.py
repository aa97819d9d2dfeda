"""Sections of one log in the hand: the poses that are held, of which nothing is known, and the moves between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Triad
from inercal.foundation.records.record import Record
from inercal.systems.imu.recording import coarse_steps
from inercal.systems.imu.sections.cutting.between import as_a_swing, moves_of, swings_of, with_moves_between
from inercal.systems.imu.sections.cutting.cut import Stretch, TriadSamples, cut
from inercal.systems.imu.sections.cutting.holds import Holds, holds_of
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.cutting.log import never_held, of_holds, on_clock
from inercal.systems.imu.sections.cutting.proposal import Proposal, RecordedTriads
from inercal.systems.imu.sections.cutting.table import SectionRow
from inercal.systems.imu.settings import Exclusion, ImuSettings


def by_hand(name: str, record: Record, settings: ImuSettings) -> Proposal:
    """The poses and moves of the record of a file, less those that a study leaves out; a swing where nothing rests.

    Poses have numbers in the order of time, which stay where some are left out.

    Raises
    ------
    RecordError
        No accelerometers, no times, or values that no sensor gives.
    StudyError
        The study leaves out what is not there, or states a still start that is none.
    """
    acc, gyro = (_rising(one) for one in _whole(RecordedTriads.of(name, _plausible(record))))
    assert acc is not None
    found = holds_of(acc.t, acc.values, None if gyro is None else on_clock(gyro, acc.t))
    _still_start(acc.t, found, settings.static_start)
    rows = [
        SectionRow(f"pose {k}", name, float(acc.t[one.start]), float(acc.t[one.stop - 1]), why="detected")
        for k, one in enumerate(found.rests, 1)
    ]
    left, kept = _kept(rows, settings.exclude, acc.t)
    notes: list[Finding] = []
    if gyro is None:
        headline = "The record has no gyro: only the accelerometers are calibrated."
        notes.append(Finding("gyro_missing", headline, name))
    if not rows:
        kept = [as_a_swing(name, acc.t)]
        notes.append(never_held(name, acc.t, found))
    elif gyro is not None:
        kept = [
            row
            for row in with_moves_between(kept)
            if row.kind == "rest" or not settings.exclude.touches(row.begin or 0.0, row.end or 0.0)
        ]
    triads = {name: (acc, gyro)}
    done = cut(
        [
            Stretch(
                row,
                acc.between(row.begin, row.end),
                None if gyro is None else gyro.between(row.begin, row.end),
            )
            for row in kept
        ]
    )
    moves, no_moves = moves_of(kept, done.sections, triads)
    line = of_holds(name, acc.t, found.unused, rows, done.unused)
    if line is not None:
        notes.append(line)
    short = [one.name for one in done.sections if one.acc is None]
    if short:
        few = "pose" if len(short) == 1 else "poses"
        headline = (
            f"Accelerometers sit at an end of their range in {len(short)} {few}, whose means do not count."
        )
        items = tuple({"pose": pose} for pose in short)
        notes.append(
            Finding("saturation", headline, name, (), action="Set a wider range of them.", items=items)
        )
    unused = {**left, **done.unused, **no_moves}
    return Proposal(
        tuple(kept),
        done.sections,
        unused,
        (),
        tuple(notes),
        moves,
        swings_of(kept, triads),
        triads,
        _hiding_steps(kept, gyro),
        numbered=True,
    )


def _hiding_steps(rows: Sequence[SectionRow], gyro: TriadSamples | None) -> tuple[float, float, float]:
    """Steps of the axes of a gyro whose noise in the poses is below half of them, 0 for others."""
    if gyro is None:
        return 0.0, 0.0, 0.0
    rests = [gyro.between(row.begin, row.end).values for row in rows if row.kind == "rest"]
    deviations = [x.std(axis=0) for x in rests if len(x) > 2]
    if not deviations:
        return 0.0, 0.0, 0.0
    x, y, z = coarse_steps(gyro.values, np.median(deviations, axis=0))
    return float(x), float(y), float(z)


def _plausible(record: Record) -> Record:
    """The record; raises `RecordError` for a triad without a time axis, or with values that no sensor gives."""
    triads = [record.triad("acc")]
    if any(f"gyro_{axis}" in record for axis in "xyz"):
        triads.append(record.triad("gyro"))
    for triad in triads:
        _of_a_sensor(triad)
    return record


def _of_a_sensor(triad: Triad) -> None:
    """Raise `RecordError` where a triad has no time axis, or values that no sensor gives."""
    where, sensor = triad.source.path, triad.sensor
    if not np.isfinite(triad.rate):
        raise RecordError(
            where,
            f"found {len(triad.t)} samples of {sensor} without increasing time stamps, expected a recording",
        )
    for axis, values in zip("xyz", triad.values.T, strict=True):
        finite = values[np.isfinite(values)]
        if not finite.size:
            raise RecordError(where, f"found no number in {sensor}_{axis}, expected the output of a sensor")
        if np.ptp(finite) == 0.0:
            raise RecordError(where, f"{sensor}_{axis} never changes ({finite[0]:g}), expected a live sensor")
    size = float(np.max(np.abs(triad.values), initial=0.0, where=np.isfinite(triad.values)))
    if not 1e-100 < size < 1e100:
        raise RecordError(where, f"{sensor} has values up to {size:.3g}, expected the output of a sensor")


def _whole(file: RecordedTriads) -> tuple[TriadSamples, TriadSamples | None]:
    """The triads without rows that lack a stamp or a value: a lost sample does no harm to the mean of a hold, and a gap
    shows. Rows of one clock stay together."""
    acc, gyro = file.acc, file.gyro
    assert acc is not None
    if gyro is None or len(gyro.t) != len(acc.t) or not np.array_equal(gyro.t, acc.t, equal_nan=True):
        return acc.between(None, None), None if gyro is None else gyro.between(None, None)
    both = np.isfinite(acc.t) & np.isfinite(acc.values).all(axis=1) & np.isfinite(gyro.values).all(axis=1)
    t = acc.t[both]
    return (
        TriadSamples(t, acc.values[both], acc.clipped[both]),
        TriadSamples(t, gyro.values[both], gyro.clipped[both]),
    )


def _rising(samples: TriadSamples | None) -> TriadSamples | None:
    """Samples whose times rise: those of one stamp are spread up to the next, and a stamp that runs backward becomes a
    gap, for a log that was cut and joined is one all the same."""
    if samples is None or (np.diff(samples.t) > 0.0).all():
        return samples
    step = np.diff(samples.t)
    usual = samples.step
    step = np.where(step < 0.0, max(LIMITS.gap_of_joint, 10.0 * usual), step)
    t = samples.t[0] + np.concatenate([[0.0], np.cumsum(step)])
    first = np.flatnonzero(np.concatenate([[True], step > 0.0]))
    after = np.append(first, len(t)), np.append(t[first], t[-1] + usual)
    return replace(samples, t=np.interp(np.arange(len(t)), *after))


def _still_start(t: Array, found: Holds, stated: float | None) -> None:
    """Raise `StudyError` where a record is not as long as its still start is ``stated`` to be [s], or moves in it."""
    if stated is None:
        return
    if not LIMITS.shortest_hold <= stated <= t[-1] - t[0]:
        raise StudyError(
            "imu.static_start",
            f"found {stated:g} s, expected {LIMITS.shortest_hold:g} s to the length of the record, "
            f"{t[-1] - t[0]:.1f} s",
        )
    still = float(t[found.acc[0].stop - 1] - t[0]) if found.acc else 0.0
    if still < stated - LIMITS.shortest_hold:
        raise StudyError(
            "imu.static_start",
            f"found {stated:g} s, expected a still period: the instrument moves, or the time axis breaks, after "
            f"{still:.1f} s",
        )


def _kept(
    rows: Sequence[SectionRow], exclude: Exclusion, t: Array
) -> tuple[dict[str, str], list[SectionRow]]:
    """Poses that a study leaves out, by name with the reason, and the others; raises `StudyError` for what is not
    there."""
    names = [row.section for row in rows]
    for number in exclude.poses:
        if f"pose {number}" not in names:
            raise StudyError("imu.exclude", f"found pose {number}, expected one of 1 to {len(names)}")
    for begin, end in exclude.times:
        if begin >= t[-1] or end <= t[0]:
            raise StudyError(
                "imu.exclude",
                f"found {begin:g} s .. {end:g} s, expected a time of the record, {t[0]:g} s to {t[-1]:g} s",
            )
    left = {f"pose {number}": "left out by imu.exclude" for number in exclude.poses}
    for row in rows:
        middle = 0.5 * ((row.begin or 0.0) + (row.end or 0.0))
        if exclude.touches(middle, middle):
            left[row.section] = "left out by imu.exclude"
    return left, [row for row in rows if row.section not in left]
