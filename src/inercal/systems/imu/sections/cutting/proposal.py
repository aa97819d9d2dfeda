"""From recordings to sections: what names, labels and the data themselves say, and what has to be asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath

import numpy as np

from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.checks.stretches import erased
from inercal.foundation.records.checks.values import at_ends
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.records.record import Record
from inercal.foundation.units import RAW
from inercal.systems.imu.rows import is_counted
from inercal.systems.imu.sections.cutting.between import (
    NamedMove,
    SwingStretch,
    as_a_swing,
    moves_of,
    swings_of,
    with_moves_between,
)
from inercal.systems.imu.sections.cutting.checks import contradictions
from inercal.systems.imu.sections.cutting.cut import Stretch, TriadSamples, cut
from inercal.systems.imu.sections.cutting.holds import holds_of, steady_rates
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.cutting.log import on_clock, rows_of_log
from inercal.systems.imu.sections.cutting.means import Means, rows_of_means, sections_of_means
from inercal.systems.imu.sections.cutting.table import SectionRow, direction_of, quantity_of
from inercal.systems.imu.sections.cutting.words import Claim, claim
from inercal.systems.imu.sections.section import Section


@dataclass(frozen=True)
class Proposal:
    """Rows of ``sections.csv``, the sections that they give, those of no use with the reason, and what is asked."""

    rows: tuple[SectionRow, ...]
    sections: tuple[Section, ...]
    unused: dict[str, str]
    questions: tuple[Finding, ...]
    notes: tuple[Finding, ...] = ()
    """Findings that ask nothing, such as holds of no use."""
    moves: tuple[NamedMove, ...] = ()
    swings: tuple[SwingStretch, ...] = ()
    triads: Mapping[str, tuple[TriadSamples | None, TriadSamples | None]] = field(default_factory=dict)
    """Accelerometers and gyro of recordings by name."""
    steps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Steps of the axes of the gyro that hide its noise at rest [output]; 0 for others."""
    numbered: bool = False
    """True of poses in the hand, which a study leaves out by their numbers."""

    @staticmethod
    def of(records: Mapping[str, Record], means: Mapping[str, Means] | None = None) -> Proposal:
        """Sections of recordings, given by the names of their files, and questions about them.

        Labels of a recording tell its sections, else its name, else what is found in it: rests, steady rates, turns.
        Rows without times are means of poses; ``means`` gives those whose directions or scatter are known.

        Raises
        ------
        RecordError
            A recording has neither accelerometers nor gyros.
        """
        means = means or {}
        files = [RecordedTriads.of(name, record) for name, record in records.items()]
        tables = {file.name: _means(file) for file in files if is_counted(file.record)} | dict(means)
        told: list[SectionRow] = []
        questions: list[Finding] = []
        for file in files:
            if file.name in tables:
                told += rows_of_means(file.name, tables[file.name])
            else:
                found, asked = _rows(file)
                told += found
                questions += asked
        rows = _named_apart(told, several=len(files) > 1)
        sections: list[Section] = []
        for name, table in tables.items():
            sections += sections_of_means([row for row in rows if row.file == name], table)
        recorded = {file.name: file for file in files if file.name not in tables}
        done = cut(stretches_of(rows, recorded))
        sections += done.sections
        scales = {_scale(file.record) for file in files if file.gyro is not None}
        scale = scales.pop() if len(scales) == 1 else None
        asked = [*questions, *contradictions(sections, scale)]
        notes = tuple(one for one in asked if not one.harm)
        asked = [one for one in asked if one not in notes]
        return Proposal._whole(rows, sections, recorded, done.unused, tuple(asked), (*notes, *done.notes))

    @staticmethod
    def by(rows: Sequence[SectionRow], records: Mapping[str, Record], *, backward: bool = False) -> Proposal:
        """The sections that rows state of recordings, given by the names of their files; ``backward`` is a gyro that
        counts against the right-hand rule.

        Raises
        ------
        RecordError
            A recording has neither accelerometers nor gyros.
        StudyError
            A row names another file, or the rows of a table of means are more or fewer than its own.
        """
        files = {name: RecordedTriads.of(name, record) for name, record in records.items()}
        only = next(iter(files)) if len(files) == 1 else ""
        rows = [_by_label(replace(row, file=row.file or only), files) for row in rows]
        for row in rows:
            if row.file not in files:
                raise StudyError(
                    f"section {row.section}",
                    f"found the file {row.file or '(none)'}, expected one of {', '.join(files)}",
                )
        sections: list[Section] = []
        for name, file in files.items():
            if is_counted(file.record):
                mine = [row for row in rows if row.file == name]
                table = _means(file)
                count = len(next(iter(file.record.columns.values())).values)
                if len(mine) != count:
                    raise StudyError(
                        name,
                        f"found {count} rows of means, but {len(mine)} sections, expected one for each row",
                    )
                sections += sections_of_means(mine, table)
        recorded = {name: file for name, file in files.items() if not is_counted(file.record)}
        done = cut(stretches_of(rows, recorded))
        sections += done.sections
        scales = {_scale(file.record) for file in files.values() if file.gyro is not None}
        scale = scales.pop() if len(scales) == 1 else None
        asked = contradictions(sections, scale, backward=backward)
        return Proposal._whole(rows, sections, recorded, done.unused, asked, done.notes)

    @staticmethod
    def _whole(
        rows: Sequence[SectionRow],
        sections: Sequence[Section],
        recorded: Mapping[str, RecordedTriads],
        unused: Mapping[str, str],
        questions: tuple[Finding, ...],
        notes: tuple[Finding, ...],
    ) -> Proposal:
        """The proposal with the moves and swings that rows are of."""
        triads = {name: (file.acc, file.gyro) for name, file in recorded.items()}
        moves, no_moves = moves_of(rows, sections, triads)
        swings = swings_of(rows, triads)
        won = {one.name: "sections at rest tell more than a swing" for one in swings if sections}
        return Proposal(
            tuple(rows),
            tuple(sections),
            {**unused, **no_moves, **won},
            questions,
            notes,
            moves,
            swings,
            triads,
        )


@dataclass(frozen=True, eq=False)
class RecordedTriads:
    """A recording by name, with its triads; None: not there, or not whole."""

    name: str
    record: Record
    acc: TriadSamples | None
    gyro: TriadSamples | None

    @staticmethod
    def of(name: str, record: Record) -> RecordedTriads:
        """The triads of a record; raises `RecordError` where it has none."""
        acc, gyro = _samples(record, "acc"), _samples(record, "gyro")
        if acc is None and gyro is None:
            raise RecordError(
                name, "found neither three accelerometers nor three gyros, expected one of the two"
            )
        return RecordedTriads(name, record, acc, gyro)

    def stretch(self, row: SectionRow) -> Stretch:
        """The stretch that a row is of; raises `RecordError` for a channel of force that is not there."""
        acc, gyro, force = (
            None if one is None else one.between(row.begin, row.end)
            for one in (self.acc, self.gyro, self._force(row))
        )
        return Stretch(row, acc, gyro, force)

    def _force(self, row: SectionRow) -> TriadSamples | None:
        """Specific force (n, 3) [m/s^2] of the channels that a row names."""
        if not isinstance(row.force, tuple):
            return None
        columns = [self.record[name] for name in row.force]
        for column in columns:
            if column.unit.dimension != "acceleration" or len(column.t) != len(columns[0].t):
                found = f"{column.name} in {column.unit.symbol}, {counted(len(column.t), 'row')}"
                raise RecordError(
                    self.name, f"found {found} as force, expected three accelerations of one clock"
                )
        values = np.stack([column.si() for column in columns], axis=1)
        return TriadSamples(columns[0].t, values, np.zeros(len(values), dtype=bool))


def stretches_of(rows: Sequence[SectionRow], files: Mapping[str, RecordedTriads]) -> list[Stretch]:
    """The stretches that rows are of, in recordings by name.

    A row that names no file is of the only one. Rows of other files are left out: they are not of samples.
    """
    only = next(iter(files)) if len(files) == 1 else ""
    return [files[row.file or only].stretch(row) for row in rows if (row.file or only) in files]


def _rows(file: RecordedTriads) -> tuple[list[SectionRow], list[Finding]]:
    """Rows of a recording by its labels, its name, or what is found in it."""
    clock = file.acc or file.gyro
    assert clock is not None
    if file.record.labels and len(file.record.labels) == len(clock.t):
        rows = _labelled(file, clock)
        if rows:
            return rows, _asked(file.name, rows)
    said = claim(file.name)
    if not said.kind:
        found, asked = rows_of_log(file.name, file.acc, file.gyro, _scale(file.record))
        if file.acc is None:
            return found, asked
        if not found:
            return [as_a_swing(file.name, clock.t)], asked
        return (with_moves_between(found) if file.gyro is not None else found), asked
    name = PurePosixPath(file.name.replace("\\", "/")).stem
    row = _of_claim(said, name, file.name, "name")
    if row.kind == "rest":
        return _held(file, clock, row)
    rows = [_at_its_rate(file, row) if row.kind == "rate" else row]
    return rows, _asked(file.name, rows)


def _at_its_rate(file: RecordedTriads, row: SectionRow) -> SectionRow:
    """A file that holds one rate by its name: its longest stretch at a steady rate, where it has others as well."""
    steady = () if file.gyro is None else steady_rates(file.gyro.t, file.gyro.values)
    if file.gyro is None or not steady:
        return row
    longest, t = max(steady, key=lambda hold: hold.samples), file.gyro.t
    return replace(row, begin=float(t[longest.start]), end=float(t[longest.stop - 1]))


def _held(
    file: RecordedTriads, clock: TriadSamples, row: SectionRow
) -> tuple[list[SectionRow], list[Finding]]:
    """A file that holds one rest by its name: its longest hold; a finding where there is none."""
    gyro = None if file.gyro is None else on_clock(file.gyro, clock.t)
    found = holds_of(clock.t, None if file.acc is None else file.acc.values, gyro)
    holds = found.acc if file.acc is not None else found.gyro
    if not holds:
        why = found.unused[0].why if found.unused else f"it is never still for {LIMITS.shortest_hold:g} s"
        headline = f"{row.section} is not held still: {why}."
        return [], [
            Finding(
                "not_at_rest", headline, file.name, action="Record this side again, at rest.", harm=EVERYTHING
            )
        ]
    longest = max(holds, key=lambda hold: hold.samples)
    begin, end = float(clock.t[longest.start]), float(clock.t[longest.stop - 1])
    whole = longest.samples > (1.0 - LIMITS.cut_of_rest) * len(clock.t)
    return [row if whole else replace(row, begin=begin, end=end)], []


def _labelled(file: RecordedTriads, clock: TriadSamples) -> list[SectionRow]:
    """A row for each run of one label that says something; labels that say nothing are none."""
    labels = np.array(file.record.labels)
    starts = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist()]
    rows = []
    for start, stop in zip(starts, [*starts[1:], len(labels)], strict=True):
        said, t = claim(str(labels[start])), clock.t[start:stop]
        if said.kind and np.isfinite(t).any():
            row = _of_claim(said, str(labels[start]), file.name, "label")
            rows.append(replace(row, begin=float(np.nanmin(t)), end=float(np.nanmax(t))))
    return rows


def _of_claim(said: Claim, name: str, file: str, why: str) -> SectionRow:
    """The row that a name makes."""
    return SectionRow(
        name, file, kind=said.kind or "rest",
        up=direction_of(said.up, name) if said.up else None,
        axis=direction_of(said.axis, name) if said.axis else None,
        rate=None if said.rate is None else quantity_of(said.rate, 0.0, "deg/s"),
        angle=None if said.angle is None else quantity_of(said.angle, 0.0, "deg"),
        why=why if said.kind != "turn" or said.angle is not None else f"{why}: which angle?",
    )  # fmt: skip


def _by_label(row: SectionRow, files: Mapping[str, RecordedTriads]) -> SectionRow:
    """The row with the stretch of the label that is its name, where it states no times or is of a file that is not
    there.

    Raises `StudyError` where it states others.
    """
    for name, file in files.items():
        clock = file.acc or file.gyro
        assert clock is not None
        labels = file.record.labels
        if (
            len(labels) != len(clock.t)
            or (row.file in files and row.file != name)
            or row.section not in labels
        ):
            continue
        t = clock.t[np.array(labels) == row.section]
        begin, end = float(np.nanmin(t)), float(np.nanmax(t))
        if row.file not in files or (row.begin is None and row.end is None):
            return replace(row, file=name, begin=begin, end=end)
        if (row.begin or -np.inf) > end or (row.end or np.inf) < begin:
            raise StudyError(
                f"section {row.section}",
                f"found the label {row.section} from {begin:.2f} s to {end:.2f} s of {name}, outside its begin and "
                "end, expected one of the two: leave begin and end blank, or rename it",
            )
    return row


def _asked(file: str, rows: Sequence[SectionRow]) -> list[Finding]:
    """The question after the angles of turns that names or labels leave open."""
    turns = [row for row in rows if row.kind == "turn" and row.angle is None]
    if not turns:
        return []
    headline = f"The angle of {counted(len(turns), 'turn')} of {file} is not known."
    action = "Write it into the column `angle` of sections.csv, with its sign."
    return [
        Finding(
            "not_stated",
            headline,
            counted_names([row.section for row in turns]),
            action=action,
            harm=EVERYTHING,
        )
    ]


def _named_apart(rows: Sequence[SectionRow], several: bool) -> list[SectionRow]:
    """The rows, names that are there twice with the file, and numbered where that does not tell them apart."""
    named: list[SectionRow] = []
    taken: dict[str, int] = {}
    names = [row.section for row in rows]
    for row in rows:
        stem = PurePosixPath(row.file.replace("\\", "/")).stem
        name = f"{stem}: {row.section}" if several and names.count(row.section) > 1 else row.section
        taken[name] = taken.get(name, 0) + 1
        named.append(replace(row, section=name if taken[name] == 1 else f"{name} {taken[name]}"))
    return named


def _samples(record: Record, sensor: str) -> TriadSamples | None:
    """A triad of a record; None where it is not whole."""
    if all(f"{sensor}_{axis}" in record for axis in "xyz"):
        triad = record.triad(sensor)
        clipped = np.any([at_ends(values) for values in triad.values.T], axis=0)
        values = np.where(erased(triad.values)[:, None], np.nan, triad.values)
        return TriadSamples(triad.t, values, np.asarray(clipped))
    return None


def _values(samples: TriadSamples | None) -> np.ndarray | None:
    """The outputs (n, 3) of a triad."""
    return None if samples is None else samples.values


def _means(file: RecordedTriads) -> Means:
    """The rows of means of a file, with what it says of their noise and of specific force."""
    record = file.record

    def beside(head: str) -> np.ndarray | None:
        names = [f"{head}_{axis}" for axis in "xyz"]
        if not all(name in record for name in names):
            return None
        return np.stack(
            [record[name].si() if head == "up" else record[name].values for name in names], axis=1
        )

    return Means(_values(file.acc), _values(file.gyro), beside("u_acc"), beside("u_gyro"), beside("up"))


def _scale(record: Record) -> float | None:
    """Output of a sound gyro per rad/s; None in counts, or without one."""
    if "gyro_x" not in record or record["gyro_x"].unit.dimension in RAW:
        return None
    return 1.0 / record["gyro_x"].unit.factor
