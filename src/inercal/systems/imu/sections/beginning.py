"""The table of sections that a new study begins with, where recordings tell one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.records.record import Record
from inercal.systems.imu.rows import is_counted
from inercal.systems.imu.sections.cutting.proposal import Proposal
from inercal.systems.imu.sections.cutting.table import SectionRow, stated_rows, table_text
from inercal.systems.imu.sections.cutting.words import claim
from inercal.systems.imu.sections.recordings import by_file, refuse_samples
from inercal.systems.imu.settings import ImuSettings, MeansSettings, SectionsSettings


def beginning(records: Sequence[Record]) -> tuple[str, tuple[Finding, ...]] | None:
    """The text of ``sections.csv`` for recordings, and what is asked about it.

    None where another method serves them: angles of a table, labels that leave something open, poses in the hand with
    moves between them, rows without times that are samples.
    """
    named = by_file(records)
    if any("phi1" in record for record in records) or not _told(named):
        return None
    try:
        refuse_samples(named)
        found = Proposal.of(named)
    except InputError:
        return None
    if any(record.labels for record in records) and not _labelled(found.rows):
        return None
    one_log = len(named) == 1 and not is_counted(records[0]) and not claim(next(iter(named))).kind
    if not found.rows or (one_log and all(row.up is None for row in found.rows)):
        return None
    return table_text(found.rows), found.questions


def needs_gyro(settings: ImuSettings | None, records: Sequence[Record]) -> bool:
    """False for rests alone, of which accelerometers tell all but the biases of a gyro; ``settings`` is None of a new
    study, which has the sections of `beginning`.

    Raises `InputError` for sections that cannot be read.
    """
    method = SectionsSettings() if settings is None else settings.method
    if not all("acc_x" in record for record in records):
        return True
    if isinstance(method, MeansSettings):
        return False
    if not isinstance(method, SectionsSettings) or (settings is None and beginning(records) is None):
        return True
    rows = stated_rows(method) or Proposal.of(by_file(records)).rows
    return not rows or any(row.kind != "rest" for row in rows)


def _labelled(rows: Sequence[SectionRow]) -> bool:
    """True where labels say what is known of their stretches; turns of no angle are those of the method ferraris."""
    by_label = [row for row in rows if row.why.startswith("label")]
    return bool(by_label) and not any(row.kind == "turn" and row.angle is None for row in by_label)


def _told(named: Mapping[str, Record]) -> bool:
    """True of one recording, and of several where a name says what its file holds, or one is a table of means."""
    return len(named) == 1 or any(claim(name).kind or is_counted(record) for name, record in named.items())
