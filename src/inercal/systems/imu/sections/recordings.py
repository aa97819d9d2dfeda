"""Recordings of sections: by the names of their files, of one unit, and with what was found in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Triad
from inercal.foundation.records.record import Record
from inercal.systems.imu.limits import LIMITS as IMU_LIMITS
from inercal.systems.imu.rows import is_counted, rows_of
from inercal.systems.imu.settings import MASKED


def by_file(records: Sequence[Record]) -> dict[str, Record]:
    """The records by the names of their files."""
    named: dict[str, Record] = {}
    for record in records:
        name = PurePath(record.sources[0].path).name if record.sources else "recording"
        named[name if name not in named else f"{name} ({len(named) + 1})"] = record
    return named


def unit_of(sensor: str, records: Sequence[Record]) -> Triad | None:
    """A triad of the records, which tells the unit of all; None where there is none."""
    triads = [
        record.triad(sensor) for record in records if all(f"{sensor}_{axis}" in record for axis in "xyz")
    ]
    symbols = {triad.unit.symbol for triad in triads}
    if len(symbols) > 1:
        raise RecordError(
            triads[-1].source.path,
            f"found {sensor} in {' and '.join(sorted(symbols))}, expected one unit in all files",
        )
    return triads[0] if triads else None


def refuse_samples(named: Mapping[str, Record]) -> None:
    """Refuse rows without times that are samples of a recording: most of many are like the one before.

    Raises `RecordError`.
    """
    for name, record in named.items():
        sensor = "acc" if "acc_x" in record else "gyro"
        if not is_counted(record) or f"{sensor}_z" not in record:
            continue
        values = record.triad(sensor).values
        size = max(float(np.nanmax(np.ptp(values, axis=0))), float(np.nanmax(np.abs(values))))
        alike = np.linalg.norm(np.diff(values, axis=0), axis=1) < 10.0 * IMU_LIMITS.same_pose * size
        if len(values) > IMU_LIMITS.most_poses and np.mean(alike) > 0.5:
            raise RecordError(
                name,
                f"found {len(values)} rows, most of them like the one before, expected one row for each pose, or of "
                'a recording a time column t and imu.method = "sections"',
            )


def findings_of_records(records: Sequence[Record]) -> tuple[Finding, ...]:
    """Findings about the recordings; those about time do not hold for rows of means."""
    found: dict[Finding, None] = {}
    for record in records:
        counted = is_counted(record)
        sensor = "acc" if "acc_x" in record else "gyro"
        for finding in rows_of(record, sensor)[2] if counted else record.findings:
            found[replace(finding, harm=()) if finding.code in MASKED else finding] = None
    return tuple(found)
