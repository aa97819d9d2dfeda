"""Rows of mean outputs, one for each pose or orientation: a record whose times do not matter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.record import Record

_OF_A_FILE = ("nan", "bad_row", "truncated", "file_changed", "resolution")
"""Codes that hold for any table; others judge samples in time."""


def rows_of(record: Record, sensor: str) -> tuple[Array, NDArray[np.int64], tuple[Finding, ...]]:
    """Mean outputs (n, 3) of the rows that are whole, their numbers (n,) from 1, and the findings that count for rows.

    Raises `RecordError` where the record lacks the triad of the ``sensor``.
    """
    values = record.triad(sensor).values
    whole = np.isfinite(values).all(axis=1)
    findings = tuple(finding for finding in record.findings if finding.code in _OF_A_FILE)
    return values[whole], np.flatnonzero(whole) + 1, findings


def is_counted(record: Record) -> bool:
    """True where the rows of a record have no times: they are counted 0, 1, 2, ..."""
    return all(
        np.array_equal(column.t, np.arange(len(column.t), dtype=float)) for column in record.columns.values()
    )
