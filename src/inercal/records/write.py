"""Records out: canonical CSV."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from inercal._files import replacing
from inercal.errors import InputError
from inercal.records.record import Record

_ROWS = 50_000


def write_csv(record: Record, path: str | Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Write a record as canonical CSV (``t [s],acc_x [m/s^2],...``), whole or not at all.

    Parameters
    ----------
    record : Record
        Its columns must have one clock between them.
    path : str or Path
    progress : callable, optional
        Told (rows done, rows in all).

    Raises
    ------
    InputError
        Columns on different clocks, or a file that cannot be written.
    """
    columns = list(record.columns.values())
    if not columns:
        raise InputError(path, "the record has no columns to write")
    t = columns[0].t
    for column in columns:
        if column.t is not t and not np.array_equal(column.t, t):
            raise InputError(
                path, f"{column.name} has another clock than {columns[0].name}, expected one for a table"
            )
    names = ["t [s]", *(f"{column.name} [{column.unit.symbol}]" for column in columns)]
    with replacing(path, "w") as file:
        file.write(",".join(names) + "\n")
        for start in range(0, len(t), _ROWS):
            rows = slice(start, start + _ROWS)
            block = np.column_stack([t[rows], *(column.values[rows] for column in columns)])
            file.writelines(",".join(map(_text, row)) + "\n" for row in block.tolist())
            if progress is not None:
                progress(min(start + _ROWS, len(t)), len(t))


def _text(value: float) -> str:
    """A number in the fewest digits that read back the same; nothing for NaN."""
    return "" if value != value else repr(value)
