"""Shorthands: studies of pose means, known rates and known turns, as sections of one triad."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias, assert_never

import numpy as np

from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.systems.imu.rows import is_counted
from inercal.systems.imu.sections.cutting.holds import holds_of, steady_rates
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.cutting.means import Means, rows_of_means, sections_of_means
from inercal.systems.imu.sections.cutting.proposal import Proposal, RecordedTriads
from inercal.systems.imu.sections.cutting.table import SectionRow, direction_of, quantity_of
from inercal.systems.imu.settings import Exclusion, KnownRatesSettings, KnownTurnsSettings, MeansSettings

Shorthand: TypeAlias = MeansSettings | KnownRatesSettings | KnownTurnsSettings
"""Options of methods that are some sections, of each of which the same is known."""


def word_of(options: Shorthand) -> str:
    """The word of a study for these options."""
    match options:
        case MeansSettings():
            return "means"
        case KnownRatesSettings():
            return "known_rates"
        case KnownTurnsSettings():
            return "known_turns"
    assert_never(options)


def alone(record: Record, options: Shorthand) -> Record:
    """The record with the one triad that is calibrated; that of means counts its rows, whose times do not matter.

    Raises `RecordError` where the triad is not there.
    """
    sensor = "acc" if isinstance(options, MeansSettings) else "gyro"
    t = record.triad(sensor).t
    if isinstance(options, MeansSettings):
        t = np.arange(len(t), dtype=float)
    columns = {name: replace(record[name], t=t) for name in (f"{sensor}_x", f"{sensor}_y", f"{sensor}_z")}
    return replace(record, columns=columns)


def proposal_of(records: Mapping[str, Record], options: Shorthand, exclude: Exclusion) -> Proposal:
    """The sections of records of one triad, by the names of their files, less those that a study leaves out.

    Raises
    ------
    InputError
        Another number of records than the study states of, one without a stretch that can be read, or the study leaves
        out what is not there.
    """
    match options:
        case MeansSettings():
            return _without(_of_means(records), exclude)
        case KnownRatesSettings():
            return _without(_of_rates(records, options), exclude)
        case KnownTurnsSettings():
            return _of_turns(records, options)
    assert_never(options)


def gyro_of_means(records: Sequence[Record], options: Shorthand) -> tuple[Finding, ...]:
    """A finding where rows of means have a gyro as well, which they do not calibrate."""
    if not isinstance(options, MeansSettings) or "gyro_x" not in records[0]:
        return ()
    headline = "Means of poses hold no turns: the gyro is not calibrated."
    action = 'Use imu.method = "sections" with rates or turns.'
    return (Finding("gyro_missing", headline, action=action, harm=()),)


def _of_means(records: Mapping[str, Record]) -> Proposal:
    """A rest of unknown direction for each row."""
    (name, record), *_ = records.items()
    means = Means(acc=record.triad("acc").values)
    rows = _numbered(rows_of_means(name, means))
    return Proposal(rows, tuple(sections_of_means(rows, means)), {}, ())


def _of_rates(records: Mapping[str, Record], options: KnownRatesSettings) -> Proposal:
    """A rate about an unknown axis, or a rest, for each orientation.

    Those of one file share the error of its rate, and their scatter, which nobody states: what a table does to it is
    more than noise. Rests may all be in one pose, so that earth rate counts as the same in them.
    """
    if len(records) != len(options.rates):
        found = f"found {counted(len(options.rates), 'rate')} for {counted(len(records), 'file')}"
        raise StudyError("imu.rates", f"{found}, expected one for each FILE, in order")
    if not any(options.rates):
        raise StudyError("imu.rates", "found rates of zero alone, expected one at least that turns")
    rows: list[SectionRow] = []
    for (name, record), rate, u in zip(records.items(), options.rates, options.rates_u, strict=True):
        row = SectionRow("", name, scatter=name)
        if rate != 0.0:
            row = replace(row, kind="rate", rate=quantity_of(abs(rate), u, "deg/s"), rate_group=name)
        else:
            row = replace(row, setup=name)
        rows += _orientations(record, row)
    proposal = Proposal.by(_numbered(rows), records)
    return replace(proposal, sections=tuple(replace(section, gyro_var=None) for section in proposal.sections))


def _orientations(record: Record, row: SectionRow) -> list[SectionRow]:
    """A ``row`` for each orientation of a file: a row of means, or a stretch at its rate."""
    if is_counted(record):
        return [row] * len(record["gyro_x"].values)
    gyro = RecordedTriads.of(row.file, record).gyro
    assert gyro is not None
    whole = gyro.between(None, None)
    holds = steady_rates(whole.t, whole.values) if row.kind == "rate" else ()
    holds = holds or holds_of(whole.t, None, whole.values).gyro
    if not holds:
        raise RecordError(
            row.file,
            f"found no steady stretch of {LIMITS.shortest_rate:g} s in the output of the gyro, expected the table to "
            "turn at one rate in each orientation",
        )
    return [
        replace(row, begin=float(whole.t[hold.start]), end=float(whole.t[hold.stop - 1])) for hold in holds
    ]


def _of_turns(records: Mapping[str, Record], options: KnownTurnsSettings) -> Proposal:
    """A turn about each axis, with the rests at its ends; each file is a session with a bias of its own."""
    rows = [
        replace(
            row,
            section=f"turn about {axis}",
            kind="turn",
            axis=direction_of(axis, axis),
            angle=quantity_of(angle, u, "deg"),
            placing=options.alignment,
        )
        for axis, row, angle, u in zip(
            "xyz", _turn_files(records), options.angles, options.angles_u, strict=True
        )
    ]
    proposal = Proposal.by(rows, records)
    return replace(proposal, sections=()) if proposal.unused else proposal


def _turn_files(records: Mapping[str, Record]) -> list[SectionRow]:
    """The stretch of the turn about x, y and z: a file each, or what has its label in one."""
    if len(records) == 3:
        return [SectionRow("", name, session=name) for name in records]
    if len(records) != 1:
        found = f"found {len(records)} files for three turns"
        raise StudyError("imu.turns", f"{found}, expected three, about x, y and z, or one with labels")
    ((name, record),) = records.items()
    labels, t = np.array([label.removesuffix("_rot") for label in record.labels]), record["gyro_x"].t
    rows = []
    for axis in "xyz":
        times = t[(labels == axis) & np.isfinite(t)] if len(labels) == len(t) else t[:0]
        if not len(times):
            where = record.sources[0].path if record.sources else name
            raise RecordError(
                where,
                f"found no rows of the label {axis!r} in one file, expected a file for each turn, about x, y and z in "
                "this order, or a column of labels",
            )
        rows.append(SectionRow("", name, float(times.min()), float(times.max())))
    return rows


def _numbered(rows: Sequence[SectionRow]) -> tuple[SectionRow, ...]:
    """The rows by number, as ``imu.exclude`` calls them."""
    return tuple(replace(row, section=f"pose {k}") for k, row in enumerate(rows, 1))


def _without(proposal: Proposal, exclude: Exclusion) -> Proposal:
    """The proposal without the poses that the study leaves out."""
    if exclude.times:
        raise StudyError("imu.exclude", 'found a time, expected numbers, such as "pose 12"')
    left = [f"pose {number}" for number in exclude.poses]
    there = {row.section for row in proposal.rows}
    for name in left:
        if name not in there:
            raise StudyError("imu.exclude", f"found {name}, expected one of pose 1 to pose {len(there)}")
    kept = tuple(section for section in proposal.sections if section.name not in left)
    return replace(proposal, sections=kept, unused={**proposal.unused, **dict.fromkeys(left, "left out")})
