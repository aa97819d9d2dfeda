"""Checks of a record just read: what its stamps and values tell about how it was recorded.

Nothing is changed, dropped or decided here; a check only says what is suspicious and where, and ordinary
motion and noise say nothing. Rows are counted from 1, the first row of data.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import may_be_empty, of_a_table
from inercal.foundation.records.checks.angles import angle_findings
from inercal.foundation.records.checks.stretches import of_stretches
from inercal.foundation.records.checks.values import (
    accelerometer_unit,
    dead_channel,
    gyro_unit,
    outliers,
    saturation,
    temperature_unit,
    time_axis,
    time_unit,
)
from inercal.foundation.records.column import Column
from inercal.foundation.records.places import counted, places

_SENSOR = re.compile(r"acc_[xyz]|a\d+|gyro\w*")
_MEASURED = re.compile(r"acc_[xyz]|a\d+|gyro\w*|y_[xy]|temperature")


def check(columns: Mapping[str, Column]) -> tuple[Finding, ...]:
    """Everything suspicious about the ``columns`` of a record, by name, apart from what their readers have said.

    Each time axis that they share is looked at once.
    """
    clocks = {id(column.t): column for column in columns.values()}
    sampled = not of_a_table(columns)
    findings: list[Finding] = []
    with np.errstate(all="ignore"):
        for column in clocks.values():
            subject = "t" if len(clocks) == 1 else f"t of {Path(column.source.path).name}"
            findings += time_axis(column.t, subject)
            findings += time_unit(column.t, subject) if sampled else []
        for column in columns.values():
            if _MEASURED.fullmatch(column.name):
                findings += saturation(column.values, column.name)
                findings += outliers(column.values, column.name)
            if _SENSOR.fullmatch(column.name):
                findings += dead_channel(column.values, column.name)
            if column.name == "temperature":
                findings += temperature_unit(column)
        for clock in clocks.values():
            of_clock = [c for c in columns.values() if c.t is clock.t and _SENSOR.fullmatch(c.name)]
            if sampled and of_clock:
                values = np.stack([c.values for c in of_clock], axis=1)
                findings += of_stretches(values, [c.name for c in of_clock])
        findings += accelerometer_unit(columns)
        findings += gyro_unit(columns)
        findings += angle_findings(columns)
    return tuple(findings)


def missing(values: Mapping[str, Array]) -> tuple[Finding, ...]:
    """``nan``: rows of each column (by name) that hold no number, where all should."""
    empty = {name: np.flatnonzero(np.isnan(column)) for name, column in values.items()}
    return tuple(
        Finding("nan", f"{name}: {counted(rows.size, 'missing value')}", places("row", rows + 1))
        for name, rows in empty.items()
        if rows.size and not may_be_empty(name)
    )


def too_long(name: str, word: str, numbers: ArrayLike) -> Finding:
    """``resolution``: whole numbers of a column that float64 cannot hold, in the lines or rows of these ``numbers``."""
    count = counted(np.size(numbers), "whole number")
    return Finding("resolution", f"{name}: {count} beyond 2^53, rounded to 53 bits", places(word, numbers))
