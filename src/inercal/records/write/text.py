"""Canonical CSV: ``t [s],acc_x [m/s^2],...``, and ``label`` last."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable
from itertools import repeat
from typing import IO

import numpy as np

from inercal.errors import InputError
from inercal.records.clocks import Clocks
from inercal.records.record import Record
from inercal.records.write import titles

TABLE = True
_ROWS = 50_000


def write(record: Record, axes: Clocks, file: IO[bytes], progress: Callable[[int, int], None] | None) -> None:
    """Write a row for each sample, numbers in the fewest digits that read back the same, nothing for NaN.

    Raises `InputError` for a label of several lines.
    """
    (t,) = axes.axes.values()
    labelled = axes.labels is not None
    lines = io.TextIOWrapper(file, encoding="utf-8", newline="\n", write_through=True)
    lines.write(",".join(["t [s]", *titles(record), *(["label"] if labelled else [])]) + "\n")
    for start in range(0, len(t), _ROWS):
        rows = slice(start, start + _ROWS)
        block = np.column_stack([t[rows], *(column.values[rows] for column in record.columns.values())])
        ends = (f",{quoted(label)}" for label in record.labels[rows]) if labelled else repeat("")
        lines.writelines(
            f"{','.join(map(number, row))}{end}\n" for row, end in zip(block.tolist(), ends, strict=False)
        )
        if progress is not None:
            progress(min(start + _ROWS, len(t)), len(t))
    lines.detach()


def number(value: float) -> str:
    """A number in the fewest digits that read back the same; nothing for what is no number, or lost in overflow."""
    return repr(value) if math.isfinite(value) else ""


def quoted(label: str) -> str:
    """A label as a field of a row."""
    if not re.search('[,"\r\n]', label):
        return label
    if len(label.splitlines()) > 1:
        raise InputError("label", f"found {label[:60]!r}, expected one line for a .csv file")
    return '"' + label.replace('"', '""') + '"'
